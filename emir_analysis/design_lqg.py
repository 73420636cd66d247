"""`emir design --controller lqg`: the oil to design for where it is known within a tolerance."""

from argparse import Namespace
from collections.abc import Callable
from dataclasses import replace
from itertools import product

import yaml

from emir_analysis.machine_model import lqg_parameters
from emir_analysis.outputs import write_text
from emir_analysis.stability_map import ANGLES, PAYLOADS, table
from emir_common.quantity import ParameterError
from emir_control.lqg import LqgParameters
from emir_control.softness import Case, Robustness
from emir_plant.parameters import Machine

CONTROLLERS = ("lqg", "mpc")
DISTANCE = 0.06375  # m, of the paper's move (3.2)
LARGEST_TOLERANCE = 0.5


def command(machine: Machine, options: Namespace, progress: Callable[[str], None]) -> str:
    """Find the softness, write a ROS parameter file, return what to tell.

    Raises InputError, ParameterError.
    """
    tolerance = options.oil_tolerance
    if not 0.0 < tolerance <= LARGEST_TOLERANCE:
        raise ParameterError(f"oil_tolerance = {tolerance:g}: over 0 and up to {LARGEST_TOLERANCE}")
    parameters = _parameters(machine)
    progress("softness with the smallest bending at both ends of the tolerance")
    softness = round(Robustness(parameters).best(tolerance), 2)
    delay = parameters.regulator.delay
    values = {"softness": softness} | ({"regulator.delay": delay} if delay else {})
    _write(options, values)
    progress("bending over posture and payload")
    cases = tuple(Case(*case) for case in product(ANGLES, PAYLOADS, (DISTANCE, -DISTANCE)))
    oils = 1.0 - tolerance, 1.0, 1.0 + tolerance
    found = Robustness(parameters, cases).ratios(softness, oils)
    worse = found.reshape(len(ANGLES), len(PAYLOADS), 2, len(oils)).max(axis=2)
    shown = [table(ANGLES, PAYLOADS, worse[..., k].T, "{:11.2f}".format) for k in range(len(oils))]
    return (
        f"{options.out}: softness {softness:g}\n"
        "R, largest bending over the limit, linear, worse of lifting and lowering:\n"
        + "\n".join(f"  oil {o:.0%} of the stated\n{t}" for o, t in zip(oils, shown, strict=True))
    )


def _parameters(machine: Machine) -> LqgParameters:
    """Return those of a control that knows the machine as stated, its delay included."""
    parameters = lqg_parameters(machine)
    delay = machine.effects.command_delay.delay
    return replace(parameters, regulator=replace(parameters.regulator, delay=delay))


def _write(options: Namespace, values: dict[str, float]) -> None:
    source = f"--from {options.machine} " if options.machine else ""
    words = f"{source}--controller {options.controller}"
    made_by = f"# emir design {words} --oil-tolerance {options.oil_tolerance:g}\n"
    file, content = options.out, {f"{options.controller}_node": {"ros__parameters": values}}
    write_text(file, made_by + yaml.safe_dump(content))

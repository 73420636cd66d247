"""`emir design --controller lqg`: the oil to design for where it is known within a tolerance."""

import math
from argparse import Namespace
from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np
import yaml
from numpy.typing import NDArray

from emir_analysis.machine_model import lqg_parameters
from emir_analysis.outputs import write_text
from emir_common.quantity import ParameterError
from emir_control.lqg import LqgParameters
from emir_control.softness import Case, Robustness
from emir_plant.parameters import Machine

CONTROLLERS = ("lqg", "mpc")
ANGLES = tuple(math.radians(angle) for angle in (30.0, 45.0, 60.0, 75.0))
PAYLOADS = (0.0, 500.0, 1000.0, 1500.0)  # kg
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
    tables = [
        f"  oil {oil:.0%} of the stated\n{_table(worse[..., k])}" for k, oil in enumerate(oils)
    ]
    return (
        f"{options.out}: softness {softness:g}\n"
        "R, largest bending over the limit, linear, worse of lifting and lowering:\n"
        + "\n".join(tables)
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


def _table(values: NDArray[np.float64]) -> str:
    """Return a table of payloads down, angles across; values: (angles, payloads)."""
    lines = [f"  {'payload':>10}" + "".join(f"{math.degrees(a):7.0f} deg" for a in ANGLES)]
    for payload, row in zip(PAYLOADS, values.T, strict=True):
        lines.append(f"  {payload:7.0f} kg" + "".join(f"{value:11.2f}" for value in row))
    return "\n".join(lines)

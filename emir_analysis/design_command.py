"""`emir design`: a predictive controller from a machine's model, as a file that the node loads."""

import math
from argparse import Namespace
from collections.abc import Callable
from pathlib import Path

from emir_analysis.design_pfc import (
    ANGLES,
    ORDERS,
    OUTPUTS,
    PAYLOADS,
    DesignTask,
    OperatingPoint,
    as_text,
    design_pfc,
    picture,
    scheduled,
    stability_map,
)
from emir_analysis.errors import InputError
from emir_common.parameter_tree import with_values
from emir_common.quantity import ParameterError
from emir_control import pfc_file
from emir_plant.parameters import Machine, cautions
from emir_plant.plant import SimulationError
from emir_plant.sheet import joint1, load_sheet


def command(options: Namespace, progress: Callable[[str], None]) -> str:
    """Design, check, write the file; return what to tell. Raises InputError, ParameterError."""
    if options.controller not in OUTPUTS:
        raise ParameterError(f"controller {options.controller!r}: there are {', '.join(OUTPUTS)}")
    output = OUTPUTS[options.controller]
    task = DesignTask(
        controller=options.controller,
        order=options.order or ORDERS[output],
        point=OperatingPoint(angle=math.radians(options.angle), payload=options.payload),
        observer=options.observer,
        tuning=_tuning(options),
    )
    machine = _machine(options.machine)
    for line in cautions(with_values(machine, {"geometry.payload": options.payload})):
        progress(line)
    progress("linearizing and reducing")
    try:
        if options.schedule:
            parameters = scheduled(machine, task, ANGLES, PAYLOADS)
        else:
            parameters = design_pfc(machine, task)
    except SimulationError as error:
        raise InputError(str(error)) from None
    pfc_file.save(options.out, parameters, output, _made_by(options, task))
    progress("stability over posture and payload")
    found = stability_map(machine, options.controller, parameters)
    if options.picture:
        try:
            picture(found).savefig(options.picture, dpi=120)
        except (OSError, ValueError) as error:
            raise InputError(f"{options.picture}: {error}") from None
    stable = "stable everywhere" if found.worst < 1.0 else "NOT stable everywhere (!)"
    return (
        f"{options.out}: {options.controller} of order {parameters.model.order}; {stable}\n"
        f"largest |z| of the closed loop's poles (- : no such motion):\n{as_text(found)}"
    )


def _machine(name: str) -> Machine:
    return joint1() if name == "joint1" else load_sheet(Path(name)).machine


def _tuning(options: Namespace) -> dict[str, object]:
    given: dict[str, object] = {"response_time": options.response_time}
    if options.coincidence:
        given["coincidence"] = tuple(options.coincidence)
    return {name: value for name, value in given.items() if value is not None}


def _made_by(options: Namespace, task: DesignTask) -> dict[str, object]:
    words = [f"--from {options.machine}", f"--controller {task.controller}"]
    words += [f"--order {task.order}", f"--angle {options.angle:g}"]
    words += ["--schedule"] if options.schedule else []
    words += [f"--payload {options.payload:g}", f"--observer {options.observer:g}"]
    return {
        "command": f"emir design {' '.join(words)}",
        "linearized at": f"piston velocity {task.point.velocity:g} m/s, force loop closed",
    }

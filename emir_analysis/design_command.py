"""`emir design`: a controller from a machine's model, as a file that the node loads."""

import math
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Sequence
from pathlib import Path

from emir_analysis import design_lqg
from emir_analysis.design_pfc import (
    ORDERS,
    OUTPUTS,
    DesignTask,
    OperatingPoint,
    design_pfc,
    designed,
    scheduled,
    velocity_model,
)
from emir_analysis.errors import InputError
from emir_analysis.identify import difference, from_recording
from emir_analysis.outputs import check_outputs, check_picture, write_picture
from emir_analysis.stability_map import ANGLES, PAYLOADS, as_text, picture, stability_map
from emir_analysis.unused_options import check_unused
from emir_common.parameter_tree import with_values
from emir_common.quantity import ParameterError
from emir_control import pfc_file
from emir_control.pfc import PfcParameters
from emir_plant.parameters import Machine, cautions
from emir_plant.plant import SimulationError
from emir_plant.sheet import joint1, load_sheet

ABOUT = (
    "A controller for a machine, or from a recording, as a file that its node loads; and where over"
    " posture and payload the closed loop is stable."
)
RECORDED_ORDER = 4  # an ordinary run tells no more than the integrator and the slow mode
OF_PFC = {
    "order": None, "angle": 45.0, "payload": 0.0, "observer": 0.0, "schedule": False,
    "coincidence": None, "response_time": None, "picture": None,
}  # fmt: skip
OF_LQG = {"oil_tolerance": 0.2}
COMPARED = (0.1, 0.3, 0.5, 0.7)  # Hz


def command(words: Sequence[str], progress: Callable[[str], None]) -> str:
    """Design, check, write the file; return what to tell. Raises InputError, ParameterError."""
    options = _parser().parse_args(words)
    check_outputs([options.out, options.picture], None, [options.machine])
    check_picture(options.picture)
    recorded = _is_recording(options.machine)
    if options.controller in design_lqg.CONTROLLERS:
        if recorded:
            raise InputError(f"--controller {options.controller}: a machine's YAML is needed")
        check_unused(options, OF_PFC, f"of pfc and pfc_tip, not of {options.controller}")
        return design_lqg.command(_machine(options.machine), options, progress)
    if options.controller not in OUTPUTS:
        known = ", ".join((*OUTPUTS, *design_lqg.CONTROLLERS))
        raise ParameterError(f"controller {options.controller!r}: there are {known}")
    check_unused(options, OF_LQG, f"of lqg and mpc, not of {options.controller}")
    return _pfc(options, progress, recorded=recorded)


def _pfc(options: Namespace, progress: Callable[[str], None], *, recorded: bool) -> str:
    """As `command`, of a predictive controller; recorded: from a recording."""
    source = options.machine or "joint 1"
    if not 0.0 <= options.observer < math.inf:
        raise ParameterError(f"observer = {options.observer:g} m/s: has to be 0 or more")
    output = OUTPUTS[options.controller]
    task = DesignTask(
        controller=options.controller,
        order=_order(options.order, RECORDED_ORDER if recorded else ORDERS[output]),
        point=OperatingPoint(angle=math.radians(options.angle), payload=options.payload),
        observer=options.observer,
        tuning=_tuning(options),
    )
    machine = joint1() if recorded else _machine(options.machine)
    for line in cautions(with_values(machine, {"geometry.payload": options.payload})):
        progress(line)
    progress("identifying" if recorded else "linearizing and reducing")
    found_model = ""
    try:
        if recorded:
            parameters, found_model = _identified(options.machine, machine, task, options)
        elif options.schedule:
            parameters = scheduled(machine, task, ANGLES, PAYLOADS)
        else:
            parameters = design_pfc(machine, task)
    except SimulationError as error:
        raise InputError(f"{source}: {error}") from None
    pfc_file.save(options.out, parameters, output, _made_by(options, task))
    progress("stability over posture and payload")
    found = stability_map(machine, options.controller, parameters)
    if options.picture:
        write_picture(options.picture, picture(found))
    stable = "stable everywhere" if found.worst < 1.0 else "NOT stable everywhere (!)"
    return (
        f"{options.out}: {options.controller} of order {parameters.model.order}; {stable}\n"
        f"{found_model}"
        f"largest |z| of the closed loop's poles (- : no such motion):\n{as_text(found)}"
    )


def _parser() -> ArgumentParser:
    parser = ArgumentParser(prog="emir design", description=ABOUT)
    parser.add_argument(
        "--from", dest="machine", metavar="MODEL|BAG", type=Path,
        help="YAML of the machine or recording of a run; default: EMIR's joint 1",
    )  # fmt: skip
    parser.add_argument("--controller", default="pfc", help="pfc (default), pfc_tip, lqg, mpc")
    parser.add_argument(
        "--order", type=int, help="of the internal model; default 6, tip 8, from a recording 4"
    )
    parser.add_argument(
        "--angle", type=float, default=45.0, metavar="DEG", help="of the boom; default 45"
    )
    parser.add_argument(
        "--payload", type=float, default=0.0, metavar="KG", help="at the TCP; default 0"
    )
    parser.add_argument(
        "--observer", type=float, default=0.0, metavar="M/S",
        help="Kalman filter in place of an independent model: unknown input's change per sample",
    )  # fmt: skip
    parser.add_argument(
        "--schedule", action="store_true",
        help="models over posture and payload, which the controller reads off the static force",
    )  # fmt: skip
    parser.add_argument("--coincidence", type=int, nargs="+", metavar="H", help="samples ahead")
    parser.add_argument("--response-time", type=float, metavar="S", help="T_CLRT")
    parser.add_argument(
        "--oil-tolerance", type=float, default=OF_LQG["oil_tolerance"], metavar="X",
        help="of lqg and mpc: by how much the oil's stiffness may differ from what is stated;"
        " default 0.2",
    )  # fmt: skip
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="YAML to write")
    parser.add_argument("--picture", type=Path, metavar="FILE", help="the stability map as PNG")
    return parser


def _order(given: int | None, usual: int) -> int:
    return usual if given is None else given


def _is_recording(path: Path | None) -> bool:
    return path is not None and (path.is_dir() or path.suffix == ".mcap")


def _identified(
    bag: Path, machine: Machine, task: DesignTask, options: Namespace
) -> tuple[PfcParameters, str]:
    """Return a design by a recording's model, and how that compares with the machine's own."""
    if options.schedule:
        raise InputError("--schedule: one recording tells one model; a machine's YAML is needed")
    output = OUTPUTS[task.controller]
    identified = from_recording(bag, output, task.order)
    linear = velocity_model(machine, task.point, output)
    errors = difference(identified.model, linear, COMPARED)
    told = ", ".join(f"{f:g} Hz {e:.0%}" for f, e in zip(COMPARED, errors, strict=True))
    return designed(identified.model, task), (
        f"explains {identified.fit:.0%} of the recorded motion; off the linearized machine at"
        f" {math.degrees(task.point.angle):g} deg, {task.point.payload:g} kg: {told}\n"
    )


def _machine(file: Path | None) -> Machine:
    return joint1() if file is None else load_sheet(file).machine


def _tuning(options: Namespace) -> dict[str, object]:
    given: dict[str, object] = {"response_time": options.response_time}
    if options.coincidence:
        given["coincidence"] = tuple(options.coincidence)
    return {name: value for name, value in given.items() if value is not None}


def _made_by(options: Namespace, task: DesignTask) -> dict[str, str]:
    words = [f"--from {options.machine}"] if options.machine else []
    words += [f"--controller {task.controller}"]
    words += [f"--order {task.order}", f"--angle {options.angle:g}"]
    words += ["--schedule"] if options.schedule else []
    words += [f"--payload {options.payload:g}", f"--observer {options.observer:g}"]
    if options.coincidence:
        words.append(f"--coincidence {' '.join(map(str, options.coincidence))}")
    if options.response_time is not None:
        words.append(f"--response-time {options.response_time:g}")
    made_by = {"command": f"emir design {' '.join(words)}"}
    if not _is_recording(options.machine):
        slow = f"piston velocity {task.point.velocity:g} m/s, force loop closed"
        made_by["linearized at"] = slow
    return made_by

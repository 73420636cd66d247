"""`emir linearize`: linear design models of the machine as numbers and a picture."""

import argparse
import json
import math
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from emir_analysis.errors import InputError
from emir_analysis.linear_models import (
    FREQUENCIES,
    FULL,
    NONLINEAR,
    ORDERS,
    UP_TO,
    DesignModels,
    Point,
    design_models,
)
from emir_analysis.report import new_figure
from emir_common.parameter_tree import with_values
from emir_plant.core import Truth
from emir_plant.parameters import Machine, cautions
from emir_plant.plant import Plant, SimulationError
from emir_plant.sheet import joint1, load_sheet

PICTURE, NUMBERS = "linear.png", "linear.json"


def command(words: list[str], progress: Callable[[str], None]) -> str:
    """Linearize, reduce, compare, write the files; return what to tell.

    Raises InputError and ParameterError.
    """
    options = _parser().parse_args(words)
    if find_spec("control") is None:
        raise InputError("needs python-control: pip install 'emir_ros[design]'")
    for name in options.outputs:
        if name not in Truth._fields:
            raise InputError(f"output {name!r}: there are {', '.join(Truth._fields)}")
    machine = joint1() if options.machine == "joint1" else load_sheet(Path(options.machine)).machine
    if options.payload is not None:
        machine = with_values(machine, {"geometry.payload": options.payload})
    for line in cautions(machine):
        progress(line)
    _check_valve(options)
    velocity = None if options.command is not None else options.velocity * 1e-3
    if velocity == 0.0 or options.command == 0.0:
        raise InputError("at rest the valve is in its dead zone: the machine has to move")
    point = Point(math.radians(options.angle), velocity, options.command or 0.0)
    found = _models(machine, point, options)
    _write(found, point, options)
    return as_text(found) + f"\n{options.out / PICTURE}\n{options.out / NUMBERS}"


def _check_valve(options: argparse.Namespace) -> None:
    """Raise InputError for what no valve does: y2 is a share of its full opening."""
    if options.command is not None and not abs(options.command) <= 1.0:
        raise InputError(f"command = {options.command:g}: outside -1 ... 1")
    if not 0.0 < abs(options.step) <= 1.0:
        raise InputError(f"step = {options.step:g}: outside -1 ... 1, or none")


def _models(machine: Machine, point: Point, options: argparse.Namespace) -> DesignModels:
    try:
        return design_models(Plant(machine), point, options.outputs, options.order, options.step)
    except SimulationError as error:
        raise InputError(f"{options.machine}: {error}") from None


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="emir linearize",
        description="Linear models of the machine in a steady motion, as it is and reduced, with"
        f" their errors over frequency and against a nonlinear step: {PICTURE} and {NUMBERS}."
        " Needs the extra `design`.",
    )
    parser.add_argument(
        "--from", dest="machine", metavar="MODEL", default="joint1",
        help="YAML of the machine; default: EMIR's joint 1",
    )  # fmt: skip
    parser.add_argument(
        "--angle", type=float, default=45.0, metavar="DEG", help="of the boom; default 45"
    )
    parser.add_argument(
        "--payload", type=float, metavar="KG", help="at the TCP; default: the machine's"
    )
    motion = parser.add_mutually_exclusive_group()
    motion.add_argument(
        "--velocity", type=float, default=10.0, metavar="MM/S", help="of the piston; default 10"
    )
    motion.add_argument("--command", type=float, metavar="Y2", help="instead: the valve's, -1 to 1")
    parser.add_argument(
        "--outputs", nargs="+", metavar="NAME", default=["stroke", "tip_angle"],
        help="default stroke tip_angle; also velocity, force, pressure_lifting, ...",
    )  # fmt: skip
    parser.add_argument(
        "--order", type=int, nargs="+", metavar="N", default=list(ORDERS),
        help=f"of the reduced models; default {' '.join(map(str, ORDERS))}",
    )  # fmt: skip
    parser.add_argument(
        "--step", type=float, default=0.02, metavar="Y2",
        help="of the valve, for the step response that is compared; default 0.02",
    )  # fmt: skip
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="where to write")
    return parser


def as_text(found: DesignModels) -> str:
    """Return the errors of all models as a table."""
    frequencies = "".join(f"{f'to {f:g} Hz':>10}" for f in UP_TO)
    order = found.systems[FULL].nstates
    lines = [
        f"linear model of order {order}, from y2; reduced: largest error over the size",
        "(large where the size is zero); step: rms off the nonlinear step response",
        f"{'output':>16}  {'model':<20}{frequencies}{'step':>10}",
    ]
    for output in found.outputs:
        for name in found.systems:
            errors = (
                "".join(f"{found.worst(name, output, f):10.2%}" for f in UP_TO)
                if name != FULL
                else " " * 10 * len(UP_TO)
            )
            lines.append(f"{output:>16}  {name:<20}{errors}{found.off(name, output):10.2%}")
    return "\n".join(lines)


def _write(found: DesignModels, point: Point, options: argparse.Namespace) -> None:
    try:
        options.out.mkdir(parents=True, exist_ok=True)
        picture(found).savefig(options.out / PICTURE, dpi=120)
        text = json.dumps(_numbers(found, point, options), indent=1, allow_nan=False)
        (options.out / NUMBERS).write_text(text + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"{error.filename}: {error.strerror}") from None


def _numbers(found: DesignModels, point: Point, options: argparse.Namespace) -> dict[str, Any]:
    def entry(name: str, system: Any) -> dict[str, Any]:
        matrices = {key: np.asarray(getattr(system, key)).tolist() for key in "ABCD"}
        off = {output: found.off(name, output) for output in found.outputs}
        if name == FULL:
            return matrices | {"off_nonlinear_step": off}
        worst = {
            output: {f"{f:g}": found.worst(name, output, f) for f in UP_TO}
            for output in found.outputs
        }
        return matrices | {"largest_error_up_to_hz": worst, "off_nonlinear_step": off}

    return {
        "machine": options.machine,
        "angle": point.angle,
        "velocity": point.velocity,
        "command": None if point.velocity is not None else point.command,
        "payload": options.payload,
        "input": "y2",
        "outputs": list(found.outputs),
        "step": options.step,
        "models": {name: entry(name, system) for name, system in found.systems.items()},
    }


def picture(found: DesignModels) -> Figure:
    """Return one row an output: size, error over frequency, step response."""
    figure = new_figure(3.4 * len(found.outputs))
    diagrams = figure.subplots(len(found.outputs), 3, squeeze=False)
    for k, (output, (size, error, step)) in enumerate(zip(found.outputs, diagrams, strict=True)):
        for name, response in found.response.items():
            style = {"color": "k", "lw": 2.0, "alpha": 0.4} if name == FULL else {"lw": 1.0}
            size.loglog(FREQUENCIES, abs(response[k]), label=name, **style)
        for colour, (name, off) in enumerate(found.error.items()):
            error.loglog(FREQUENCIES, off[k], lw=1.0, color=f"C{colour}", label=name)
        step.plot(found.time, found.step[NONLINEAR][k], "k:", lw=2.0, label=NONLINEAR)
        for name, course in found.step.items():
            if name != NONLINEAR:
                style = {"color": "k", "lw": 2.0, "alpha": 0.4} if name == FULL else {"lw": 1.0}
                step.plot(found.time, course[k], label=name, **style)
        size.set_ylabel(output)
        size.set_title("size over y2", fontsize="medium")
        error.set_title("error over size", fontsize="medium")
        error.set_ylim(1e-5, 1e2)
        step.set_title("after a step of y2", fontsize="medium")
        for axes in (size, error, step):
            axes.grid(visible=True, alpha=0.3)
    diagrams[0, 2].legend(frameon=False, fontsize="x-small")
    for axes, label in zip(diagrams[-1], ("f / Hz", "f / Hz", "time / s"), strict=True):
        axes.set_xlabel(label)
    return figure

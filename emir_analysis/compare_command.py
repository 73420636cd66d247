"""`emir compare`: every controller on the same moves, as one table and one picture."""

import itertools
import math
from argparse import Namespace
from collections.abc import Callable
from pathlib import Path

from matplotlib.figure import Figure

from emir_analysis import damping
from emir_analysis.compare import Run, as_text, controllers, picture, repeated
from emir_analysis.errors import InputError
from emir_analysis.outer_loop import OuterLoop
from emir_common.parameter_tree import with_values
from emir_common.quantity import ParameterError
from emir_control.trajectory import AwayAndBack, TrajectoryParameters, named
from emir_plant.plant import SimulationError
from emir_plant.sheet import joint1

Progress = Callable[[str], None]


def command(options: Namespace, progress: Progress) -> str:
    """Run, draw, return the tables. Raises InputError or ParameterError."""
    if options.damping:
        if options.picture:
            save(damping.picture(joint1()), options.picture)
        return damping.as_text(joint1())
    chosen = select(controllers(options.pfc, options.pfc_tip), options.controllers)
    trajectory = named(options.trajectory, TrajectoryParameters())
    if trajectory.parameters.distance == 0.0:
        raise ParameterError(f"trajectory {options.trajectory!r}: nothing moves in it")
    if options.repeat < 1:
        raise ParameterError(f"repeat = {options.repeat}: at least 1")
    cases = list(itertools.product(options.angle, options.payload))
    if options.picture and len(cases) > 1:
        raise InputError("one picture shows one posture and payload")
    return "\n\n".join(_table(chosen, trajectory, case, options, progress) for case in cases)


def select(known: dict[str, OuterLoop], names: list[str] | None) -> dict[str, OuterLoop]:
    """Return the controllers of these names, or all; raises ParameterError for an unknown one."""
    for name in names or ():
        if name not in known:
            raise ParameterError(f"controller {name!r}: there are {'; '.join(known)}")
    return {name: known[name] for name in names or known}


def _table(
    chosen: dict[str, OuterLoop],
    trajectory: AwayAndBack,
    case: tuple[float, float],
    options: Namespace,
    progress: Progress,
) -> str:
    """Return the table of one case, an angle in deg and a payload in kg."""
    angle, payload = case
    title = f"{angle:g} deg, {payload:g} kg"
    machine = with_values(joint1(), {"geometry.payload": payload})
    runs: dict[str, list[Run]] = {}
    try:
        for name, outer in chosen.items():
            progress(f"{title}: {name}")
            start = math.radians(angle)
            runs[name] = list(repeated(machine, trajectory, outer, start, options.repeat))
    except SimulationError as error:
        return f"{title}: {error}"
    if options.picture:
        save(picture({name: found[0] for name, found in runs.items()}), options.picture)
    return f"{title}\n\n{as_text(runs)}"


def save(figure: Figure, file: Path) -> None:
    """Write a picture; raises InputError, naming the file."""
    try:
        figure.savefig(file, dpi=120)
    except (OSError, ValueError) as error:
        raise InputError(f"{file}: {error}") from None

"""`emir compare`: every controller on the same moves, as one table and one picture."""

import itertools
import math
from argparse import Namespace
from collections.abc import Callable
from pathlib import Path

from emir_analysis import damping
from emir_analysis.compare import Run, as_text, controllers, picture, run
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
        return damping.as_text(joint1())
    chosen = _chosen(options.controllers)
    trajectory = named(options.trajectory, TrajectoryParameters())
    if trajectory.parameters.distance == 0.0:
        raise ParameterError(f"trajectory {options.trajectory!r}: nothing moves in it")
    cases = list(itertools.product(options.angle, options.payload))
    if options.picture and len(cases) > 1:
        raise InputError("one picture shows one posture and payload")
    return "\n\n".join(
        _table(chosen, trajectory, case, options.picture, progress) for case in cases
    )


def _chosen(names: list[str] | None) -> dict[str, OuterLoop]:
    known = controllers()
    for name in names or ():
        if name not in known:
            raise ParameterError(f"controller {name!r}: there are {'; '.join(known)}")
    return {name: known[name] for name in names or known}


def _table(
    chosen: dict[str, OuterLoop],
    trajectory: AwayAndBack,
    case: tuple[float, float],
    file: Path | None,
    progress: Progress,
) -> str:
    """Return the table of one case, an angle in deg and a payload in kg."""
    angle, payload = case
    title = f"{angle:g} deg, {payload:g} kg"
    machine = with_values(joint1(), {"geometry.payload": payload})
    runs: dict[str, Run] = {}
    try:
        for name, outer in chosen.items():
            progress(f"{title}: {name}")
            runs[name] = run(machine, trajectory, outer, math.radians(angle))
    except SimulationError as error:
        return f"{title}: {error}"
    if file:
        _draw(runs, file)
    return f"{title}\n\n{as_text(runs)}"


def _draw(runs: dict[str, Run], file: Path) -> None:
    try:
        picture(runs).savefig(file, dpi=120)
    except (OSError, ValueError) as error:
        raise InputError(f"{file}: {error}") from None

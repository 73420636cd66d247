"""The paper's figures 9, 11 and 12: piston velocity and TCP deflection of three controllers."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path

from emir_analysis.compare import controllers, picture, run
from emir_analysis.errors import InputError
from emir_control.trajectory import TrajectoryParameters, named
from emir_plant.sheet import joint1

FIGURES = {
    9: ("cascade", "conventional joint control"),
    11: ("pfc, preview", "PFC of the joint"),
    12: ("pfc_tip, preview", "PFC of the end point"),
}
FORTY_FIVE = math.radians(45.0)  # paper 3.2: about alpha_1(0) = 45 deg


def draw(only: Sequence[int], folder: Path, progress: Callable[[str], None]) -> list[Path]:
    """Draw figures by their number in the paper into a folder; return the files.

    Raises InputError for a number that is not among them or a folder that cannot be written.
    """
    for number in only:
        if number not in FIGURES:
            raise InputError(f"figure {number}: there are {', '.join(map(str, FIGURES))}")
    trajectory = named("lift-lower", TrajectoryParameters())
    files = []
    for number in only:
        name, title = FIGURES[number]
        progress(f"figure {number}: {title}")
        signals = run(joint1(), trajectory, controllers()[name], FORTY_FIVE)
        files.append(folder / f"figure_{number:02}.png")
        try:
            folder.mkdir(parents=True, exist_ok=True)
            picture({title: signals}).savefig(files[-1], dpi=120)
        except OSError as error:
            raise InputError(f"{files[-1]}: {error.strerror}") from None
    return files

"""The paper's figures 3, 5, 7, 9, 11 and 12 and a table of its numbers, drawn by this machine."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path

from matplotlib.figure import Figure

from emir_analysis import compare, figure_boom, figure_flow, figure_steps, paper_table
from emir_analysis.errors import InputError
from emir_analysis.figure_steps import StepResponses
from emir_analysis.outputs import write_picture, written
from emir_control.trajectory import TrajectoryParameters, named
from emir_plant.parameters import Machine
from emir_plant.sheet import even_edges, joint1

FIGURES = {
    3: "stationary and dynamic deflection of the stretched boom",
    5: "flow over the valve's current",
    7: "step responses of the valve",
    9: "conventional joint control",
    11: "PFC of the joint",
    12: "PFC of the end point",
}
CONTROLLERS = {9: "cascade", 11: "pfc, preview", 12: "pfc_tip, preview"}
FORTY_FIVE = math.radians(45.0)  # paper 3.2: about alpha_1(0) = 45 deg


def draw(only: Sequence[int], folder: Path, progress: Callable[[str], None]) -> list[Path]:
    """Draw figures by their number in the paper into a folder, and the table; return the files.

    Raises InputError for a number that is not among them or a folder that cannot be written.
    """
    for number in only:
        if number not in FIGURES:
            raise InputError(f"figure {number}: there are {', '.join(map(str, FIGURES))}")
    machine, files = joint1(), []
    with written(folder):
        folder.mkdir(parents=True, exist_ok=True)
    steps = figure_steps.step_responses(even_edges())
    for number in only:
        progress(f"figure {number}: {FIGURES[number]}")
        files.append(folder / f"figure_{number:02}.png")
        write_picture(files[-1], _figure(number, machine, steps))
    return files + paper_table.write(paper_table.measure(machine, steps, progress), folder)


def _figure(number: int, machine: Machine, steps: StepResponses) -> Figure:
    if number == 3:  # noqa: PLR2004 (the paper's)
        return figure_boom.picture(figure_boom.deflections(machine))
    if number == 5:  # noqa: PLR2004
        return figure_flow.picture(figure_flow.flow_curves(machine))
    if number == 7:  # noqa: PLR2004
        return figure_steps.picture(steps)
    trajectory = named("lift-lower", TrajectoryParameters())
    loop = compare.controllers()[CONTROLLERS[number]]
    return compare.picture({FIGURES[number]: compare.run(machine, trajectory, loop, FORTY_FIVE)})

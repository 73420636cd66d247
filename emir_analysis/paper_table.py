"""The paper's numbers beside ours, all of them measured when the table is made."""

import json
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from emir_analysis import (
    figure_steps,
    linkage_table,
    paper_numbers_control,
    paper_numbers_machine,
    paper_numbers_robot,
)
from emir_analysis.figure_steps import StepResponses
from emir_analysis.outputs import write_text
from emir_analysis.paper_number import NOT_MEASURED, Number
from emir_plant.parameters import Machine


@dataclass(frozen=True)
class Table:
    """All numbers, and the slow mode of every step response."""

    numbers: list[Number]
    steps: StepResponses

    def as_text(self) -> str:
        """Return both tables in the form of Markdown."""
        lines = [
            "# The paper's numbers",
            "",
            "A number is met when ours rounds to it. Joint 1, boom stretched.",
            "",
            "| # | what | paper | ours | how it was measured | met |",
            "| ---: | --- | --- | --- | --- | --- |",
        ]
        for n in self.numbers:
            met = f"{n.met}: {n.reason}" if n.reason else n.met
            lines.append(f"| {n.number} | {n.what} | {n.paper} | {n.ours} | {n.how} | {met} |")
        lines += [
            "",
            "# Step responses of the valve",
            "",
            "Fitted to the tip's angular velocity: a decaying oscillation on a parabola of time.",
            "linear: damping linearized in steady motion through the same posture; rest: what the",
            "fit does not explain; closings: of the logic block; least flow: of Q_H, over its",
            "mean; p_H: its least. The valve with even edges is data/joint1_even_edges.yaml.",
            "",
            figure_steps.as_text(self.steps),
            "",
            "# Linkages",
            "",
            "Joints 1-5 of the whole robot. At a dead point the piston moves nothing.",
            "",
            linkage_table.as_text(linkage_table.reaches()),
        ]
        return "\n".join(lines) + "\n"

    def as_json(self) -> dict[str, Any]:
        """Return the same as plain values; SI units but for angles, which are in deg."""
        steps = [
            {
                "machine": machine,
                "angle": r.angle,
                "direction": figure_steps.NAMES[r.direction],
                "y2": r.direction * r.size,
                "logic_block_closes": r.interruptions,
                "least_pressure_lifting": r.lowest,
                "least_flow_lifting_over_mean": r.least_flow,
                "linear_damping": None if math.isnan(r.linear) else r.linear,
            }
            | asdict(r.mode)
            for machine, r in figure_steps.rows(self.steps)
        ]
        return {
            "numbers": [asdict(n) for n in self.numbers],
            "step_responses": steps,
            "linkages": linkage_table.as_json(linkage_table.reaches()),
        }


def measure(machine: Machine, steps: StepResponses, progress: Callable[[str], None]) -> Table:
    """Measure every number that the model can show."""
    progress("table: the machine")
    numbers = paper_numbers_machine.measure(machine, steps)
    progress("table: its control")
    numbers += paper_numbers_control.measure(machine)
    progress("table: the whole robot")
    numbers += paper_numbers_robot.measure()
    for number in numbers:
        if number.met == NOT_MEASURED:
            progress(f"table: {number.number}, {number.what}: NOT MEASURED, {number.reason}")
    return Table(sorted(numbers, key=lambda n: n.number), steps)


def write(table: Table, folder: Path) -> list[Path]:
    """Write table.md and table.json; return them. Raises InputError where that cannot be."""
    texts = {
        "table.md": table.as_text(),
        "table.json": json.dumps(table.as_json(), indent=2, allow_nan=False) + "\n",
    }
    for name, text in texts.items():
        write_text(folder / name, text)
    return [folder / name for name in texts]

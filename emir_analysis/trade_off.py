"""Conventional control over k_p and T: closer tracking against bending of the boom (paper 3.2)."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure

from emir_analysis.compare import figures, run
from emir_analysis.node_controls import CascadeControl
from emir_analysis.report import new_figure
from emir_control.cascade import Cascade, CascadeParameters
from emir_control.trajectory import TrajectoryParameters, named
from emir_plant.parameters import Machine

GAINS = (1.0, 2.0, 3.0, 4.0)  # 1/s
TIME_CONSTANTS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.6)  # s
FORTY_FIVE = math.radians(45.0)  # paper 3.2
PAPERS = (2.0, 0.4)


@dataclass(frozen=True)
class Tuning:
    """A tuning on the paper's move, both directions. error, bending, settled: m; lag: s.

    settled: of the deflection from 1 s after a stop; others as in MoveFigures, the larger one.
    """

    gain: float
    time_constant: float
    error: float
    lag: float
    bending: float
    settled: float


def curve(machine: Machine, progress: Callable[[str], None]) -> list[Tuning]:
    """Return every tuning of the cascade, 45 deg, on the paper's move up and back."""
    found, trajectory = [], named("lift-lower", TrajectoryParameters())
    for gain in GAINS:
        progress(f"k_p = {gain:g} 1/s")
        for slow in TIME_CONSTANTS:
            loop = CascadeControl(Cascade(CascadeParameters(gain=gain, time_constant=slow)))
            moves = figures(run(machine, trajectory, loop, FORTY_FIVE))
            error, lag = max(m.error for m in moves), max(m.lag for m in moves)
            bending = max(max(m.up, -m.down) for m in moves)
            settled = max(m.settled for m in moves)
            found.append(Tuning(gain, slow, error, lag, bending, settled))
    return found


def as_text(found: Sequence[Tuning]) -> str:
    """Return the tunings as a table, in the form of Markdown."""
    lines = ["| k_p / 1/s | T / s | error / mm | lag / s | bending / cm | 1 s after / cm |"]
    lines.append("|" + " ---: |" * 6)
    lines += [
        f"| {t.gain:g} | {t.time_constant:g} | {t.error * 1e3:.1f} | {t.lag:.2f}"
        f" | {t.bending * 1e2:.1f} | {t.settled * 1e2:.1f} |"
        for t in found
    ]
    return "\n".join(lines)


def picture(found: Sequence[Tuning]) -> Figure:
    """Return bending over tracking error: a line a gain, a point a time constant."""
    figure = new_figure(6.0)
    axes = figure.subplots()
    for gain in dict.fromkeys(t.gain for t in found):
        line = [t for t in found if t.gain == gain]
        axes.plot(
            [t.error * 1e3 for t in line], [t.bending * 1e2 for t in line], "o-",
            label=f"k_p = {gain:g} 1/s",
        )  # fmt: skip
        for t in line:
            axes.annotate(
                f"{t.time_constant:g}", (t.error * 1e3, t.bending * 1e2), fontsize="x-small",
                xytext=(4, 4), textcoords="offset points",
            )  # fmt: skip
    for t in found:
        if (t.gain, t.time_constant) == PAPERS:
            axes.plot(t.error * 1e3, t.bending * 1e2, "ks", ms=11, mfc="none", label="the paper's")
    axes.set(xlabel="largest error of the stroke / mm", ylabel="largest bending / cm")
    axes.set_title("number at a point: T / s")
    axes.grid(visible=True, alpha=0.3)
    axes.legend(frameon=False)
    return figure

"""Conventional control over k_p and T: closer tracking against bending of the boom (paper 3.2).

The other controllers, as they are, are points beside its curve.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure

from emir_analysis.compare import figures, run
from emir_analysis.control_protocols import Stepping
from emir_analysis.node_controls import CascadeControl
from emir_analysis.report import new_figure
from emir_control.cascade import Cascade, CascadeParameters
from emir_control.trajectory import TrajectoryParameters, named
from emir_plant.parameters import Machine

GAINS = (1.0, 2.0, 3.0, 4.0)  # 1/s
TIME_CONSTANTS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.6)  # s
FORTY_FIVE = math.radians(45.0)  # paper 3.2
PAPERS = (2.0, 0.4)
MARKERS = "*Pv^DXsd"


@dataclass(frozen=True)
class Tuning:
    """A controller on the paper's move, both directions. error, bending, settled: m; lag: s.

    gain, time_constant: of conventional control, 1/s, s. settled: of the deflection from 1 s after
    a stop; others as in MoveFigures, the larger one.
    """

    controller: str
    gain: float | None
    time_constant: float | None
    error: float
    lag: float
    bending: float
    settled: float


def curve(
    machine: Machine, others: Mapping[str, Stepping], progress: Callable[[str], None]
) -> list[Tuning]:
    """Return every tuning of the cascade, and the others: the paper's move, 45 deg."""
    found = []
    for gain in GAINS:
        progress(f"k_p = {gain:g} 1/s")
        for slow in TIME_CONSTANTS:
            law = CascadeControl(Cascade(CascadeParameters(gain=gain, time_constant=slow)))
            found.append(_tuning(machine, law, "cascade", gain, slow))
    for name, other in others.items():
        progress(name)
        found.append(_tuning(machine, other, name))
    return found


def _tuning(
    machine: Machine, law: Stepping, name: str, gain: float | None = None, slow: float | None = None
) -> Tuning:
    trajectory = named("lift-lower", TrajectoryParameters())
    moves = figures(run(machine, trajectory, law, FORTY_FIVE))
    return Tuning(
        name,
        gain,
        slow,
        error=max(m.error for m in moves),
        lag=max((m.lag for m in moves), key=abs),
        bending=max(m.bending for m in moves),
        settled=max(m.settled for m in moves),
    )


def as_text(found: Sequence[Tuning]) -> str:
    """Return the tunings as a table, in the form of Markdown."""
    head = "k_p / 1/s | T / s | error / mm | lag / s | bending / cm | 1 s after / cm"
    lines = [f"| controller | {head} |", "| --- |" + " ---: |" * 6]
    for t in found:
        cells = t.controller, _number(t.gain), _number(t.time_constant), f"{t.error * 1e3:.1f}"
        ends = f"{t.lag:.2f}", f"{t.bending * 1e2:.1f}", f"{t.settled * 1e2:.1f}"
        lines.append(f"| {' | '.join((*cells, *ends))} |")
    return "\n".join(lines)


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:g}"


def picture(found: Sequence[Tuning]) -> Figure:
    """Return bending over tracking error: a line a gain of the cascade, a point of each other."""
    figure = new_figure(6.0)
    axes = figure.subplots()
    for gain in dict.fromkeys(t.gain for t in found if t.gain is not None):
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
    for k, t in enumerate(t for t in found if t.gain is None):
        place = t.error * 1e3, t.bending * 1e2
        axes.plot(*place, MARKERS[k % len(MARKERS)], color=f"C{4 + k % 6}", label=t.controller)
    axes.set(xlabel="largest error of the stroke / mm", ylabel="largest bending / cm")
    axes.set_title("number at a point: T / s")
    axes.grid(visible=True, alpha=0.3)
    axes.legend(frameon=False)
    return figure

"""`emir disturb`: a push at the TCP, a load dropped or picked up, at rest and while moving."""

import math
from argparse import ArgumentParser
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from emir_analysis.closed_loop import ClosedLoop
from emir_analysis.compare import Run, select
from emir_analysis.control_protocols import Stepping
from emir_analysis.disturbance import LoadChange, push
from emir_analysis.limit import PAPER_MOVE
from emir_analysis.outputs import check_outputs, check_picture, write_picture
from emir_analysis.report import new_figure
from emir_analysis.yardstick import EVERYDAY, controllers, turned_off
from emir_common.parameter_tree import with_values
from emir_common.quantity import ParameterError
from emir_control.trajectory import TrajectoryParameters, named
from emir_msgs_py.topics import PLANT_PERIOD, TICKS
from emir_plant.parameters import Machine
from emir_plant.plant import REST_PRESSURE, Plant, SimulationError
from emir_plant.sheet import joint1

Array = NDArray[np.float64]
Progress = Callable[[str], None]

WAIT = 1.024  # s before the move
HELD = WAIT + PAPER_MOVE.duration + 3.0  # s: the machine rests
MOVING = WAIT + 0.5 * PAPER_MOVE.duration  # s: it is fastest
WATCHED = 6.0  # s after the disturbance
LATER = 4.0  # s after it: what is left
FORCE, PUSHED = -2e3, 0.3  # N, s
LOAD = 300.0  # kg
QUIET = 5e-3  # m of dynamic deflection


@dataclass(frozen=True)
class Case:
    """A disturbance. payload, kg, before it; change of it, kg, or a push; time, s."""

    name: str
    time: float
    payload: float = 0.0
    change: float | None = None


CASES = tuple(
    Case(f"{what}, {when}", time, payload, change)
    for when, time in (("at rest", HELD), ("moving", MOVING))
    for what, payload, change in (
        ("push", 0.0, None), ("load dropped", LOAD, 0.0), ("load picked up", 0.0, LOAD),
    )
)  # fmt: skip


def command(words: Sequence[str], progress: Progress) -> str:
    """Run, draw, return the table. Raises InputError or ParameterError."""
    parser = ArgumentParser(
        prog="emir disturb",
        description="What each controller makes of a push at the TCP and of a load that is dropped"
        " or picked up, at rest and in the middle of a move.",
    )
    parser.add_argument(
        "--angle", type=float, default=45.0, metavar="DEG",
        help="of the boom at the start; default 45",
    )  # fmt: skip
    parser.add_argument(
        "--controllers", nargs="+", metavar="NAME",
        help="some of cascade, zv, zvd, pfc, pfc_tip, mpc, lqg; default: all",
    )  # fmt: skip
    parser.add_argument(
        "--picture", type=Path, metavar="FILE", help="draw the dynamic deflections over time"
    )
    options = parser.parse_args(words)
    check_outputs([options.picture], None, [])
    check_picture(options.picture)
    stated = with_values(
        joint1(),
        {"supply.p0": EVERYDAY.supply, "effects.command_delay.delay": EVERYDAY.delay},
    )
    loops = select(controllers(joint1()), options.controllers)
    lines = [
        "| disturbance | controller | largest / cm | quiet after / s | left / cm | TCP off / cm |",
        "| --- | --- | ---: | ---: | ---: | ---: |",
    ]
    bendings: dict[str, dict[str, Array]] = {}
    for case in CASES:
        for name, outer in loops.items():
            progress(f"{case.name}: {name}")
            bending, off = _disturbed(stated, case, outer, math.radians(options.angle))
            bendings.setdefault(case.name, {})[name] = bending
            lines.append(f"| {case.name} | {name} | {' | '.join(_cells(case, bending, off))} |")
    if options.picture:
        write_picture(options.picture, picture(bendings))
    return "\n".join(lines)


def _disturbed(stated: Machine, case: Case, outer: Stepping, angle: float) -> tuple[Array, Array]:
    """Return dynamic deflection and error of the TCP, m, (n,), in each plant period."""
    machine = with_values(stated, {"geometry.payload": case.payload})
    change = None
    if case.change is None:
        machine = push(machine, FORCE, case.time, PUSHED)
    else:
        change = LoadChange(case.time, case.change)
    trajectory = named("lift-lower", TrajectoryParameters(delay=WAIT, pause=20.0))
    loop = ClosedLoop(Plant(machine), trajectory, outer, change=change)
    try:
        signals = loop.run(angle, REST_PRESSURE, case.time + WATCHED)
    except SimulationError as error:
        raise ParameterError(f"{case.name}: {error}") from None
    return _figures(machine, case, signals)


def _figures(machine: Machine, case: Case, signals: Run) -> tuple[Array, Array]:
    """Return deflection, off the sag of that instant's posture and load, and error of the TCP."""
    angle = signals["true_angle"]
    sag = np.full(angle.size, _sag(machine))
    if case.change is not None:
        after = with_values(machine, {"geometry.payload": case.change})
        sag[round(case.time / PLANT_PERIOD) :] = _sag(after)
    bending = signals["tcp_deflection"] - sag * np.cos(angle)
    return np.asarray(bending), turned_off(machine, signals) + np.asarray(bending[::TICKS])


def _sag(machine: Machine) -> float:
    """Return the deflection at rest, m, over cos(alpha); no push counts."""
    plant = Plant(push(machine, 0.0, 0.0, 1.0))
    angle = 1.0  # rad; any does
    return plant.outputs(plant.initial(angle)).tcp_deflection / math.cos(angle)


def _cells(case: Case, bending: Array, off: Array) -> list[str]:
    start = round(case.time / PLANT_PERIOD)
    since = abs(bending[start:])
    loud = np.flatnonzero(since > QUIET)
    quiet = (loud[-1] + 1) * PLANT_PERIOD if loud.size else 0.0
    after = round((case.time + LATER) / PLANT_PERIOD)
    never = quiet > WATCHED - 10 * PLANT_PERIOD
    return [
        f"{since.max() * 100.0:.1f}",
        "-" if never else f"{quiet:.1f}",
        f"{abs(bending[after:]).max() * 100.0:.2f}",
        f"{abs(off[after // TICKS :]).max() * 100.0:.1f}",
    ]


def picture(bendings: dict[str, dict[str, Array]]) -> Figure:
    """Return the dynamic deflection over the time since the disturbance, a panel a case."""
    figure = new_figure(7.0)
    panels = figure.subplots(2, len(bendings) // 2, sharex=True, sharey="col").flat
    for panel, case in zip(panels, CASES, strict=True):
        start = round((case.time - 0.5) / PLANT_PERIOD)
        for name, bending in bendings[case.name].items():
            shown = bending[start:] * 100.0
            panel.plot(np.arange(shown.size) * PLANT_PERIOD - 0.5, shown, lw=1.1, label=name)
        panel.set_title(case.name, fontsize="small")
        panel.grid(visible=True, alpha=0.3)
    axes = figure.axes
    axes[0].legend(frameon=False, fontsize="x-small")
    axes[0].set_ylabel("dynamic deflection / cm")
    axes[-2].set_xlabel("time since the disturbance / s")
    return figure

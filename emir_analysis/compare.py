"""The controllers on the same moves of the nonlinear machine: what each does to the TCP."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from emir_analysis.closed_loop import ClosedLoop
from emir_analysis.control_protocols import Stepping
from emir_analysis.metrics import MOVING
from emir_analysis.node_controls import CascadeControl, PfcControl, PfcTipControl
from emir_analysis.report import new_figure
from emir_analysis.root_mean_square import rms
from emir_common.parameter_tree import with_values
from emir_common.quantity import ParameterError
from emir_control import pfc_file
from emir_control.limits import LimitParameters
from emir_control.pfc import PREVIEW, Future
from emir_control.pfc_file import SCHEDULED, STROKE, TIP_ANGLE
from emir_control.scheduled_pfc import law_of
from emir_control.tip import Tip
from emir_control.trajectory import AwayAndBack
from emir_msgs_py.topics import CONTROL_PERIOD, PLANT_PERIOD, TICKS
from emir_plant.parameters import Machine
from emir_plant.plant import REST_PRESSURE, Plant, SimulationError

Array = NDArray[np.float64]
Run = dict[str, Array]

SETTLED = 1.0  # s after the stop
STILL = 0.005  # m of dynamic deflection


def controllers(
    joint_file: Path | None = None, tip_file: Path | None = None
) -> dict[str, Stepping]:
    """Return what is compared, by name; None: the design that comes with the project."""
    joint = pfc_file.load(joint_file or pfc_file.default_file(STROKE), STROKE)
    tip = pfc_file.load(tip_file or pfc_file.default_file(TIP_ANGLE), TIP_ANGLE)
    loops: dict[str, Stepping] = {"cascade": CascadeControl()}
    futures: tuple[Future, ...] = ("preview", "velocity", "constant")
    for future in futures:
        loops[f"pfc, {future}"] = PfcControl(law_of(replace(joint, future=future)))
    for future in futures:
        loops[f"pfc_tip, {future}"] = PfcTipControl(Tip(law_of(replace(tip, future=future))))
    following = {output: pfc_file.find(SCHEDULED, output) for output in (STROKE, TIP_ANGLE)}
    by_load = {output: law_of(pfc_file.load(file, output)) for output, file in following.items()}
    loops[f"pfc, {SCHEDULED}"] = PfcControl(by_load[STROKE])
    loops[f"pfc_tip, {SCHEDULED}"] = PfcTipControl(Tip(by_load[TIP_ANGLE]))
    return loops


def select(known: dict[str, Stepping], names: list[str] | None) -> dict[str, Stepping]:
    """Return the controllers of these names, or all; raises ParameterError for an unknown one."""
    for name in names or ():
        if name not in known:
            raise ParameterError(f"controller {name!r}: there are {'; '.join(known)}")
    return {name: known[name] for name in names or known}


@dataclass(frozen=True)
class MoveFigures:
    """Figures of one move of a run; deflections are dynamic, off the sag of the posture.

    A move lasts from where a preview first shows it to the reference's stop. lag: s, of the
    stroke at the end of the plateau. up, down: m, extremes during the move. after, settled: m,
    largest size from the stop and from 1 s after it until the next move or the end.
    error, error_rms: m, stroke against reference, largest and root mean square. roughness:
    m/s^2, root mean square of the piston's acceleration. settling: s, from the stop until the
    size stays below STILL; infinite where it does not. travel: of the valve's command, full
    strokes. oil: m^3, from the pump. The last four count until the next move or the end.
    """

    lag: float
    up: float
    down: float
    after: float
    settled: float
    error: float
    roughness: float
    error_rms: float
    settling: float
    travel: float
    oil: float

    @property
    def bending(self) -> float:
        """Return the largest deflection during the move, m, whichever way."""
        return max(self.up, -self.down)


def repeated(
    machine: Machine, trajectory: AwayAndBack, outer: Stepping, angle: float, count: int
) -> Iterator[Run]:
    """Yield runs that differ as two runs of a machine do.

    Each has another sensor noise and starts elsewhere within one step of the resolver.
    """
    sensors = machine.sensors
    step = sensors.resolver_step
    for k in range(count):
        other = with_values(machine, {"sensors.seed": sensors.seed + k})
        yield run(other, trajectory, outer, angle + step * k / count)


def run(machine: Machine, trajectory: AwayAndBack, outer: Stepping, angle: float) -> Run:
    """Return the signals of a closed loop from rest at a boom angle, rad.

    Raises SimulationError where the machine cannot stand or the controllers would not go.
    """
    plant = Plant(machine)
    _check_way(plant, trajectory, angle)
    loop = ClosedLoop(plant, trajectory, outer)
    return loop.run(angle, REST_PRESSURE, trajectory.duration)


def _check_way(plant: Plant, trajectory: AwayAndBack, angle: float) -> None:
    """Raise SimulationError for a move into the ends of the stroke, where all would stand still."""
    start = plant.outputs(plant.initial(angle, REST_PRESSURE)).stroke
    end = start + trajectory.parameters.distance
    low, high = LimitParameters().free_stroke
    if min(start, end) < low or max(start, end) > high:
        raise SimulationError(
            f"from {math.degrees(angle):.1f} deg the move takes the stroke from {start:.3f} to"
            f" {end:.3f} m, the controllers keep it within {low:g} ... {high:g}"
        )


def dynamic_deflection(signals: Run) -> Array:
    """Return the TCP's deflection, m, less the sag of each instant's posture.

    The boom's weight bends it in proportion to cos(alpha); the first sample is at rest.
    """
    slope = np.cos(signals["true_angle"])
    deflection = signals["tcp_deflection"]
    return np.asarray(deflection - deflection[0] / slope[0] * slope)


def figures(signals: Run) -> list[MoveFigures]:
    """Return the figures of each move of a run, in order."""
    found = list(moves(signals["reference_velocity"]))
    ends = [move.start for move in found[1:]] + [signals["reference_stroke"].size]
    return [_of_move(signals, move, end) for move, end in zip(found, ends, strict=True)]


def moves(velocity: Array) -> Iterator[slice]:
    """Yield the control periods of each move, from where a preview first shows it."""
    moving = np.abs(velocity) > MOVING
    edges = np.flatnonzero(np.diff(moving, prepend=False, append=False))
    for start, stop in edges.reshape(-1, 2):
        yield slice(max(int(start) - PREVIEW, 0), int(stop))


def direction(velocity: Array) -> str:
    """Return what a move with these reference velocities is called."""
    return "lift" if velocity.sum() > 0.0 else "lower"


def _of_move(signals: Run, move: slice, end: int) -> MoveFigures:
    error = signals["reference_stroke"] - signals["true_stroke"][::TICKS]
    velocity = signals["reference_velocity"]
    bending = dynamic_deflection(signals)
    acceleration = np.diff(signals["true_velocity"]) / PLANT_PERIOD
    plateau = np.flatnonzero(np.abs(velocity[move]) > 0.999 * np.abs(velocity[move]).max())
    last = move.start + int(plateau[-1])
    during = slice(move.start * TICKS, move.stop * TICKS)
    after = slice(move.stop * TICKS, end * TICKS)
    settled = slice(after.start + round(SETTLED / PLANT_PERIOD), after.stop)
    whole = slice(during.start, after.stop)
    swinging = np.flatnonzero(np.abs(bending[after]) > STILL)
    still = int(swinging[-1]) + 1 if swinging.size else 0
    pumped = np.maximum(signals["flow_lifting"], 0.0) + np.maximum(signals["flow_lowering"], 0.0)
    return MoveFigures(
        lag=float(error[last] / velocity[last]),
        up=float(bending[during].max()),
        down=float(bending[during].min()),
        after=float(np.abs(bending[after]).max()),
        settled=float(np.abs(bending[settled]).max()),
        error=float(np.abs(error[move.start : end]).max()),
        roughness=rms(acceleration[whole]),
        error_rms=rms(error[move.start : end]),
        settling=still * PLANT_PERIOD if still < bending[after].size else math.inf,
        travel=float(np.abs(np.diff(signals["valve_command"][move.start : end])).sum()),
        oil=float(pumped[whole].sum()) * PLANT_PERIOD,
    )


COLUMNS = (
    ("lag", "lag / s", 1.0),
    ("up", "up / cm", 100.0),
    ("down", "down / cm", 100.0),
    ("after", "after / cm", 100.0),
    ("settled", "1 s after / cm", 100.0),
    ("error", "error / mm", 1000.0),
    ("error_rms", "rms error / mm", 1000.0),
    ("roughness", "rms dv/dt / mm/s2", 1000.0),
    ("settling", "settling / s", 1.0),
    ("travel", "valve travel", 1.0),
    ("oil", "oil / l", 1000.0),
)


def as_text(runs: dict[str, list[Run]]) -> str:
    """Return the figures of runs by name as one table, in the form of Markdown.

    Of several runs of a name: mean and standard deviation.
    """
    lines = ["| controller | move | " + " | ".join(title for _, title, _ in COLUMNS) + " |"]
    lines.append("| --- | --- |" + " ---: |" * len(COLUMNS))
    for name, repeated in runs.items():
        velocity = repeated[0]["reference_velocity"]
        by_move = zip(*(figures(signals) for signals in repeated), strict=True)
        for move, found in zip(moves(velocity), by_move, strict=True):
            lines.append(f"| {name} | {direction(velocity[move])} | {' | '.join(_cells(found))} |")
    return "\n".join(lines)


def _cells(repeated: Sequence[MoveFigures]) -> Iterator[str]:
    for name, _, factor in COLUMNS:
        values = factor * np.array([getattr(move, name) for move in repeated])
        if not np.isfinite(values).all():
            yield "-"
            continue
        spread = f" \u00b1 {values.std(ddof=1):.2f}" if values.size > 1 else ""
        yield f"{values.mean():.2f}{spread}"


def picture(runs: dict[str, Run]) -> Figure:
    """Return piston velocity and TCP deflection over time, one line a run (Fig. 9, 11, 12)."""
    figure = new_figure(7.0)
    velocity, deflection = figure.subplots(2, 1, sharex=True)
    first = next(iter(runs.values()))
    control = np.arange(first["reference_velocity"].size) * CONTROL_PERIOD
    velocity.plot(control, first["reference_velocity"] * 1e3, color="0.5", label="wanted")
    for name, signals in runs.items():
        time = np.arange(signals["true_velocity"].size) * PLANT_PERIOD
        velocity.plot(time, signals["true_velocity"] * 1e3, label=name, lw=1.2)
        deflection.plot(time, signals["tcp_deflection"] * 1e2, label=name, lw=1.2)
    velocity.set_ylabel("piston velocity / mm/s")
    deflection.set_ylabel("TCP deflection / cm")
    deflection.set_xlabel("time / s")
    for axes in (velocity, deflection):
        axes.grid(visible=True, alpha=0.3)
    velocity.legend(loc="upper right", frameon=False, fontsize="small")
    return figure

"""The paper's figure 7: the tip's angular velocity after a step of the valve.

Drawn by the machine whose valve has even edges; what of it makes which feature is shown by taking
one at a time away. From every response the slow mode is measured: a trend, bent once, and one
decaying oscillation whose frequency drifts, as the posture does, are fitted to it; amplitude,
phase and trend are linear in the unknowns.
"""

import math
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.optimize import least_squares

from emir_analysis.report import new_figure
from emir_common.parameter_tree import with_values
from emir_plant import operating_point
from emir_plant.core import Truth
from emir_plant.linearize import linearize
from emir_plant.parameters import Machine
from emir_plant.plant import Plant, SimulationError
from emir_plant.sheet import joint1

Array = NDArray[np.float64]

REST_PRESSURE = 1e6  # Pa, of the lowering chamber
SIZES = (0.19, 0.28, 0.46, 0.64, 1.0)  # of y2; the first 10 % are dead zone
ANGLES = (45.0, 20.0, 55.0)  # deg: the paper's, and two others
LIFTING, LOWERING = 1, -1
EVEN, STANDARD = "even edges", "standard (joint1.yaml)"
NAMES = {LIFTING: "lifting", LOWERING: "lowering"}
DURATION, PERIOD, TICK = 5.0, 5e-3, 1e-3  # s
BEGIN = 0.3  # s, from which on the valve is open and the first jolt over
STARTS = (0.5, 0.7, 0.9)  # Hz, from which the fit is tried
SLOWEST, FASTEST = 0.25, 2.0  # Hz, of the mode that is looked for
DRIFT = 0.6  # share of the frequency by which it may change at most over the response
ROOM = 0.5  # of a diagram's height
NOT_OPEN = 0.9  # of the logic block, below which it throttles

_COLUMN = {name: k for k, name in enumerate(Truth._fields)}


@dataclass(frozen=True)
class Without:
    """The machine with one of its features taken away: what there is in its place.

    direction: LIFTING or LOWERING, in which that shows. changes: values by dotted path.
    """

    what: str
    direction: int
    changes: dict[str, float]

    @property
    def name(self) -> str:
        """Return the machine's name."""
        return f"{EVEN} but {self.what}"


NARROW_RETURN = Without(
    "return edge of 30 bar", LIFTING, {"resistances.k_meter_out_lifting": 1.12546875e12}
)
BALANCE_IN_INLET = Without(
    "return edge holds the load", LOWERING,
    {"valve.balance_lowering": 0, "resistances.k_meter_out_lowering": 1.35e12},
)  # fmt: skip
BLOCK_OPEN = Without("logic block always open", LOWERING, {"logic_block.threshold": 0.0})
FULL_SUPPLY = Without("full pressure fed in", LOWERING, {"valve.limit_lowering": 1e9})
WITHOUT = NARROW_RETURN, BALANCE_IN_INLET, BLOCK_OPEN, FULL_SUPPLY


@dataclass(frozen=True)
class SlowMode:
    """frequency: Hz, at the beginning. damping: of critical. rest: share that it leaves over."""

    frequency: float
    damping: float
    rest: float


@dataclass(frozen=True)
class Response:
    """A response to a step. angle: deg, at its start. direction: LIFTING or LOWERING.

    time: (k,) s. velocity: (k,) rad/s, of the tip's angle. linear: damping of the slowest mode
    linearized in steady motion through the angle; NaN where there is none. interruptions: how
    often the logic block closes. least_flow: of Q_H once the spool is there, over its mean.
    lowest: Pa, the lifting chamber's least pressure.
    """

    angle: float
    direction: int
    size: float
    time: Array
    velocity: Array
    mode: SlowMode
    linear: float
    interruptions: int
    least_flow: float
    lowest: float


@dataclass(frozen=True)
class StepResponses:
    """The responses by machine."""

    by_machine: dict[str, list[Response]]

    def of(self, angle: float, direction: int, machine: str = EVEN) -> list[Response]:
        """Return those from an angle, deg, in a direction, by rising size."""
        found = self.by_machine[machine]
        return [r for r in found if (r.angle, r.direction) == (angle, direction)]


def step_responses(machine: Machine) -> StepResponses:
    """Return all responses: SIZES by direction by ANGLES; from the first one without a feature.

    machine: with even edges. Beside it stands the standard one. Raises SimulationError as
    Plant.initial.
    """
    both = LIFTING, LOWERING
    found = {EVEN: [response(machine, a, d, s) for a in ANGLES for d in both for s in SIZES]}
    for lacking in WITHOUT:
        other = with_values(machine, lacking.changes)
        found[lacking.name] = [response(other, ANGLES[0], lacking.direction, s) for s in SIZES]
    found[STANDARD] = [response(joint1(), ANGLES[0], d, s) for d in both for s in SIZES]
    return StepResponses(found)


def response(machine: Machine, angle: float, direction: int, size: float) -> Response:
    """Return the response to one step from rest. Raises SimulationError as Plant.initial."""
    plant = Plant(machine)
    commands = np.full(round(DURATION / TICK), direction * size)
    start = plant.initial(math.radians(angle), REST_PRESSURE)
    shown = plant.simulate(start, commands, TICK, round(PERIOD / TICK))
    velocity = np.gradient(shown[:, _COLUMN["tip_angle"]], PERIOD)
    time = np.arange(velocity.size) * PERIOD
    begun = time >= BEGIN
    open_ = (shown[:, _COLUMN["logic_block"]] > NOT_OPEN).astype(int)
    flow = direction * shown[begun, _COLUMN["flow_lifting"]]
    return Response(
        angle,
        direction,
        size,
        time,
        velocity,
        slow_mode(time[begun] - BEGIN, velocity[begun]),
        _linear_damping(plant, angle, direction * size),
        int(np.count_nonzero(np.diff(open_) < 0)),
        float(flow.min() / flow.mean()),
        float(shown[:, _COLUMN["pressure_lifting"]].min()),
    )


def _linear_damping(plant: Plant, angle: float, command: float) -> float:
    try:
        state = operating_point.under_command(plant, math.radians(angle), command)
    except SimulationError:
        return math.nan
    return float(linearize(plant, state, command).modes()[1][0])


def slow_mode(time: Array, signal: Array) -> SlowMode:
    """Return the decaying oscillation in a signal, (k,), that stands on a parabola of time.

    time: (k,) s, from 0. The frequency may drift linearly.
    """
    duration = time[-1]

    def left_over(unknown: Array) -> Array:
        w, damping, drift = unknown
        decay = np.exp(-damping * w * time)
        phase = w * math.sqrt(1.0 - damping**2) * (time + 0.5 * drift * time**2 / duration)
        shapes = np.stack(
            (np.ones_like(time), time, time**2, decay * np.cos(phase), decay * np.sin(phase)), 1
        )
        return np.asarray(shapes @ np.linalg.lstsq(shapes, signal, rcond=None)[0] - signal)

    turn = 2.0 * math.pi
    bounds = ([turn * SLOWEST, -0.2, -DRIFT], [turn * FASTEST, 0.9, DRIFT])
    tries = [least_squares(left_over, (turn * f, 0.03, 0.0), bounds=bounds) for f in STARTS]
    best = min(tries, key=lambda found: float(found.cost))
    rest = float(np.std(best.fun) / np.std(signal))
    return SlowMode(float(best.x[0] / turn), float(best.x[1]), rest)


def rows(found: StepResponses) -> list[tuple[str, Response]]:
    """Return machine and response of every line of the table."""
    return [(machine, r) for machine, responses in found.by_machine.items() for r in responses]


def as_text(found: StepResponses) -> str:
    """Return the slow mode of every response as a table, in the form of Markdown."""
    heads = (
        "machine", "from / deg", "direction", "y2", "f / Hz", "damping", "linear", "rest",
        "closings", "least flow", "p_H / bar",
    )  # fmt: skip
    lines = [
        f"| {' | '.join(heads)} |",
        "| --- | ---: | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    for machine, r in rows(found):
        linear = "-" if math.isnan(r.linear) else f"{r.linear:.3f}"
        lines.append(
            f"| {machine} | {r.angle:g} | {NAMES[r.direction]} | {r.direction * r.size:+.2f}"
            f" | {r.mode.frequency:.2f} | {r.mode.damping:.3f} | {linear} | {r.mode.rest:.0%}"
            f" | {r.interruptions} | {r.least_flow:.0%} | {r.lowest / 1e5:.0f} |"
        )
    return "\n".join(lines)


def picture(found: StepResponses) -> Figure:
    """Return lifting beside lowering (Fig. 7a, 7b), one row a posture, one line a step.

    Below that, the same without one feature each.
    """
    figure = new_figure(3.5 * (len(ANGLES) + len(WITHOUT) // 2))
    diagrams = figure.subplots(len(ANGLES) + len(WITHOUT) // 2, 2, sharex=True, squeeze=False)
    for line, angle in zip(diagrams, ANGLES, strict=False):
        for axes, direction in zip(line, (LIFTING, LOWERING), strict=True):
            title = f"{NAMES[direction]} from {angle:g} deg"
            _draw(axes, found.of(angle, direction), title)
    for axes, lacking in zip(diagrams[len(ANGLES) :].flat, WITHOUT, strict=False):
        title = f"{NAMES[lacking.direction]}, but {lacking.what}"
        _draw(axes, found.by_machine[lacking.name], title)
    for axes in diagrams[:, 0]:
        axes.set_ylabel("tip's angular velocity / deg/s")
    for axes in diagrams[-1]:
        axes.set_xlabel("time / s")
    return figure


def _draw(axes: Axes, responses: list[Response], title: str) -> None:
    direction = responses[0].direction
    for r in responses:
        label = f"{direction * r.size:+.2f}: {r.mode.frequency:.2f} Hz, {r.mode.damping:.3f}"
        axes.plot(r.time, np.degrees(r.velocity), lw=1.0, label=label)
    axes.set_title(title, fontsize="medium")
    axes.legend(
        title="y2: slow mode, damping", frameon=False, fontsize="x-small",
        title_fontsize="x-small", ncols=2,
        loc="upper right" if direction == LIFTING else "lower right",
    )  # fmt: skip
    low, high = axes.get_ylim()  # room for the legend
    room = ROOM * (high - low)
    axes.set_ylim(*((low, high + room) if direction == LIFTING else (low - room, high)))
    axes.grid(visible=True, alpha=0.3)

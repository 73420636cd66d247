"""The paper's figure 7: the tip's angular velocity after a step of the valve.

From every response the slow mode is measured: a straight-running trend, bent once, and one decaying
oscillation are fitted to it, the oscillation's amplitude and phase, and the trend, being linear
in the unknowns.
"""

import math
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.optimize import least_squares

from emir_analysis.report import new_figure
from emir_common.parameter_tree import with_values
from emir_plant.core import Truth
from emir_plant.parameters import Machine
from emir_plant.plant import Plant

Array = NDArray[np.float64]

REST_PRESSURE = 2e6  # Pa, of the lowering chamber
SIZES = (0.19, 0.28, 0.46, 0.64, 1.0)  # of y2; the first 10 % are dead zone
ANGLES = (45.0, 20.0)  # deg: the paper's, and one other
LIFTING, LOWERING = 1, -1
DURATION, PERIOD, TICK = 5.0, 5e-3, 1e-3  # s
BEGIN = 0.3  # s, from which on the valve is open and the first jolt over
STARTS = (0.5, 0.7, 0.9)  # Hz, from which the fit is tried
SLOWEST, FASTEST = 0.25, 2.0  # Hz, of the mode that is looked for
ROOM = 0.5  # of a diagram's height
NOT_OPEN = 0.9  # of the logic block, below which it throttles
WIDE_EDGE = {"resistances.k_meter_out_lifting": 1e11}  # Pa s^2/m^6: 3 bar at full lifting speed

_COLUMN = {name: k for k, name in enumerate(Truth._fields)}


@dataclass(frozen=True)
class SlowMode:
    """frequency: Hz. damping: of critical. rest: share of the response that it leaves over."""

    frequency: float
    damping: float
    rest: float


@dataclass(frozen=True)
class Response:
    """A response to a step. angle: deg, at its start. direction: LIFTING or LOWERING.

    time: (k,) s. velocity: (k,) rad/s, of the tip's angle. interruptions: how often the logic
    block closes. lowest: Pa, the lifting chamber's least pressure.
    """

    angle: float
    direction: int
    size: float
    time: Array
    velocity: Array
    mode: SlowMode
    interruptions: int
    lowest: float


@dataclass(frozen=True)
class StepResponses:
    """The responses as the machine is, and lifting with a wide return edge."""

    standard: list[Response]
    wide: list[Response]

    def of(self, angle: float, direction: int) -> list[Response]:
        """Return those of the machine as it is, by rising size."""
        return [r for r in self.standard if (r.angle, r.direction) == (angle, direction)]


def step_responses(machine: Machine) -> StepResponses:
    """Return all responses: SIZES by direction by ANGLES."""
    wide = with_values(machine, WIDE_EDGE)
    return StepResponses(
        [response(machine, a, d, s) for a in ANGLES for d in (LIFTING, LOWERING) for s in SIZES],
        [response(wide, a, LIFTING, s) for a in ANGLES for s in SIZES],
    )


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
    return Response(
        angle,
        direction,
        size,
        time,
        velocity,
        slow_mode(time[begun], velocity[begun]),
        int(np.count_nonzero(np.diff(open_) < 0)),
        float(shown[:, _COLUMN["pressure_lifting"]].min()),
    )


def slow_mode(time: Array, signal: Array) -> SlowMode:
    """Return the decaying oscillation in a signal, (k,), that stands on a parabola of time."""

    def left_over(unknown: Array) -> Array:
        w, damping = unknown
        decay = np.exp(-damping * w * time)
        phase = w * math.sqrt(1.0 - damping**2) * time
        shapes = np.stack(
            (np.ones_like(time), time, time**2, decay * np.cos(phase), decay * np.sin(phase)), 1
        )
        return np.asarray(shapes @ np.linalg.lstsq(shapes, signal, rcond=None)[0] - signal)

    bounds = ([2.0 * math.pi * SLOWEST, -0.2], [2.0 * math.pi * FASTEST, 0.9])
    tries = [least_squares(left_over, (2.0 * math.pi * f, 0.03), bounds=bounds) for f in STARTS]
    best = min(tries, key=lambda found: float(found.cost))
    w, damping = best.x
    rest = float(np.std(best.fun) / np.std(signal))
    return SlowMode(float(w / (2.0 * math.pi)), float(damping), rest)


def rows(found: StepResponses) -> list[tuple[str, str, Response]]:
    """Return machine, direction and response of every line of the table."""
    names = {LIFTING: "lifting", LOWERING: "lowering"}
    standard = [("as it is", names[r.direction], r) for r in found.standard]
    return standard + [("with a wide return edge", names[r.direction], r) for r in found.wide]


def as_text(found: StepResponses) -> str:
    """Return the slow mode of every response as a table, in the form of Markdown.

    rest: what the mode does not explain; closings: of the logic block; p_H: bar, the least.
    """
    lines = [
        "| machine | from / deg | direction | y2 | f / Hz | damping | rest | closings | p_H |",
        "| --- | ---: | --- | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    for machine, direction, r in rows(found):
        lines.append(
            f"| {machine} | {r.angle:g} | {direction} | {r.direction * r.size:+.2f}"
            f" | {r.mode.frequency:.2f} | {r.mode.damping:.3f} | {r.mode.rest:.0%}"
            f" | {r.interruptions} | {r.lowest / 1e5:.0f} |"
        )
    return "\n".join(lines)


def picture(found: StepResponses) -> Figure:
    """Return lifting beside lowering (Fig. 7a, 7b), one row a posture, one line a step."""
    figure = new_figure(7.0)
    diagrams = figure.subplots(len(ANGLES), 2, sharex=True, squeeze=False)
    for line, angle in zip(diagrams, ANGLES, strict=True):
        for axes, direction in zip(line, (LIFTING, LOWERING), strict=True):
            for r in found.of(angle, direction):
                mode = f"{r.mode.frequency:.2f} Hz, {r.mode.damping:.3f}"
                label = f"{direction * r.size:+.2f}: {mode}"
                axes.plot(r.time, np.degrees(r.velocity), lw=1.0, label=label)
            name = "lifting" if direction == LIFTING else "lowering"
            axes.set_title(f"{name} from {angle:g} deg", fontsize="medium")
            axes.legend(
                title="y2: slow mode, damping", frameon=False, fontsize="x-small",
                title_fontsize="x-small", ncols=2,
                loc="upper right" if direction == LIFTING else "lower right",
            )  # fmt: skip
            low, high = axes.get_ylim()  # room for the legend
            room = ROOM * (high - low)
            axes.set_ylim(*((low, high + room) if direction == LIFTING else (low - room, high)))
            axes.grid(visible=True, alpha=0.3)
        line[0].set_ylabel("tip's angular velocity / deg/s")
    for axes in diagrams[-1]:
        axes.set_xlabel("time / s")
    return figure

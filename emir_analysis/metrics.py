"""Figures of a run: one function each, with a name and a unit.

A function takes the recording and returns its figure, or None where the recording does not
hold what it needs. `METRICS` and `METRICS_OF_THE_TCP` are the only lists of them.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emir_analysis.root_mean_square import rms
from emir_analysis.run_signals import at, piston
from emir_analysis.signals import Recording
from emir_msgs_py.topics import CONTROL_PERIOD, CYLINDER_PREVIEW

Array = NDArray[np.float64]

LONGEST_LAG = 1.5  # s
COARSE_LAG = 0.016  # s: half a period of the reference, over which the error changes smoothly
FINE_LAG = 1e-3  # s
PAPER_LAG = 0.4  # s, T of law (11)
MOVING = 1e-4  # m/s of reference speed
PLATEAU = 0.999  # of the highest reference speed
SEEN_AHEAD = len(CYLINDER_PREVIEW.fields) * CONTROL_PERIOD  # s


@dataclass(frozen=True)
class Metric:
    """A figure of a run. value: in `unit`, None where the recording does not tell."""

    name: str
    value: float | None
    unit: str
    meaning: str


@dataclass(frozen=True)
class Definition:
    """How a figure is made."""

    function: Callable[..., float | None]
    unit: str

    @property
    def name(self) -> str:
        """Return the figure's name, that of its function."""
        return self.function.__name__

    def of(self, recording: Recording, *known: float | None) -> Metric:
        """Return the figure of a recording. known: of its machine, as the function takes it."""
        meaning = (self.function.__doc__ or "").splitlines()[0]
        return Metric(self.name, self.function(recording, *known), self.unit, meaning)


def tracking_error_rms(run: Recording) -> float:
    """Stroke against reference, root mean square."""
    return rms(_tracking_error(run))


def tracking_error_peak(run: Recording) -> float:
    """Stroke against reference, largest."""
    return float(np.max(np.abs(_tracking_error(run))))


def lag_velocity(run: Recording) -> float | None:
    """Delay of the piston's velocity behind the reference that fits best."""
    return _lag(run, "true_velocity", "reference_velocity")


def lag_stroke(run: Recording) -> float | None:
    """Delay of the piston's stroke behind the reference that fits best."""
    return _lag(run, piston(run, "stroke"), "reference_stroke")


def lag_plateau(run: Recording) -> float | None:
    """Delay of the stroke behind the reference where its velocity has been constant."""
    velocity = run["reference_velocity"]
    top = np.max(np.abs(velocity.value))
    settled = np.flatnonzero(np.abs(velocity.value) > PLATEAU * top)  # of all moves
    if top < MOVING or settled.size == 0:
        return None
    ends = settled[np.flatnonzero(np.diff(settled, append=settled[-1] + 2) > 1)]
    error = -_tracking_error(run)
    return float(np.mean(error[ends] / velocity.value[ends]))


def tcp_deflection_static(run: Recording) -> float | None:
    """Deflection of the TCP off the straight boom, at rest before the first move."""
    if "tcp_deflection" not in run.signals:
        return None
    signal = run["tcp_deflection"]
    at_rest = signal.value[signal.time <= _first_move(run)]
    return float(np.mean(at_rest)) if at_rest.size else None


def tcp_deflection_up(run: Recording) -> float | None:
    """Largest deflection of the TCP above its static value."""
    dynamic = _dynamic_deflection(run)
    return None if dynamic is None else float(dynamic.max())


def tcp_deflection_down(run: Recording) -> float | None:
    """Largest deflection of the TCP below its static value."""
    dynamic = _dynamic_deflection(run)
    return None if dynamic is None else float(dynamic.min())


def tcp_error_up(run: Recording, boom_length: float | None) -> float | None:
    """TCP above the place where the reference, 0.4 s ago, wanted it: oil and boom together."""
    error = _tcp_error(run, boom_length)
    return None if error is None else float(error.max())


def tcp_error_down(run: Recording, boom_length: float | None) -> float | None:
    """TCP below the place where the reference, 0.4 s ago, wanted it: oil and boom together."""
    error = _tcp_error(run, boom_length)
    return None if error is None else float(error.min())


def pressure_lifting_peak(run: Recording) -> float:
    """Highest pressure in the lifting chamber."""
    return float(run["pressure_lifting"].value.max())


def pressure_lowering_peak(run: Recording) -> float:
    """Highest pressure in the lowering chamber."""
    return float(run["pressure_lowering"].value.max())


def valve_travel(run: Recording) -> float:
    """How far the valve command moved in all, in full strokes."""
    return float(np.sum(np.abs(np.diff(run["valve_command"].value))))


METRICS = (
    Definition(tracking_error_rms, "m"),
    Definition(tracking_error_peak, "m"),
    Definition(lag_velocity, "s"),
    Definition(lag_stroke, "s"),
    Definition(lag_plateau, "s"),
    Definition(tcp_deflection_static, "m"),
    Definition(tcp_deflection_up, "m"),
    Definition(tcp_deflection_down, "m"),
    Definition(pressure_lifting_peak, "Pa"),
    Definition(pressure_lowering_peak, "Pa"),
    Definition(valve_travel, "1"),
)
METRICS_OF_THE_TCP = (Definition(tcp_error_up, "m"), Definition(tcp_error_down, "m"))


def metrics(run: Recording, boom_length: float | None) -> list[Metric]:
    """Return all figures of a run of the graph.

    boom_length: of its machine, m; where that is not known, the TCP's place is not either.
    """
    figures = [definition.of(run) for definition in METRICS]
    return figures + [definition.of(run, boom_length) for definition in METRICS_OF_THE_TCP]


def _tracking_error(run: Recording) -> Array:
    reference = run["reference_stroke"]
    return at(run, piston(run, "stroke"), reference.time) - reference.value


def _first_move(run: Recording) -> float:
    """Return the time until which nothing moves, s; at least the first sample's.

    A controller that sees the reference ahead moves before it does.
    """
    velocity = run["reference_velocity"]
    moving = np.flatnonzero(np.abs(velocity.value) > MOVING)
    if moving.size == 0:
        return float(velocity.time[-1])
    return float(max(velocity.time[max(moving[0] - 1, 0)] - SEEN_AHEAD, velocity.time[0]))


def _lag(run: Recording, followed_by: str, reference: str) -> float | None:
    """Return the shift, s, for which the follower differs least from the reference."""
    if followed_by not in run.signals or not np.ptp(run[reference].value):
        return None
    follower = run[followed_by]
    time = follower.time[follower.time >= follower.time[0] + LONGEST_LAG]
    if time.size < 2:  # noqa: PLR2004 (too short to compare)
        return None
    value = at(run, followed_by, time)

    def best(lags: Array) -> float:
        errors = [np.sum((value - at(run, reference, time - lag)) ** 2) for lag in lags]
        return float(lags[int(np.argmin(errors))])

    near = best(np.arange(0.0, LONGEST_LAG, COARSE_LAG))
    fine = np.arange(near - COARSE_LAG, near + COARSE_LAG, FINE_LAG)
    return best(np.round(fine[fine >= -0.5 * FINE_LAG], 6))


def _dynamic_deflection(run: Recording) -> Array | None:
    static = tcp_deflection_static(run)
    return None if static is None else run["tcp_deflection"].value - static


def _tcp_error(run: Recording, boom_length: float | None) -> Array | None:
    """Return the TCP's error across the boom, m, against the reference PAPER_LAG ago.

    The angle that belongs to a reference stroke is read off the recorded pairs of both.
    """
    dynamic = _dynamic_deflection(run)
    if dynamic is None or boom_length is None:
        return None
    stroke, angle = run["true_stroke"].value, run["true_angle"].value
    if not np.ptp(stroke):
        return None
    angle_at = np.polynomial.Polynomial.fit(stroke, angle, 3)
    wanted = at(run, "reference_stroke", run["tcp_deflection"].time - PAPER_LAG)
    return boom_length * (angle - angle_at(wanted)) + dynamic

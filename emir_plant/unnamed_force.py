"""A force that recordings show and no effect has a name for, as a measured curve.

What a diagnosis cannot name it can still measure: the missing force on the piston as a function
of one signal, for each direction of motion. With that curve the machine can be simulated,
controlled and looked at; a name it has not.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

from emir_common.quantity import quantity
from emir_plant.effects.smooth_sign import smooth_sign
from emir_plant.jit import compiled

POINTS = 33  # of a curve: 15 mm apart over 0.5 m of stroke
NOTHING, STROKE, VELOCITY = 0, 1, 2  # what a curve may run over
OFF = (0.0,) * POINTS


@dataclass(frozen=True, kw_only=True)
class UnnamedForce:
    """Forces on the piston beside the oil's as curves over one signal.

    curve_along acts whatever the direction of motion, positive where it lifts; curve_friction
    resists the motion, as tanh(v / v_0) near standstill. Between its points a curve is a cubic
    with the slopes of the neighbours' chords (Catmull and Rom 1974), beyond its ends constant.
    """

    curve_over: int = quantity("1", 0, 2, "over: 0 off, 1 stroke, 2 velocity", default=0)
    curve_first: float = quantity("SI", -10.0, 10.0, "stroke, m, or velocity, m/s", default=0.0)
    curve_last: float = quantity("SI", -10.0, 10.0, "the same of the last point", default=1.0)
    curve_along: tuple[float, ...] = quantity(
        "N", -1e7, 1e7, "lifting force at evenly spaced points", default=OFF, count=POINTS
    )
    curve_friction: tuple[float, ...] = quantity(
        "N", 0.0, 1e7, "force against the motion at the same points", default=OFF, count=POINTS
    )
    curve_smoothing_speed: float = quantity("m/s", 1e-5, 1e-2, "v_0", default=1e-3)


class _Place(NamedTuple):
    """Where on a curve: behind which of its points, and by what share of the way to the next."""

    point: int
    share: float


@compiled
def along(velocity: float, stroke: float, p: Any) -> float:
    """Return the force, N, that acts whatever the direction, positive where it lifts.

    velocity, m/s, and stroke, m, of the piston.
    """
    if p.curve_over == NOTHING:
        return 0.0
    return _at(p.curve_along, _place(velocity, stroke, p))


@compiled
def friction(velocity: float, stroke: float, p: Any) -> float:
    """Return what resists the motion, N; it has the sign of the velocity, m/s."""
    if p.curve_over == NOTHING:
        return 0.0
    level = max(_at(p.curve_friction, _place(velocity, stroke, p)), 0.0)
    return level * smooth_sign(velocity / p.curve_smoothing_speed, 0.0)


@compiled
def _place(velocity: float, stroke: float, p: Any) -> _Place:
    signal = stroke if p.curve_over == STROKE else velocity
    position = (signal - p.curve_first) / (p.curve_last - p.curve_first) * (POINTS - 1)
    position = min(max(position, 0.0), POINTS - 1.0)
    point = min(int(position), POINTS - 2)
    return _Place(point, position - point)


@compiled
def _at(curve: Any, place: _Place) -> float:
    """Return the cubic through the two points about a place; straight on beyond the ends."""
    k, t = place.point, place.share
    here, there = curve[k], curve[k + 1]
    before = curve[k - 1] if k > 0 else 2.0 * here - there
    behind = curve[k + 2] if k < POINTS - 2 else 2.0 * there - here
    start, end = 0.5 * (there - before), 0.5 * (behind - here)
    bend = t * (1.0 - t) * ((1.0 - t) * (start - there + here) - t * (end - there + here))
    value: float = here + t * (there - here) + bend
    return value

"""A force on the piston that has no name, as a curve over the stroke or the velocity."""

from dataclasses import dataclass
from typing import Any

from emir_common.quantity import quantity
from emir_plant.curve import POINTS, ZERO, Place, place, place_within, value
from emir_plant.effects.smooth_sign import smooth_sign
from emir_plant.jit import compiled

STROKE, VELOCITY = 1, 2  # what the curve may run over


@dataclass(frozen=True, kw_only=True)
class UnnamedForce:
    """Forces on the piston beside the oil's.

    Beyond the ends of the curves they are as there over the stroke, go straight on over the
    velocity. along acts whatever the direction of motion, positive where it lifts; friction
    resists the motion, as tanh(v / v_0) near standstill.
    """

    over: int = quantity("1", 0, 2, "0 off, 1 over the stroke, 2 the velocity", default=0)
    first: float = quantity("SI", -10.0, 10.0, "stroke, m, or velocity, m/s", default=0.0)
    last: float = quantity("SI", -10.0, 10.0, "the same of the last point", default=1.0)
    along: tuple[float, ...] = quantity(
        "N", -1e7, 1e7, "lifting force at evenly spaced points", default=ZERO, count=POINTS
    )
    friction: tuple[float, ...] = quantity(
        "N", 0.0, 1e7, "force against the motion at the same points", default=ZERO, count=POINTS
    )
    smoothing_speed: float = quantity("m/s", 1e-5, 1e-2, "v_0", default=1e-3)


@compiled
def along(velocity: float, stroke: float, p: Any) -> float:
    """Return the force, N, that acts whatever the direction, positive where it lifts.

    velocity, m/s, and stroke, m, of the piston.
    """
    if p.unnamed_force_over == 0.0:
        return 0.0
    return value(p.unnamed_force_along, _place(velocity, stroke, p))


@compiled
def friction(velocity: float, stroke: float, p: Any) -> float:
    """Return what resists the motion, N; it has the sign of the velocity, m/s."""
    if p.unnamed_force_over == 0.0:
        return 0.0
    level = max(value(p.unnamed_force_friction, _place(velocity, stroke, p)), 0.0)
    return level * smooth_sign(velocity / p.unnamed_force_smoothing_speed, 0.0)


@compiled
def _place(velocity: float, stroke: float, p: Any) -> Place:
    if p.unnamed_force_over == STROKE:
        return place_within(stroke, p.unnamed_force_first, p.unnamed_force_last)
    return place(velocity, p.unnamed_force_first, p.unnamed_force_last)

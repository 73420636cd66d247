"""What no command may exceed, whoever gives it: speed, its change, and the ends of the stroke."""

import math
from dataclasses import dataclass

from emir_common.quantity import ParameterError, check_ranges, quantity


@dataclass(frozen=True, kw_only=True)
class LimitParameters:
    """Limits of the wanted piston velocity; those of joint 1."""

    speed: float = quantity("m/s", 1e-4, 1.0, "of the piston, either way", default=0.06)
    acceleration: float = quantity(
        "m/s^2", 1e-3, 100.0, "change of the wanted velocity", default=0.5
    )
    stroke_low: float = quantity("m", -5.0, 5.0, "cylinder retracted", default=0.0)
    stroke_high: float = quantity("m", -5.0, 5.0, "cylinder extended", default=0.95)
    end_margin: float = quantity("m", 0.0, 1.0, "kept off both ends", default=0.05)
    end_deceleration: float = quantity(
        "m/s^2", 1e-3, 10.0, "with which the piston comes to rest there", default=0.02
    )

    def __post_init__(self) -> None:
        check_ranges(self)
        if self.stroke_high - self.stroke_low <= 2.0 * self.end_margin:
            raise ParameterError(
                f"stroke_high = {self.stroke_high:g} m: leaves nothing above stroke_low"
                f" = {self.stroke_low:g} m between the margins"
            )

    @property
    def free_stroke(self) -> tuple[float, float]:
        """Return the strokes, m, that commands may lead to: the margins are kept off both ends."""
        return self.stroke_low + self.end_margin, self.stroke_high - self.end_margin


def limited(wanted: float, last: float, stroke: float, dt: float, p: LimitParameters) -> float:
    """Return the velocity, m/s, allowed in a period of dt, s, at a stroke, m, after the last one.

    Towards an end no faster than the piston can be stopped off it; that comes before the limit
    of the change.
    """
    most = p.acceleration * dt
    near = min(max(wanted, last - most), last + most)
    return off_the_ends(min(max(near, -p.speed), p.speed), stroke, p.end_margin, p)


def off_the_ends(velocity: float, stroke: float, margin: float, p: LimitParameters) -> float:
    """Return the velocity, m/s, or what of it lets the piston stop a margin, m, off the ends."""
    up = _braking(p.stroke_high - margin - stroke, p)
    down = _braking(stroke - p.stroke_low - margin, p)
    return min(max(velocity, -down), up)


def _braking(distance: float, p: LimitParameters) -> float:
    """Return the speed, m/s, from which the piston stops within a distance, m."""
    return math.sqrt(2.0 * p.end_deceleration * max(distance, 0.0))

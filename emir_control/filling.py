"""Filling of the lowering chamber before lowering where the logic block is shut: how fast."""

from dataclasses import dataclass
from typing import NamedTuple

from emir_common.quantity import check_ranges, quantity
from emir_control.actuator import Actuator


class Filled(NamedTuple):
    """What the filling of the lowering chamber has done: piston moved by, m, and speed, m/s.

    over: it has come to its end.
    """

    moved: float
    velocity: float
    over: bool = False


NOT_FILLED = Filled(0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class FillParameters:
    """How the lowering chamber is filled before lowering where the logic block is shut.

    The pump pushes the piston down on the shut lifting chamber until its pressure opens the
    block, the slower the nearer: speed = rate * way left, risen to with an acceleration.
    """

    lead: float = quantity("s", 0.0, 30.0, "before the move; 0: no filling", default=7.0)
    margin: float = quantity("Pa", 0.0, 5e6, "over the threshold", default=1e5)
    rate: float = quantity("1/s", 0.01, 10.0, "speed over way left", default=0.8)
    slowest: float = quantity("m/s", 1e-5, 0.1, "speed", default=1e-3)
    stopping: float = quantity(
        "s", 0.032, 10.0, "from the slowest speed; a period of the boom", default=1.5
    )
    acceleration: float = quantity("m/s^2", 1e-4, 1.0, "of the piston", default=2.5e-3)
    damping: float = quantity("1/s", 0.0, 20.0, "speed by the force's deviation / k_h", default=3.0)

    def __post_init__(self) -> None:
        check_ranges(self)

    def velocity(
        self, filled: Filled, missing: float, drive: Actuator, stroke: float, dt: float
    ) -> float:
        """Return the speed, m/s, with a pressure, Pa, missing to the aim."""
        if missing <= 0.0:
            return max(filled.velocity - self.slowest / self.stopping * dt, 0.0)
        left = missing * drive.compression(stroke)
        wanted = max(self.rate * left, self.slowest)
        return min(wanted, filled.velocity + self.acceleration * dt)

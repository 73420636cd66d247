"""What an actuator has by no law that has a name: curves, straight between places.

A diagnosis measures one where no effect explains a recording. Beyond its places a curve stays as
it is at its ends.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

from emir_common.quantity import quantity
from emir_plant.effects.base import Balance, Effect
from emir_plant.jit import compiled_in_place

PLACES = 7
NONE = (0.0,) * PLACES
BEYOND = 1e12  # of a signal: only a run out of all bounds has it


@dataclass(frozen=True)
class Curve(Effect):
    """A curve over one signal, off without points.

    over: the signal. what: stands for the points. low, high: of the signal, in its unit, the first
    and the last of evenly spaced places. points: the values there, a flow or a force as the
    actuator has them (`equations.py`).
    """

    sizes: ClassVar[tuple[str, ...]] = ("points",)
    source: ClassVar[str] = "measured: a recording tells the curve, no law does"
    trial: ClassVar[dict[str, float]] = {"points": 0.1}
    over: ClassVar[str]
    what: ClassVar[str]

    low: float = quantity("1", -1e6, 1e6, "of the signal, the first place", default=0.0)
    high: float = quantity("1", -1e6, 1e6, "of the signal, the last place", default=0.0)
    points: tuple[float, ...] = quantity(
        "1", -100.0, 100.0, "flow or force at evenly spaced places", default=NONE, count=PLACES
    )

    @property
    def is_on(self) -> bool:
        """Tell whether any of its points is not zero."""
        return any(self.points)

    def table(self) -> tuple[tuple[float, float], ...]:
        """Return the places, in the signal's unit, and the points."""
        width = (self.high - self.low) / (PLACES - 1)
        return tuple((self.low + k * width, point) for k, point in enumerate(self.points))


@dataclass(frozen=True)
class UnnamedFlow(Curve):
    """Flow by the spool's opening, positive where it lifts, beside what the valve gives."""

    balance: ClassVar[Balance] = "valve"
    over: ClassVar[str] = "valve opening"
    what: ClassVar[str] = "flow"


@dataclass(frozen=True)
class UnnamedLeakage(Curve):
    """Flow out of the chamber by its pressure."""

    balance: ClassVar[Balance] = "chambers"
    over: ClassVar[str] = "oil pressure"
    what: ClassVar[str] = "leakage"


@dataclass(frozen=True)
class UnnamedFriction(Curve):
    """Force against the piston by its velocity, as a pressure; without an elastic arm alone."""

    balance: ClassVar[Balance] = "force"
    over: ClassVar[str] = "velocity"
    what: ClassVar[str] = "force"


@dataclass(frozen=True)
class UnnamedForce(Curve):
    """Force on the piston by the way that it has moved, as a pressure, positive where it lifts."""

    balance: ClassVar[Balance] = "force"
    over: ClassVar[str] = "way"
    what: ClassVar[str] = "force"


CURVES: dict[str, type[Curve]] = {
    "unnamed_flow": UnnamedFlow,
    "unnamed_leakage": UnnamedLeakage,
    "unnamed_friction": UnnamedFriction,
    "unnamed_force": UnnamedForce,
}


@compiled_in_place
def straight(signal: float, low: float, high: float, points: Any) -> float:
    """Return a curve's value at a signal, straight between its points, (PLACES,).

    0 without places.
    """
    if high == low:
        return 0.0
    if not abs(signal) < BEYOND:  # a run out of all bounds: no place
        return 0.0
    place = min(max((signal - low) / (high - low), 0.0), 1.0) * (PLACES - 1)
    behind = int(min(place, PLACES - 2.0))
    value: float = points[behind] + (place - behind) * (points[behind + 1] - points[behind])
    return value

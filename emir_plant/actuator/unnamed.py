"""What an actuator has by no law that has a name: curves, straight between places.

A diagnosis measures one where no effect explains a recording. Outside its places a curve stays at
its ends.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

from emir_common.quantity import quantity
from emir_plant.effects.base import Balance, Effect
from emir_plant.jit import compiled_in_place

PLACES = 7
MEASURED = "measured: a recording tells the curve, no law does"
POINTS = tuple(f"at_{k}" for k in range(PLACES))


@dataclass(frozen=True)
class Curve(Effect):
    """A curve over one signal. over: the signal, and its unit.

    low, high: of the signal, the first and the last of evenly spaced places. at_0 ... at_6: the
    values there.
    """

    sizes: ClassVar[tuple[str, ...]] = POINTS
    source: ClassVar[str] = MEASURED
    trial: ClassVar[dict[str, float]] = dict.fromkeys(POINTS, 0.1)
    over: ClassVar[str]
    what: ClassVar[str]

    low: float = quantity("1", -1e6, 1e6, "of the signal, the first place", default=0.0)
    high: float = quantity("1", -1e6, 1e6, "of the signal, the last place", default=0.0)
    at_0: float = quantity("1", -100.0, 100.0, "value at low", default=0.0)
    at_1: float = quantity("1", -100.0, 100.0, "a sixth of the way behind", default=0.0)
    at_2: float = quantity("1", -100.0, 100.0, "two sixths behind", default=0.0)
    at_3: float = quantity("1", -100.0, 100.0, "half way", default=0.0)
    at_4: float = quantity("1", -100.0, 100.0, "four sixths behind", default=0.0)
    at_5: float = quantity("1", -100.0, 100.0, "five sixths behind", default=0.0)
    at_6: float = quantity("1", -100.0, 100.0, "value at high", default=0.0)


@dataclass(frozen=True)
class UnnamedFlow(Curve):
    """Flow through the valve by the spool's opening."""

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
    """Force against the piston by its velocity, as a pressure."""

    balance: ClassVar[Balance] = "force"
    over: ClassVar[str] = "velocity"
    what: ClassVar[str] = "force"


@dataclass(frozen=True)
class UnnamedForce(Curve):
    """Force on the piston by the way that it has moved, as a pressure."""

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
def _hat(place: float, middle: float) -> float:
    return max(1.0 - abs(place - middle), 0.0)


@compiled_in_place
def _curve(place: float, points: Any) -> float:
    """Return the value at a place, 0 ... 1, of a curve with these values at its points."""
    at = min(max(place, 0.0), 1.0) * (PLACES - 1)
    a, b, c, d, e, f, g = points
    value: float = (
        a * _hat(at, 0.0) + b * _hat(at, 1.0) + c * _hat(at, 2.0) + d * _hat(at, 3.0)
        + e * _hat(at, 4.0) + f * _hat(at, 5.0) + g * _hat(at, 6.0)
    )  # fmt: skip
    return value


@compiled_in_place
def unnamed_flow(opening: float, p: Any) -> float:
    """Return the flow at a spool's opening; none without places."""
    low, high = p.effects_unnamed_flow_low, p.effects_unnamed_flow_high
    if high == low:
        return 0.0
    points = (
        p.effects_unnamed_flow_at_0,
        p.effects_unnamed_flow_at_1,
        p.effects_unnamed_flow_at_2,
        p.effects_unnamed_flow_at_3,
        p.effects_unnamed_flow_at_4,
        p.effects_unnamed_flow_at_5,
        p.effects_unnamed_flow_at_6,
    )
    return _curve((opening - low) / (high - low), points)


@compiled_in_place
def unnamed_leakage(pressure: float, p: Any) -> float:
    """Return the flow out of the chamber at a pressure; none without places."""
    low, high = p.effects_unnamed_leakage_low, p.effects_unnamed_leakage_high
    if high == low:
        return 0.0
    points = (
        p.effects_unnamed_leakage_at_0,
        p.effects_unnamed_leakage_at_1,
        p.effects_unnamed_leakage_at_2,
        p.effects_unnamed_leakage_at_3,
        p.effects_unnamed_leakage_at_4,
        p.effects_unnamed_leakage_at_5,
        p.effects_unnamed_leakage_at_6,
    )
    return _curve((pressure - low) / (high - low), points)


@compiled_in_place
def unnamed_friction(velocity: float, p: Any) -> float:
    """Return the force against a velocity; none without places."""
    low, high = p.effects_unnamed_friction_low, p.effects_unnamed_friction_high
    if high == low:
        return 0.0
    points = (
        p.effects_unnamed_friction_at_0,
        p.effects_unnamed_friction_at_1,
        p.effects_unnamed_friction_at_2,
        p.effects_unnamed_friction_at_3,
        p.effects_unnamed_friction_at_4,
        p.effects_unnamed_friction_at_5,
        p.effects_unnamed_friction_at_6,
    )
    return _curve((velocity - low) / (high - low), points)


@compiled_in_place
def unnamed_force(way: float, p: Any) -> float:
    """Return the force on the piston at a way; none without places."""
    low, high = p.effects_unnamed_force_low, p.effects_unnamed_force_high
    if high == low:
        return 0.0
    points = (
        p.effects_unnamed_force_at_0,
        p.effects_unnamed_force_at_1,
        p.effects_unnamed_force_at_2,
        p.effects_unnamed_force_at_3,
        p.effects_unnamed_force_at_4,
        p.effects_unnamed_force_at_5,
        p.effects_unnamed_force_at_6,
    )
    return _curve((way - low) / (high - low), points)


def points(found: Any) -> tuple[tuple[float, float], ...]:
    """Return a curve's places and its values there."""
    width = (found.high - found.low) / (PLACES - 1)
    return tuple((found.low + k * width, getattr(found, name)) for k, name in enumerate(POINTS))

"""Play between piston and joint: the piston crosses it when the force changes sign.

While the piston crosses, next to no force is on it, and force and play settle within microseconds,
whatever the boom does. A step that is too long to follow that is crossed at the rate that holds at
its end (implicit Euler for this one rate), as for dry friction that sticks.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

from emir_common.quantity import quantity
from emir_plant.effects.base import Balance, Effect
from emir_plant.effects.smooth_sign import slope, smooth_sign
from emir_plant.jit import compiled

ITERATIONS = 60  # of the search for a rate, far more than it takes
ACCURACY = 1e-9  # relative, of the rate


@dataclass(frozen=True)
class Backlash(Effect):
    """Offset s of the piston against the joint, T ds/dt = (gap / 2) [tanh(F / F_s) + F / F_p] - s.

    F is the oil's force: well above the seating force F_s the piston rests on one flank, well
    below -F_s on the other, and in between it is on its way. For gradual_share of it
    F / sqrt(F^2 + F_s^2) in place of tanh(F / F_s). A pin is a spring, too: F_p bends it by half
    the gap.
    """

    balance: ClassVar[Balance] = "kinematics"
    sizes: ClassVar[tuple[str, ...]] = ("gap",)
    source: ClassVar[str] = "worn pins and bushings, 0.1-1 mm"
    trial: ClassVar[dict[str, float]] = {"gap": 5e-4, "gradual_share": 0.5, "pin_force": 5e6}

    gap: float = quantity("m", 0.0, 1e-2, "from flank to flank", default=0.0)
    seating_force: float = quantity("N", 200.0, 1e6, "F_s, at which a flank is met", default=2e4)
    gradual_share: float = quantity("1", 0.0, 1.0, "of F/sqrt(F^2 + F_s^2)", default=0.0)
    crossing_time: float = quantity("s", 0.002, 0.5, "T, of the film in the bearing", default=0.01)
    pin_force: float = quantity("N", 1e4, 1e12, "F_p, bends the pin by gap / 2", default=1e12)


@compiled
def flank(force: float, p: Any) -> float:
    """Return where the piston rests against the joint, m, under a steady force, N."""
    seated = smooth_sign(force / p.backlash_seating_force, p.backlash_gradual_share)
    return 0.5 * p.backlash_gap * (seated + force / p.backlash_pin_force)


@compiled
def rate(offset: float, force: float, p: Any) -> float:
    """Return ds/dt, m/s, of the offset s, m, under the oil's force, N."""
    if p.backlash_gap == 0.0:
        return 0.0
    return (flank(force, p) - offset) / p.backlash_crossing_time


@compiled
def settling_rate(stiffness: float, force: float, p: Any) -> float:
    """Return the rate, 1/s, at which play and oil settle under a force, N, of the oil.

    stiffness: of the oil against the piston's motion, N/m.
    """
    return (1.0 + yielding(force, p) * stiffness) / p.backlash_crossing_time


@compiled
def yielding(force: float, p: Any) -> float:
    """Return the slope of `flank` over the force, m/N."""
    steep = slope(force / p.backlash_seating_force, p.backlash_gradual_share)
    return 0.5 * p.backlash_gap * (steep / p.backlash_seating_force + 1.0 / p.backlash_pin_force)


@compiled
def rate_over(step: float, offset: float, force: float, stiffness: float, p: Any) -> float:
    """Return ds/dt, m/s, that holds at the end of a step, s, if it holds all over it.

    offset: m, at its start. force: N, of the oil at its end if the offset stays. stiffness: of the
    oil against the piston's motion, N/m. By Newton's method between bounds.
    """
    time = p.backlash_crossing_time + step
    missing = flank(force, p) - offset
    low, high = min(missing / time, 0.0), max(missing / time, 0.0)
    found = 0.0
    for _ in range(ITERATIONS):
        there = force - step * stiffness * found
        off = time * found - (flank(there, p) - offset)
        if off < 0.0:
            low = found
        else:
            high = found
        before = found
        found -= off / (time + step * stiffness * yielding(there, p))
        if not low <= found <= high:
            found = 0.5 * (low + high)
        if abs(found - before) <= ACCURACY * abs(found):
            break
    return found

"""Dry friction over an integration step, in steps as short as it needs.

Near standstill dry friction is so steep a function of the velocity that an explicit method
chatters in any affordable step. There the velocity at the step's end is the unknown (implicit
Euler for this one force): v = u - m F(v), with u that velocity without dry friction and m the
step over the mass that the piston feels. A piston that friction can hold then stands. Where the
friction changes gently, Runge-Kutta takes it as any other force.

Between sticking and sliding the friction turns round within microseconds, and an error there is
not forgotten: a boom whose piston sticks and slips in turn keeps up a bending mode for seconds,
and how often it does so decides where it stands afterwards. Steps are therefore halved until what
the change of friction does to the velocity is small.
"""

import math
from typing import Any, NamedTuple

from emir_plant.effects import terms
from emir_plant.jit import compiled

SHORTEST = 0.125  # of the fine step
CHANGE = 0.12  # m/s^2, of the velocity by the change of friction, per fine step: 3e-5 m/s
GENTLE = 0.5  # share of the change of velocity under the friction of the start, below which a
# step of Runge-Kutta is accurate
SWING = 2e-4  # m/s, amplitude of the piston in the fastest mode from which on steps are shorter:
# the phase that is lost in it adds up over seconds and shifts the instants of sticking
EVEN = 2.0  # fine steps where the friction stays the same all over that swing
ITERATIONS = 60  # of the search, far more than it takes
TOLERANCE = 1e-9  # m/s


class Piston(NamedTuple):
    """The piston at the start of a step."""

    velocity: float  # m/s
    acceleration: float  # without dry friction, m/s^2
    mobility: float  # 1/kg
    at: terms.Situation
    friction: float  # dry, N
    swing: float  # amplitude in the boom's fastest mode, m/s


class Ends(NamedTuple):
    """Two velocities, m/s, and by how much each is off, m/s, with different signs."""

    low: float
    at_low: float
    high: float
    at_high: float


class Friction(NamedTuple):
    """Dry friction over a step.

    held: it is the same force all over the step, otherwise a function of the velocity.
    """

    step: float  # s
    force: float  # N, at the start or, when held, all over the step
    held: bool


@compiled
def over_step(piston: Piston, left: float, usual: float, fine: float, p: Any) -> Friction:
    """Return the dry friction of the longest step that is accurate.

    left: the most it may be, s. usual: step without dry friction, s. fine: step, s, that follows
    stick and slip, and to which the accuracy belongs.
    """
    step = min(left, _following(piston, usual, fine, p))
    allowed = CHANGE * fine
    while True:
        unhindered, mobility = piston.velocity + step * piston.acceleration, step * piston.mobility
        straight = unhindered - mobility * piston.friction
        change = mobility * abs(terms.dry_friction(straight, piston.at, p) - piston.friction)
        if change <= GENTLE * abs(straight - piston.velocity):
            return Friction(step, piston.friction, False)
        if step <= SHORTEST * fine:
            return Friction(step, at_end(unhindered, mobility, piston.at, p), True)
        # a friction that changes by no more leads to a velocity between these two
        low, high = straight - allowed, straight + allowed
        at_low = _off(low, unhindered, mobility, piston.at, p)
        at_high = _off(high, unhindered, mobility, piston.at, p)
        if at_low <= 0.0 <= at_high:
            ends = Ends(low, at_low, high, at_high)
            return Friction(step, _between(ends, unhindered, mobility, piston.at, p), True)
        step *= 0.5


@compiled
def _following(piston: Piston, usual: float, fine: float, p: Any) -> float:
    """Return the longest step, s, that follows the piston's swing."""
    if piston.swing <= SWING:
        return usual
    slowest = piston.velocity - math.copysign(piston.swing, piston.velocity)
    change = terms.dry_friction(slowest, piston.at, p) - piston.friction
    if piston.mobility * abs(change) > CHANGE:
        return fine
    return min(EVEN * fine, usual)


@compiled
def at_end(unhindered: float, mobility: float, at: terms.Situation, p: Any) -> float:
    """Return the dry friction, N, at the end of a step.

    unhindered: velocity at the end of the step without it, m/s. mobility: step over mass,
    m/(s N). The velocity lies between 0 and unhindered.
    """
    at_high = mobility * terms.dry_friction(unhindered, at, p)
    ends = Ends(0.0, -unhindered, unhindered, at_high)
    return _between(ends, unhindered, mobility, at, p)


@compiled
def _off(velocity: float, unhindered: float, mobility: float, at: terms.Situation, p: Any) -> float:
    """Return by how much, m/s, the velocity at a step's end is not what its friction makes it."""
    return velocity + mobility * terms.dry_friction(velocity, at, p) - unhindered


@compiled
def _between(ends: Ends, unhindered: float, mobility: float, at: terms.Situation, p: Any) -> float:
    """Return the dry friction, N, at the end of a step; the velocity lies between two ends.

    By the Illinois method.
    """
    low, at_low, high, at_high = ends
    velocity, side = low, 0
    for _ in range(ITERATIONS):
        if at_high == at_low:
            break
        velocity = (low * at_high - high * at_low) / (at_high - at_low)
        off = _off(velocity, unhindered, mobility, at, p)
        if abs(off) <= TOLERANCE:
            break
        if off * at_high > 0.0:
            high, at_high = velocity, off
            if side == 1:
                at_low *= 0.5
            side = 1
        else:
            low, at_low = velocity, off
            if side == -1:
                at_high *= 0.5
            side = -1
    return (unhindered - velocity) / mobility

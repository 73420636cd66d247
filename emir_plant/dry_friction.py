"""Dry friction over an integration step: the one that belongs to the velocity at its end.

Near standstill dry friction is so steep a function of the velocity that an explicit method
chatters in any affordable step. The end velocity is therefore the unknown (implicit Euler for
this one force): v = u - m F(v), with u the end velocity without dry friction and m the step
over the mass that the piston feels. A piston that friction can hold then stands.
"""

from typing import Any

from emir_plant.effects import terms
from emir_plant.jit import compiled

ITERATIONS = 60  # of the search; it takes about ten, sliding two
TOLERANCE = 1e-12  # m/s


@compiled
def over_step(unhindered: float, mobility: float, load: float, p: Any) -> float:
    """Return the dry friction, N, of a step.

    unhindered: velocity at the end of the step without it, m/s. mobility: step over mass,
    m/(s N). load: force of the oil on the piston, N.
    """
    sliding = terms.dry_friction(unhindered, load, p)
    if sliding == 0.0:
        return 0.0
    end = unhindered - mobility * sliding
    if end * unhindered > 0.0:
        friction = terms.dry_friction(end, load, p)
        if abs(mobility * (friction - sliding)) <= TOLERANCE:
            return friction
    return (unhindered - _end_velocity(unhindered, mobility, load, p)) / mobility


@compiled
def _end_velocity(unhindered: float, mobility: float, load: float, p: Any) -> float:
    """Return the velocity between 0 and unhindered, m/s, by the Illinois method."""
    low, high = 0.0, unhindered
    at_low = -unhindered
    at_high = mobility * terms.dry_friction(unhindered, load, p)
    velocity, side = low, 0
    for _ in range(ITERATIONS):
        velocity = (low * at_high - high * at_low) / (at_high - at_low)
        missing = velocity + mobility * terms.dry_friction(velocity, load, p) - unhindered
        if abs(missing) <= TOLERANCE:
            break
        if missing * at_high > 0.0:
            high, at_high = velocity, missing
            if side == 1:
                at_low *= 0.5
            side = 1
        else:
            low, at_low = velocity, missing
            if side == -1:
                at_high *= 0.5
            side = -1
    return velocity

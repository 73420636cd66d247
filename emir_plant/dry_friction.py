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

from typing import Any, NamedTuple

from emir_plant.effects import terms
from emir_plant.jit import compiled

SHORTEST = 0.125  # of the fine step
CHANGE = 0.12  # m/s^2, of the velocity by the change of friction, per fine step: 3e-5 m/s
GENTLE = 0.5  # share of the change of velocity, below which a step of Runge-Kutta is accurate
ITERATIONS = 60  # of the search; it takes about ten, sliding two
TOLERANCE = 1e-12  # m/s


class Friction(NamedTuple):
    """Dry friction over a step.

    held: it is the same force all over the step, otherwise a function of the velocity.
    """

    step: float  # s
    force: float  # N, at the start or, when held, all over the step
    held: bool


@compiled
def over_step(  # noqa: PLR0913, PLR0917 (compiled code has no object to bundle them in)
    velocity: float,
    acceleration: float,
    mobility: float,
    load: float,
    longest: float,
    fine: float,
    p: Any,
) -> Friction:
    """Return the dry friction of the longest step that is accurate, up to `longest`, s.

    velocity: m/s. acceleration: without dry friction, m/s^2. mobility: of the piston, 1/kg.
    load: force of the oil on the piston, N. fine: step, s, to which the accuracy belongs.
    """
    before = terms.dry_friction(velocity, load, p)
    step = longest
    while True:
        after = at_end(velocity + step * acceleration, step * mobility, load, p)
        change = step * mobility * abs(after - before)
        moved = step * abs(acceleration - mobility * after)
        if change <= CHANGE * fine or step <= SHORTEST * fine:
            break
        step *= 0.5
    if change <= GENTLE * moved or change == 0.0:
        return Friction(step, before, False)
    return Friction(step, after, True)


@compiled
def at_end(unhindered: float, mobility: float, load: float, p: Any) -> float:
    """Return the dry friction, N, at the end of a step.

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

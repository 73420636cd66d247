"""Dry friction of seals that give before they slide, as bristles do.

The bristles' force F_b is a state, and friction is that and their damping (Dahl 1968; Canudas de
Wit et al. 1995, IEEE Trans. Automatic Control 40(3): LuGre):

    dF_b/dt = sigma_0 (v - |v| F_b / g),    F = F_b + sigma_1 / sigma_0 dF_b/dt

with their stiffness sigma_0 and damping sigma_1 and the friction g at which the seal slides. Those
that are elastic up to a share of g creep under no lesser force, and spring back without sliding
(Dupont et al. 2002, IEEE Trans. Automatic Control 47(5), with a step for the transition). Over
a step F_b is solved along the way that the piston has come, which is exact while g stays: at speed
bristles are bent within microseconds, and no step needs to be as short. Where they hold the
piston, or it turns round, they are a spring, and steps follow its swing.
"""

import math
from typing import NamedTuple

from emir_plant.jit import compiled, square_root

FOLLOWED = 0.3  # rad, of the piston's swing on the bristles in a step
SETTLING = 0.5  # share of a step that the bristles' damping takes to settle the piston, at most


class Bristles(NamedTuple):
    """What all seals do together at an instant."""

    sliding: float  # g, N
    stiffness: float  # sigma_0, N/m
    damping: float  # sigma_1, N s/m
    elastic: float  # share of g up to which they give without sliding


@compiled
def carried(force: float, moved: float, b: Bristles) -> float:
    """Return the bristles' force, N, after the piston has moved, m, from where it was `force`."""
    if b.sliding <= 0.0:
        return 0.0
    if b.elastic > 0.0:
        springing = math.copysign(_springing(force, moved, b), moved)
        force, moved = force + b.stiffness * springing, moved - springing
    sliding = math.copysign(b.sliding, moved)
    return sliding + (force - sliding) * math.exp(-abs(moved) * b.stiffness / b.sliding)


@compiled
def _springing(force: float, moved: float, b: Bristles) -> float:
    """Return on how much of a way, m, the bristles are a spring before they slide, too, m."""
    left = b.elastic * b.sliding - math.copysign(1.0, moved) * force
    return min(max(left / b.stiffness, 0.0), abs(moved))


@compiled
def bending(force: float, velocity: float, b: Bristles) -> float:
    """Return how fast the bristles bend, m/s, at the piston's velocity, m/s: dF_b/dt / sigma_0."""
    if b.sliding <= 0.0:
        return 0.0
    if b.elastic > 0.0 and math.copysign(1.0, velocity) * force < b.elastic * b.sliding:
        return velocity
    return velocity - abs(velocity) * force / b.sliding


@compiled
def friction(force: float, velocity: float, b: Bristles) -> float:
    """Return the friction, N, at the bristles' force, N, and the piston's velocity, m/s."""
    return force + b.damping * bending(force, velocity, b)


@compiled
def longest_step(holding: float, mobility: float, b: Bristles) -> float:
    """Return the longest step, s, that follows a piston on its bristles.

    holding: share of their stiffness and damping that acts; 0 while they slide, up to 2 where it
    turns round. mobility: of the piston, 1/kg.
    """
    swing = FOLLOWED / square_root(max(holding * b.stiffness * mobility, 1e-12))
    return min(swing, SETTLING / max(holding * b.damping * mobility, 1e-12))

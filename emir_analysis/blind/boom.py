"""The boom as finite elements: heights of nodes, consistent masses, springs that resist kinks.

A rigid section is a linear element between two nodes, whose consistent mass matrix is exactly
that of a rigid uniform rod. Where two arms meet there may be no kink: a constraint.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh, null_space

from emir_analysis.blind.numbers import Numbers

Array = NDArray[np.float64]

GRAVITY = 9.81  # m/s^2


class Boom(NamedTuple):
    """The m lowest modes of the boom on its joint, mass-normalised, the rigid one first.

    stiffness, damping: (m,) of each mode. joint, tip_angle: (m,) rad, rotation of the first and
    the last section. weight: (m,) N, gravity on the horizontal boom. tip: (m,) m, the TCP's height.
    """

    stiffness: Array
    damping: Array
    joint: Array
    tip_angle: Array
    weight: Array
    tip: Array


def boom(n: Numbers) -> Boom:
    """Return the modes of the boom with the payload at its tip, and what else it carries."""
    elements = n.arms * n.sections_per_arm
    length, mass = n.boom_length / elements, n.boom_mass / elements
    nodes = elements + 1
    masses, springs, load = np.zeros((nodes, nodes)), np.zeros((nodes, nodes)), np.zeros(nodes)
    for k in range(elements):
        masses[k : k + 2, k : k + 2] += mass / 6.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
        load[k : k + 2] += 0.5 * mass * GRAVITY
    for more, place in ((n.payload, 1.0), (n.carried, n.carried_at)):
        heights_there = _between_nodes(place * elements, nodes)
        masses += more * np.outer(heights_there, heights_there)
        load += more * GRAVITY * heights_there
    kinks = np.zeros((elements - 1, nodes))
    for k in range(elements - 1):
        kinks[k, k : k + 3] = np.array([1.0, -2.0, 1.0]) / length
    between_arms = np.arange(1, elements) % n.sections_per_arm == 0
    springs = n.section_spring * kinks[~between_arms].T @ kinks[~between_arms]
    pinned = np.eye(1, nodes)
    free = null_space(np.vstack([kinks[between_arms], pinned]))
    squares, shapes = eigh(free.T @ springs @ free, free.T @ masses @ free)
    heights = free @ shapes[:, : n.modes_kept]
    frequency = n.modal_frequency * np.sqrt(np.maximum(squares[: n.modes_kept], 0.0))
    frequency[0] = 0.0
    return Boom(
        stiffness=frequency**2,
        damping=2.0 * n.modal_damping * frequency,
        joint=heights[1] / length,
        tip_angle=(heights[-1] - heights[-2]) / length,
        weight=load @ heights,
        tip=heights[-1],
    )


def _between_nodes(place: float, nodes: int) -> Array:
    """Return the share, (nodes,), that each node's height has in that of a place, in elements.

    Beyond the tip the last element goes on straight.
    """
    before = min(int(place), nodes - 2)
    shares = np.zeros(nodes)
    shares[before : before + 2] = before + 1 - place, place - before
    return shares

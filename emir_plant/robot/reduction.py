"""From the tree's coordinates z to the independent ones q: z = z(q), z' = G q', compiled.

G is the unit matrix and, for every part of a linkage, its slope against the joint that drives it.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from emir_plant.jit import compiled
from emir_plant.robot import linkage

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@compiled
def expand(
    q: Array,
    v: Array,
    independent: Index,
    joints: Index,
    parts: Index,
    linkages: NDArray[Any],
) -> tuple[Array, Array, Array, Array]:
    """Return z, G v, G' v, each of the tree's size, and the slopes of the parts, (p,).

    q, v: (n,). independent: (n,) places in z. joints: (6,) places in q. parts: (p, 3) for every
    dependent coordinate its place in z, its linkage and its row of `linkage.motion`.
    linkages: (5,) records.
    """
    size = independent.size + parts.shape[0]
    z, rate, rest = np.zeros(size), np.zeros(size), np.zeros(size)
    slopes = np.empty(parts.shape[0])
    motions = np.empty((linkages.size, 4, 3))
    for i in range(linkages.size):
        motion = linkage.motion(q[joints[i + 1]], linkages[i])
        for j in range(motion.shape[1]):
            motion[linkage.THRUST_BAR, j] -= motion[linkage.LEVER, j]  # the lever carries it
            # one by one: assigning an array to a part of another takes seconds to compile
            for row in range(motion.shape[0]):
                motions[i, row, j] = motion[row, j]
    for k in range(independent.size):
        z[independent[k]], rate[independent[k]] = q[k], v[k]
    for k in range(parts.shape[0]):
        place, driver, row = parts[k]
        speed = v[joints[driver + 1]]
        value, slope, bend = motions[driver, row]
        z[place], rate[place], rest[place] = value, slope * speed, bend * speed * speed
        slopes[k] = slope
    return z, rate, rest, slopes


@compiled
def reduced_force(
    tree: Array, independent: Index, joints: Index, parts: Index, slopes: Array
) -> Array:
    """Return G^T f, (n,), of the generalised forces f of the tree."""
    force = np.empty(independent.size)
    for k in range(independent.size):
        force[k] = tree[independent[k]]
    for k in range(parts.shape[0]):
        force[joints[parts[k, 1] + 1]] += slopes[k] * tree[parts[k, 0]]
    return force


@compiled
def reduced_mass(
    tree: Array, independent: Index, joints: Index, parts: Index, slopes: Array
) -> Array:
    """Return G^T M G, (n, n), of the tree's mass matrix M."""
    n = independent.size
    rows = np.empty((n, tree.shape[0]))
    for k in range(n):
        rows[k] = tree[independent[k]]
    for k in range(parts.shape[0]):
        rows[joints[parts[k, 1] + 1]] += slopes[k] * tree[parts[k, 0]]
    mass = np.empty((n, n))
    for k in range(n):
        for j in range(n):
            mass[k, j] = rows[k, independent[j]]
    for k in range(parts.shape[0]):
        driver, place = joints[parts[k, 1] + 1], parts[k, 0]
        for j in range(n):
            mass[j, driver] += slopes[k] * rows[j, place]
    return mass

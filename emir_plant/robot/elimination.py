"""Solving (M + diag(D)) x = f without the mass matrix M: coordinate by coordinate, compiled.

The articulated-body method (Featherstone, Rigid Body Dynamics Algorithms, ch. 7) on the chain
of the independent coordinates, each a joint of one freedom. From the tip inwards, with s the
motion that a coordinate gives to all that lies outside it and I the inertia that it feels there,

    U = I s,    d = s^T U + D,    I <- I - U U^T / d

Motions, momenta and forces are about the ground's origin, in its axes, so that inertias simply
add. A linkage's parts hang on the carrier of their joint and move with its coordinate by their
slopes (`reduction.py`): they add to its U and d, and to the inertia inside it.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from emir_plant.jit import compiled
from emir_plant.robot.kinematics import CHAIN, TURN, Tree, frames

Array = NDArray[np.float64]


class Factors(NamedTuple):
    """What `factorized` leaves behind, by independent coordinate, n of them."""

    motions: Array  # (n, 6), s
    momenta: Array  # (n, 6), U
    pivots: Array  # (n,), d


@compiled
def _write_inertia(k: int, axes: Array, place: Array, t: Tree, inertia: Array) -> None:
    """Write a body's inertia, (6, 6), about the origin."""
    m, c = t.masses[k], np.empty(3)
    for i in range(3):
        c[i] = place[i]
        for j in range(3):
            c[i] += axes[i, j] * t.centres[k, j]
    square = c[0] * c[0] + c[1] * c[1] + c[2] * c[2]
    half = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            half[i, j] = 0.0
            for a in range(3):
                half[i, j] += axes[i, a] * t.inertias[k, a, j]
    for i in range(3):
        for j in range(3):
            total = 0.0
            for a in range(3):
                total += half[i, a] * axes[j, a]
            inertia[3 + i, 3 + j] = total - m * c[i] * c[j]
            inertia[i, j] = 0.0
            inertia[i, 3 + j] = 0.0
            inertia[3 + i, j] = 0.0
        inertia[3 + i, 3 + i] += m * square
        inertia[i, i] = m
    for i in range(3):
        j, n = (i + 1) % 3, (i + 2) % 3
        inertia[3 + i, n], inertia[3 + i, j] = m * c[j], -m * c[n]
        inertia[n, 3 + i], inertia[j, 3 + i] = m * c[j], -m * c[n]


@compiled
def factorized(z: Array, slopes: Array, added: Array, t: Tree) -> Factors:
    """Return the factors of M + diag(added).

    z, slopes: from `reduction.expand`. added: (n,), D.
    """
    axes, places, tree_motions = frames(z, t)
    of_parts = _motions_of_parts(tree_motions, slopes, t)
    n = added.size
    motions, momenta, pivots = np.empty((n, 6)), np.empty((n, 6)), np.empty(n)
    outside, own = np.zeros((6, 6)), np.empty((6, 6))  # inertias
    hanging, moved = np.empty((6, 6)), np.empty(6)  # of a joint's parts: inertia and momentum
    at = n
    for k in range(t.kinds.size - 1, -1, -1):
        if t.drivers[k] != CHAIN:
            continue
        _write_inertia(k, axes[k], places[k], t, own)
        outside += own
        hanging[:], moved[:], square = 0.0, 0.0, 0.0
        part = k - 1  # the parts of a joint stand in front of it in the tree
        while t.kinds[k] == TURN and part >= 0 and t.drivers[part] != CHAIN:
            _write_inertia(part, axes[part], places[part], t, own)
            square += _hang(own, of_parts[part], hanging, moved)
            part -= 1
        for f in range(0 if t.kinds[k] == TURN else 2, -1, -1):
            at -= 1
            for i in range(6):  # one by one: as an assignment of rows it takes seconds to compile
                motions[at, i] = tree_motions[t.coordinates[k] + f, i]
            pivots[at] = _pivot(outside, motions[at], moved, momenta[at]) + added[at] + square
            for i in range(6):
                share = momenta[at, i] / pivots[at]
                for j in range(6):
                    outside[i, j] += hanging[i, j] - share * momenta[at, j]
    return Factors(motions, momenta, pivots)


@compiled
def _motions_of_parts(motions: Array, slopes: Array, t: Tree) -> Array:
    """Return the motion of every part, (k, 6), against its carrier when its joint turns by 1."""
    result = np.zeros((t.kinds.size, 6))
    for k in range(t.kinds.size):
        if t.drivers[k] != CHAIN:
            slope = slopes[t.slopes[k]]
            for i in range(6):
                result[k, i] = slope * motions[t.coordinates[k], i] + result[t.parents[k], i]
    return result


@compiled
def _hang(inertia: Array, motion: Array, hanging: Array, moved: Array) -> float:
    """Add a part's inertia and momentum to those of its linkage; return motion^T momentum."""
    square = 0.0
    for i in range(6):
        momentum = 0.0
        for j in range(6):
            hanging[i, j] += inertia[i, j]
            momentum += inertia[i, j] * motion[j]
        moved[i] += momentum
        square += momentum * motion[i]
    return square


@compiled
def _pivot(inertia: Array, motion: Array, moved: Array, momentum: Array) -> float:
    """Write U = I s + moved to momentum; return s^T I s."""
    square = 0.0
    for i in range(6):
        total = 0.0
        for j in range(6):
            total += inertia[i, j] * motion[j]
        square += total * motion[i]
        momentum[i] = total + moved[i]
    return square


@compiled
def solve(factors: Factors, x: Array) -> None:
    """Solve (M + diag(D)) x = x, (n,), in place."""
    motions, momenta, pivots = factors
    force, motion = np.zeros(6), np.zeros(6)
    for k in range(x.size - 1, -1, -1):
        for i in range(6):
            x[k] -= motions[k, i] * force[i]
        for i in range(6):
            force[i] += momenta[k, i] * (x[k] / pivots[k])
    for k in range(x.size):
        for i in range(6):
            x[k] -= momenta[k, i] * motion[i]
        x[k] /= pivots[k]
        for i in range(6):
            motion[i] += motions[k, i] * x[k]

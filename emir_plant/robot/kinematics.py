"""Where every body of the tree is and how every coordinate moves it, compiled.

All in the axes of the ground. A motion is the velocity that it gives to a point at the ground's
origin, moved along with the body, and the angular velocity, (6,).
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from emir_plant.jit import compiled
from emir_plant.robot.topology import Topology

Array = NDArray[np.float64]
Index = NDArray[np.int64]

TURN, SLIDE, SHIFT, ZYX = 0, 1, 2, 3  # kinds of a joint: about an axis, along it, three, three
CHAIN = -1  # driver of a joint that is no part of a linkage
GROUND = -1  # as a parent


class Tree(NamedTuple):
    """The tree of `topology.py` as the compiled functions read it, (k,) joints, parents first."""

    kinds: Index
    parents: Index  # joint that carries it, -1 the ground
    places: Array  # (k, 3) in the parent's frame, m; all frames are parallel at rest
    axes: Array  # (k, 3)
    coordinates: Index  # first place in the tree's coordinates
    drivers: Index  # linkage (0-4) of a part, or CHAIN
    slopes: Index  # of a part its place among the slopes, or CHAIN
    masses: Array  # kg
    centres: Array  # (k, 3), m
    inertias: Array  # (k, 3, 3) about the centre, kg m^2


def tree(t: Topology) -> Tree:
    """Return the tree of a robot."""
    model, count = t.model, t.model.njoints - 1
    drivers, slopes = np.full(count, CHAIN), np.full(count, CHAIN)
    first = np.array([model.idx_vs[j] for j in range(1, model.njoints)])
    for k, (place, driver, _) in enumerate(t.parts):
        drivers[first == place], slopes[first == place] = driver, k
    kinds, axes = np.zeros(count, dtype=np.int64), np.zeros((count, 3))
    for k, joint in enumerate(model.joints[1:]):
        kinds[k], axes[k] = _kind(joint.shortname(), joint)
    bodies = list(model.inertias)[1:]
    return Tree(
        kinds,
        np.array([model.parents[j] - 1 for j in range(1, model.njoints)]),
        np.array([model.jointPlacements[j].translation for j in range(1, model.njoints)]),
        axes,
        first,
        drivers,
        slopes,
        np.array([body.mass for body in bodies]),
        np.array([body.lever for body in bodies]),
        np.array([body.inertia for body in bodies]),
    )


def _kind(name: str, joint: Any) -> tuple[int, Array]:
    if name == "JointModelRZ":
        return TURN, np.array([0.0, 0.0, 1.0])
    if name == "JointModelRevoluteUnaligned":
        return TURN, np.array(joint.extract().axis)
    if name == "JointModelPX":
        return SLIDE, np.array([1.0, 0.0, 0.0])
    return {"JointModelTranslation": SHIFT, "JointModelSphericalZYX": ZYX}[name], np.zeros(3)


@compiled
def _turn(axes: Array, at: Array, angle: float) -> None:
    """Turn a frame, axes (3, 3) in the columns, about a unit vector in it, in place."""
    c, s = math.cos(angle), math.sin(angle)
    for row in range(3):
        x, y, z = axes[row, 0], axes[row, 1], axes[row, 2]
        along = (1.0 - c) * (x * at[0] + y * at[1] + z * at[2])
        axes[row, 0] = c * x + along * at[0] + s * (y * at[2] - z * at[1])
        axes[row, 1] = c * y + along * at[1] + s * (z * at[0] - x * at[2])
        axes[row, 2] = c * z + along * at[2] + s * (x * at[1] - y * at[0])


@compiled
def _write_turning(axes: Array, place: Array, at: Array, motion: Array) -> None:
    """Write the motion, (6,), of turning about a unit vector of a frame at a place."""
    for i in range(3):
        motion[3 + i] = axes[i, 0] * at[0] + axes[i, 1] * at[1] + axes[i, 2] * at[2]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        motion[i] = place[j] * motion[3 + k] - place[k] * motion[3 + j]


@compiled
def frames(z: Array, t: Tree) -> tuple[Array, Array, Array]:
    """Return of every joint's frame the axes, (k, 3, 3) in the columns, and the place, (k, 3), m.

    And of every coordinate its motion, (len(z), 6). z: the tree's coordinates.
    """
    count = t.kinds.size
    axes, places = np.empty((count, 3, 3)), np.empty((count, 3))
    motions = np.zeros((z.size, 6))
    units, origin = np.eye(3), np.zeros(3)
    for k in range(count):
        own, at = axes[k], places[k]
        if t.parents[k] == GROUND:
            _carry(units, origin, t.places[k], own, at)
        else:
            _carry(axes[t.parents[k]], places[t.parents[k]], t.places[k], own, at)
        first = t.coordinates[k]
        if t.kinds[k] == TURN:
            _write_turning(own, at, t.axes[k], motions[first])
            _turn(own, t.axes[k], z[first])
        elif t.kinds[k] == SLIDE:
            _slide(own, t.axes[k], z[first], at, motions[first])
        elif t.kinds[k] == SHIFT:
            for n in range(3):
                _slide(own, units[n], z[first + n], at, motions[first + n])
        else:
            for n in range(3):
                _write_turning(own, at, units[2 - n], motions[first + n])
                _turn(own, units[2 - n], z[first + n])
    return axes, places, motions


@compiled
def _carry(axes: Array, place: Array, offset: Array, own: Array, at: Array) -> None:
    """Write to own and at the frame of a joint that its parent carries at an offset, m."""
    for i in range(3):
        at[i] = place[i]
        for j in range(3):
            own[i, j] = axes[i, j]
            at[i] += axes[i, j] * offset[j]


@compiled
def _slide(axes: Array, along: Array, way: float, at: Array, motion: Array) -> None:
    """Move a place along a unit vector of a frame, m, in place, and write the motion."""
    for i in range(3):
        motion[i] = axes[i, 0] * along[0] + axes[i, 1] * along[1] + axes[i, 2] * along[2]
        at[i] += way * motion[i]


@compiled
def _follow(q: Array, t: Tree, joint: int, axes: Array, place: Array) -> None:
    """Write axes, (3, 3), and place, (3,), m, of a joint's frame, down the chain to it alone."""
    units, motion = np.eye(3), np.empty(3)
    _carry(units, np.zeros(3), np.zeros(3), axes, place)
    at = 0
    for k in range(joint + 1):
        if t.drivers[k] != CHAIN:
            continue
        for i in range(3):
            for j in range(3):
                place[i] += axes[i, j] * t.places[k, j]
        if t.kinds[k] == TURN:
            _turn(axes, t.axes[k], q[at])
            at += 1
            continue
        for n in range(3):
            if t.kinds[k] == SHIFT:
                _slide(axes, units[n], q[at + n], place, motion)
            else:
                _turn(axes, units[2 - n], q[at + n])
        at += 3


@compiled
def tips(q: Array, joints: Index, t: Tree, tcp: tuple[int, Array]) -> tuple[Array, Array]:
    """Return the TCP's place, (2, 3), m, and axes, (2, 3, 3): as it is, and unbent.

    q: (n,). joints: (6,) places in q. tcp: the joint that carries it, and where in its frame,
    (3,), m. No coordinate of a linkage has an influence.
    """
    joint, offset = tcp
    axes, places = np.empty((2, 3, 3)), np.empty((2, 3))
    unbent = np.zeros_like(q)
    for k in joints:
        unbent[k] = q[k]
    _follow(q, t, joint, axes[0], places[0])
    _follow(unbent, t, joint, axes[1], places[1])
    for n in range(2):
        for i in range(3):
            for j in range(3):
                places[n, i] += axes[n, i, j] * offset[j]
    return places, axes


class Deflection(NamedTuple):
    """The TCP, and its deflection from that of the rigid robot with the same joint angles."""

    tcp: Array  # r_6, (3,), m, deflected
    tcp_axes: Array  # x_6, y_6, z_6 in the columns, (3, 3), deflected
    position: Array  # deflection of r_6, (3,), m, ground's axes
    axes: Array  # deflection of x_6, y_6, z_6 in the columns, (3, 3)
    rotation: Array  # the same as a rotation vector, (3,), rad


@compiled
def deflection(places: Array, axes: Array) -> Deflection:
    """Return the TCP's deflection, from `tips`."""
    sine = np.zeros(3)  # small enough for the antisymmetric part to be the rotation vector's sine
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        for n in range(3):
            sine[i] += 0.5 * (axes[0, k, n] * axes[1, j, n] - axes[0, j, n] * axes[1, k, n])
    size = math.sqrt(sine[0] * sine[0] + sine[1] * sine[1] + sine[2] * sine[2])
    rotation = sine * (math.asin(min(size, 1.0)) / size if size > 0.0 else 1.0)
    return Deflection(places[0], axes[0], places[0] - places[1], axes[0] - axes[1], rotation)

"""The elastic boom: rigid sections joined by bending springs, reduced to a few modes.

Paper 2.1, Fig. 2: five arms of four sections, three springs in each arm, arms joined rigidly.
The absolute rotations of the sections are the coordinates; deflections are small against a
frame that turns with the boom.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from emir_plant.parameters import GRAVITY, Geometry

Array = NDArray[np.float64]


class PointMass(NamedTuple):
    """A mass, kg, and its place along the stretched boom; 1: at the TCP, more: beyond it."""

    mass: float
    place: float


NO_MASS = PointMass(0.0, 1.0)


@dataclass(frozen=True)
class SectionModel:
    """The boom before reduction; n coordinates theta, rad, the first at the joint.

    mass: (n, n) kg m^2. stiffness: (n, n) N m/rad. weight: (n,) N m, generalised gravity of the
    horizontal boom. tip: (n,) m, transverse displacement of the TCP per rotation.
    """

    mass: Array
    stiffness: Array
    weight: Array
    tip: Array


@dataclass(frozen=True)
class BoomModes:
    """The m lowest modes, mass-normalised, the rigid one first.

    frequency: (m,) rad/s, without the factor `modal_frequency`.
    joint, tip_angle: (m,) rotation of the first and the last section per modal coordinate.
    weight: (m,) generalised gravity of the horizontal boom.
    deflection: (m,) m, displacement of the TCP off the line of the first section, up positive.
    residual_sag: m, what the modes left out add to that, horizontal boom at rest.
    residual_compliance: m/N, what they add for a force across the boom at the TCP.
    shapes: (sections, m) rotation of every section per modal coordinate, from the joint outwards.
    """

    frequency: Array
    joint: Array
    tip_angle: Array
    weight: Array
    deflection: Array
    residual_sag: float
    residual_compliance: float
    shapes: Array


def section_model(geometry: Geometry, carried: PointMass = NO_MASS) -> SectionModel:
    """Assemble mass, stiffness and gravity of the section chain (paper Fig. 2).

    carried: besides the geometry's payload, which is at the TCP.
    """
    sections, length = geometry.sections, geometry.section_length
    mass = geometry.boom_mass / sections
    centres = length * (np.tril(np.ones((sections, sections)), -1) + 0.5 * np.eye(sections))
    tip = np.full(sections, length)
    springs = np.zeros((sections, sections))
    for k in range(sections - 1):
        bend = np.zeros(sections)
        bend[k : k + 2] = (-1.0, 1.0)
        springs += geometry.section_spring * np.outer(bend, bend)
    inertia = mass * centres.T @ centres + mass * length**2 / 12.0 * np.eye(sections)
    moment = mass * centres.sum(axis=0)
    for load in (PointMass(geometry.payload, 1.0), carried):
        at = _displacement(geometry, load.place)
        inertia += load.mass * np.outer(at, at)
        moment += load.mass * at
    join = rigid_arm_joints(geometry)
    return SectionModel(
        join.T @ inertia @ join, join.T @ springs @ join, join.T @ (GRAVITY * moment), tip @ join
    )


def _displacement(geometry: Geometry, place: float) -> Array:
    """Return the transverse displacement of a place, 1, per rotation of each section, (s,) m."""
    length = geometry.section_length
    beyond = place * geometry.boom_length - length * np.arange(geometry.sections)
    inside: Array = np.clip(beyond, 0.0, length)
    inside[-1] = max(beyond[-1], 0.0)  # the last section goes on straight
    return inside


def rigid_arm_joints(geometry: Geometry) -> Array:
    """Return (sections, n): the last section of an arm turns with the first of the next."""
    sections = geometry.sections
    starts_arm = np.arange(sections) % geometry.sections_per_arm == 0
    coordinate = np.arange(sections) - np.cumsum(starts_arm) + 1
    join = np.zeros((sections, coordinate[-1] + 1))
    join[np.arange(sections), coordinate] = 1.0
    return join


@lru_cache(maxsize=16)
def boom_modes(geometry: Geometry, carried: PointMass = NO_MASS) -> BoomModes:
    """Reduce the section model to its `modes_kept` lowest modes.

    carried: besides the geometry's payload. Raises ValueError when there are fewer coordinates
    than modes to keep.
    """
    model = section_model(geometry, carried)
    kept = geometry.modes_kept
    if kept > len(model.weight):
        raise ValueError(f"modes_kept = {kept}: the boom has only {len(model.weight)} modes")
    squares, shapes = scipy.linalg.eigh(model.stiffness, model.mass)
    shapes = shapes * np.sign(model.tip @ shapes)  # up positive
    line = np.zeros_like(model.tip)
    line[0] = model.tip.sum()
    deflection = (model.tip - line) @ shapes
    sag = _static_deflections(squares, shapes, deflection, -model.weight)
    yielding = _static_deflections(squares, shapes, deflection, model.tip)
    return BoomModes(
        frequency=np.sqrt(np.clip(squares[:kept], 0.0, None)) * (np.arange(kept) > 0),
        joint=shapes[0, :kept],
        tip_angle=shapes[-1, :kept],
        weight=shapes[:, :kept].T @ model.weight,
        deflection=deflection[:kept],
        residual_sag=float(sag[kept:].sum()),
        residual_compliance=float(yielding[kept:].sum()),
        shapes=rigid_arm_joints(geometry) @ shapes[:, :kept],
    )


def _static_deflections(squares: Array, shapes: Array, deflection: Array, force: Array) -> Array:
    """Return each mode's part of the TCP's static deflection, m, under a generalised force, (n,).

    The joint torque that carries it acts on the first section; together they leave the rigid
    mode (index 0) at rest.
    """
    load = shapes.T @ force
    torque = -load[0] / shapes[0, 0]
    load += torque * shapes[0]
    parts = np.zeros_like(load)
    parts[1:] = deflection[1:] * load[1:] / squares[1:]
    return parts

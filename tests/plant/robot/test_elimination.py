"""The elimination without a mass matrix against Pinocchio's kinematics and mass matrix."""

import numpy as np
import pytest

pytest.importorskip("pinocchio", reason="Pinocchio is missing: pip install 'emir_ros[robot]'")

import pinocchio as pin

from emir_plant.robot import elimination, kinematics
from emir_plant.robot.dynamics import Mechanics
from emir_plant.robot.sheet import robot

MECHANICS = Mechanics(robot())
JOINTS = np.radians([5.0, 45.0, -17.0, 11.0, -11.0, 17.0])


def _bent(seed: int) -> np.ndarray:
    """Bent in every coordinate far more than any load could."""
    q = np.random.default_rng(seed).normal(size=MECHANICS.size) * 0.05
    q[MECHANICS.topology.joints] = JOINTS
    return q


def test_frames_and_motions_are_pinocchios() -> None:
    model, data = MECHANICS.topology.model, MECHANICS.topology.model.createData()
    z, _, _, _ = MECHANICS.expand(_bent(1), np.zeros(MECHANICS.size))
    axes, places, motions = kinematics.frames(z, MECHANICS.tree)
    jacobians = pin.computeJointJacobians(model, data, z)
    for k in range(1, model.njoints):
        assert np.abs(axes[k - 1] - data.oMi[k].rotation).max() < 1e-13
        assert np.abs(places[k - 1] - data.oMi[k].translation).max() < 1e-12
    assert np.abs(motions.T - jacobians).max() < 1e-12


def test_tcp_is_pinocchios() -> None:
    model, data = MECHANICS.topology.model, MECHANICS.topology.model.createData()
    q = _bent(2)
    z, _, _, _ = MECHANICS.expand(q, np.zeros_like(q))
    pin.forwardKinematics(model, data, z)
    frame = pin.updateFramePlacement(model, data, model.getFrameId("tcp"))
    place, axes = MECHANICS.tcp(q)
    assert np.abs(place - frame.translation).max() < 1e-12
    assert np.abs(axes - frame.rotation).max() < 1e-13


@pytest.mark.parametrize(("largest", "tolerance"), [(0.0, 1e-8), (1e5, 1e-11)])
def test_solution_is_that_of_the_mass_matrix(largest: float, tolerance: float) -> None:
    """The mass matrix alone is badly conditioned: its cuts move grams of a boom of tons."""
    rng = np.random.default_rng(3)
    q, added = _bent(4), rng.uniform(0.0, largest, MECHANICS.size)
    z, _, _, slopes = MECHANICS.expand(q, np.zeros_like(q))
    force = rng.normal(size=q.size)
    factors = elimination.factorized(z, slopes, added, MECHANICS.tree)
    found = force.copy()
    elimination.solve(factors, found)
    expected = np.linalg.solve(MECHANICS.mass(q) + np.diag(added), force)
    assert np.abs(found - expected).max() < tolerance * np.abs(expected).max()

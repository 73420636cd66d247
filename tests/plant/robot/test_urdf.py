"""The robot's description, read by another library's parser."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest

pin = pytest.importorskip("pinocchio", reason="Pinocchio is missing: pip install 'emir_ros[robot]'")

from emir_plant.robot.dynamics import Mechanics  # noqa: E402 (only with Pinocchio)
from emir_plant.robot.sheet import robot  # noqa: E402
from emir_plant.robot.urdf import joint_positions, urdf  # noqa: E402

MECHANICS = Mechanics(robot())
TEXT = urdf(MECHANICS)
MODEL = pin.buildModelFromXML(TEXT)


def _posture() -> np.ndarray:
    q = np.random.default_rng(0).normal(size=96) * 0.01
    q[MECHANICS.topology.joints] = [0.3, 0.7, -0.4, 0.5, -0.2, 0.3]
    return q


def _loaded(q: np.ndarray) -> np.ndarray:
    coordinates = np.zeros(MODEL.nq)
    for name, value in joint_positions(MECHANICS, q).items():
        coordinates[MODEL.idx_qs[MODEL.getJointId(name)]] = value
    return coordinates


def test_every_freedom_is_a_joint() -> None:
    assert MODEL.nv == MECHANICS.topology.model.nv == 96 + 18
    assert set(joint_positions(MECHANICS, np.zeros(96))) == set(MODEL.names) - {"universe"}


def test_loaded_description_puts_the_tcp_where_the_model_does() -> None:
    q, data = _posture(), MODEL.createData()
    pin.framesForwardKinematics(MODEL, data, _loaded(q))
    place = data.oMf[MODEL.getFrameId("tcp")]
    position, axes = MECHANICS.tcp(q)
    assert place.translation == pytest.approx(position, abs=1e-9)
    assert place.rotation == pytest.approx(axes, abs=1e-9)


def test_loaded_description_has_the_models_masses() -> None:
    q = _posture()
    assert pin.computeTotalMass(MODEL) == pytest.approx(
        pin.computeTotalMass(MECHANICS.topology.model), rel=1e-9
    )
    weight = pin.computePotentialEnergy(MODEL, MODEL.createData(), _loaded(q))
    assert weight == pytest.approx(MECHANICS.energy(q, np.zeros(96))[1], rel=1e-9)


def test_pistons_meet_their_levers_in_the_loaded_description() -> None:
    q, data = _posture(), MODEL.createData()
    pin.framesForwardKinematics(MODEL, data, _loaded(q))
    for n, shape in enumerate(robot().linkages[1:], start=2):
        rod_eye = data.oMi[MODEL.getJointId(f"joint{n}_piston")].translation
        lever = data.oMi[MODEL.getJointId(f"joint{n}_lever")]
        assert lever.act(np.array([shape.lever, 0.0, 0.0])) == pytest.approx(rod_eye, abs=1e-9)


def test_limits_are_the_linkages_and_every_mass_is_drawn() -> None:
    low, high = MODEL.lowerPositionLimit, MODEL.upperPositionLimit
    for n, of in enumerate(MECHANICS.reaches, start=1):
        at = MODEL.idx_qs[MODEL.getJointId(f"joint{n}")]
        assert (low[at], high[at]) == pytest.approx((of.angle_low, of.angle_high))
    links = ET.fromstring(TEXT).findall("link")  # noqa: S314 (our own text)
    assert all((x.find("inertial") is None) == (x.find("visual") is None) for x in links)

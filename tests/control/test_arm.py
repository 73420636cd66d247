"""The arm's picture against plain rotations and beams, the inverse kinematics against both."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from emir_common.quantity import ParameterError
from emir_control.arm import GRAVITY, Arm, ArmParameters
from emir_control.inverse import Ranges, ReachError, follow

SPRING = 1.839e8  # N m/rad
RIGID = Arm(
    ArmParameters(height=2.5, arm_length=4.5, arm_mass=1000.0, section_spring=SPRING, sag=0)
)
BENT = Arm(ArmParameters(height=2.5, arm_length=4.5, arm_mass=1000.0, section_spring=SPRING))
START = np.radians([0.0, 45.0, -10.0, -10.0, -15.0, -15.0])
RANGES = Ranges(
    np.array([-np.pi, 0.0, -1.07, -1.07, -1.07, -1.07]),
    np.array([np.pi, 1.68, 0.97, 1.27, 1.33, 1.58]),
)


def _by_rotations(joints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rigid TCP's position and axes: one rotation after the other."""
    turn, place = Rotation.from_euler("z", joints[0]), np.array([0.0, 0.0, 2.5])
    for angle in joints[1:]:
        turn *= Rotation.from_rotvec([0.0, -angle, 0.0])
        place = place + turn.apply([4.5, 0.0, 0.0])
    return place, turn.as_matrix()


def _postures() -> np.ndarray:
    share = np.random.default_rng(0).uniform(0.1, 0.9, (20, 6))
    return RANGES.low + share * (RANGES.high - RANGES.low)


def test_rigid_arm_is_a_product_of_rotations() -> None:
    for joints in _postures():
        x, y, z, pitch = RIGID.tcp(joints)
        place, axes = _by_rotations(joints)
        assert np.array([x, y, z]) == pytest.approx(place, abs=1e-12)
        ahead = [
            np.cos(joints[0]) * np.cos(pitch), np.sin(joints[0]) * np.cos(pitch), np.sin(pitch)
        ]  # fmt: skip
        assert axes[:, 0] == pytest.approx(ahead, abs=1e-12)


@pytest.mark.parametrize("arm", [RIGID, BENT], ids=["rigid", "bent"])
def test_jacobian_is_the_slope(arm: Arm) -> None:
    """Exact for the rigid arm; the bent one's leaves out how the bending changes."""
    step, exact = 1e-6, 1e-8 if arm is RIGID else 0.04 * 22.5
    for joints in _postures():
        slope = arm.jacobian(joints)
        for k, unit in enumerate(np.eye(6)):
            ahead, behind = arm.tcp(joints + step * unit), arm.tcp(joints - step * unit)
            assert slope[:, k] == pytest.approx((ahead - behind) / (2.0 * step), abs=exact)


def test_payload_alone_bends_each_spring_by_its_moment() -> None:
    """Stretched and level, small: the tip sinks by the sum of m g x^2 / k over the cuts."""
    arm = Arm(
        ArmParameters(height=0.0, arm_length=4.5, arm_mass=0.0, section_spring=1e11, payload=100.0)
    )
    ways = [22.5 - (4.5 * a + 1.125 * c) for a in range(5) for c in range(1, 4)]
    expected = -sum(100.0 * GRAVITY * way**2 / 1e11 for way in ways)
    assert arm.tcp(np.zeros(6))[2] == pytest.approx(expected, rel=1e-6)


def test_weight_sags_as_a_cantilever_of_the_same_stiffness() -> None:
    """Sections so many that the springs act as a beam of E I = k l: q L^4 / (8 E I)."""
    n, k = 200, 1e12
    arm = Arm(
        ArmParameters(height=0.0, arm_length=4.5, arm_mass=1000.0, sections=n, section_spring=k)
    )
    stiffness = k * 4.5 / (n - 1)
    expected = -(1000.0 / 4.5) * GRAVITY * 22.5**4 / (8.0 * stiffness)
    assert arm.tcp(np.zeros(6))[2] == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("goal", [(18.0, 3.0, 8.5, -0.1), (12.0, -6.0, 4.0, -0.6)])
@pytest.mark.parametrize("arm", [RIGID, BENT], ids=["rigid", "bent"])
def test_joints_follow_a_straight_line(arm: Arm, goal: tuple[float, ...]) -> None:
    share = np.linspace(0.0, 1.0, 101)[1:, np.newaxis]
    places = arm.tcp(START) + share * (np.array(goal) - arm.tcp(START))
    joints = follow(arm, RANGES, START, places)
    assert np.abs(np.diff(np.vstack((START, joints)), axis=0)).max() < 0.03  # no jump
    assert (np.abs(RANGES.share(joints)) < 1.0).all()
    for found, wanted in zip(joints, places, strict=True):
        if arm is RIGID:  # by another forward kinematics than the one inverted
            place, axes = _by_rotations(found)
            assert place == pytest.approx(wanted[:3], abs=1e-8)
            assert np.arcsin(axes[2, 0]) == pytest.approx(wanted[3], abs=1e-8)
        else:
            assert arm.tcp(found) == pytest.approx(wanted, abs=1e-8)


def test_free_motion_keeps_off_the_ends_of_the_ranges() -> None:
    """A way on which plain least motion would drive joint 4 through its end."""
    goal, share = np.array([10.0, 0.0, 0.0, -1.2]), np.linspace(0.0, 1.0, 101)[1:, np.newaxis]
    start = np.radians([0.0, 60.0, -20.0, -20.0, -25.0, -25.0])
    begin = RIGID.tcp(start)
    joints, plain = follow(RIGID, RANGES, start, begin + share * (goal - begin)), start
    assert np.abs(RANGES.share(joints)).max() < 1.0
    for _ in range(100):
        slope = RIGID.jacobian(plain)
        plain = plain + np.linalg.pinv(slope) @ ((goal - begin) / 100.0)
    assert np.abs(RANGES.share(plain)).max() > 1.0


def test_what_is_out_of_reach_is_said_in_one_line() -> None:
    far = RIGID.tcp(START) + np.linspace(0.0, 1.0, 50)[1:, np.newaxis] * np.array([9.0, 0, 0, 0])
    with pytest.raises(ReachError, match=r"the arm does not reach x 2\d\.\d\d m"):
        follow(RIGID, RANGES, START, far)
    low, high = RANGES.low.copy(), RANGES.high.copy()
    low[5] = -0.3
    turned = RIGID.tcp(START) + np.linspace(0.0, 1.0, 50)[1:, np.newaxis] * [0.5, 0.5, 0.0, -1.5]
    high[2:5], low[2:5] = START[2:5] + 0.05, START[2:5] - 0.05
    with pytest.raises(ReachError, match=r"joint\d would be at .* its range is"):
        follow(RIGID, Ranges(low, high), START, turned)
    with pytest.raises(ParameterError, match="section_spring = 1"):
        ArmParameters(height=2.5, arm_length=4.5, arm_mass=1000.0, section_spring=1.0)

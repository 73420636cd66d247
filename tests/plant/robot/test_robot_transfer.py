"""Joint 1's transfer functions in any posture against the unreduced robot and joint 1's model."""

import math

import numpy as np
import pytest

pytest.importorskip("pinocchio", reason="Pinocchio is missing: pip install 'emir_ros[robot]'")

from emir_common.parameter_tree import with_values
from emir_plant.plant import Plant
from emir_plant.robot import linkage
from emir_plant.robot.dynamics import Mechanics
from emir_plant.robot.posture import rest, weight_stiffness
from emir_plant.robot.sheet import robot
from emir_plant.robot.transfer import joint_mechanics
from emir_plant.transfer import mechanics as chain_mechanics

STRETCHED = np.array([0.0, math.radians(45.0), 0.0, 0.0, 0.0, 0.0])
BENT = np.array([0.0, 0.8, -0.5, 0.4, -0.3, 0.4])
MECHANICS = Mechanics(robot())


@pytest.mark.parametrize("posture", [STRETCHED, BENT])
@pytest.mark.parametrize("payload", [0.0, 700.0])
def test_orders_are_the_papers_in_any_posture(posture: np.ndarray, payload: float) -> None:
    loaded = Mechanics(with_values(robot(), {"main.geometry.payload": payload}))
    function = joint_mechanics(loaded, posture).tip_angle()
    assert function.numerator.size == 8 + 1
    assert function.denominator.size == 10 + 1


@pytest.mark.parametrize("posture", [STRETCHED, BENT])
def test_tip_answers_as_the_unreduced_robots(posture: np.ndarray) -> None:
    """All 91 coordinates left by the locked joints, solved at each frequency."""
    held, t = rest(MECHANICS, posture), MECHANICS.topology
    q, first = held.coordinates, t.joints[1]
    stiffness = MECHANICS.stiffness + weight_stiffness(MECHANICS, q)
    slope = linkage.ratio_slope(posture[1], MECHANICS.linkages[0])
    stiffness[first, first] -= held.forces[0] * slope
    free = np.setdiff1d(np.arange(q.size), np.delete(t.joints, 1))
    block, load, tip = np.ix_(free, free), np.zeros(q.size), np.zeros(q.size)
    load[first] = linkage.ratio(posture[1], MECHANICS.linkages[0])
    tip[first], tip[t.cuts[:, 4]] = 1.0, -1.0
    function = joint_mechanics(MECHANICS, posture).tip_angle()
    for hertz in (0.2, 0.7, 2.0, 4.0, 8.0):
        s = 2j * math.pi * hertz
        whole = stiffness + s * MECHANICS.damping + s * s * MECHANICS.mass(q)
        exact = tip[free] @ np.linalg.solve(whole[block], load[free])
        assert function(s) == pytest.approx(exact, rel=0.05)


def test_stretched_robot_has_joint_1s_own_functions() -> None:
    """Up to the dominant 0.7 Hz; above, the modes' own small differences come out."""
    ours = joint_mechanics(MECHANICS, STRETCHED)
    chain = chain_mechanics(Plant(robot().main), STRETCHED[1])
    for hertz in (0.1, 0.3, 0.7):
        s = 2j * math.pi * hertz
        assert abs(ours.tip_angle()(s)) == pytest.approx(abs(chain.tip_angle()(s)), rel=0.03)
        assert abs(ours.stroke()(s)) == pytest.approx(abs(chain.stroke()(s)), rel=0.05)
    frequency = np.sqrt(ours.stiffness[1:4] / chain.stiffness[1:4])
    assert frequency == pytest.approx(1.0, abs=0.14)
    assert frequency[0] == pytest.approx(1.0, abs=0.02)

"""The smallest deflection: against its closed form, against other motions, rest at the end."""

import math

import numpy as np
import pytest
from scipy.signal import lsim

from emir_control.boom import ClampedBoom
from emir_control.least_bending import STEP, Motion, NoMotionError, Task, limit

FAST = 50.0  # rad/s, no limit of the joint rate to speak of


def _boom(*hertz: float) -> ClampedBoom:
    """Modes that bend by -alpha'' / w^2 each at a constant acceleration, undamped."""
    n = len(hertz)
    squares = (2.0 * math.pi * np.array(hertz)) ** 2
    ones = np.ones(n)
    return ClampedBoom(squares, np.zeros((n, n)), -ones, ones, np.eye(n), np.zeros(n))


def _simulated(boom: ClampedBoom, motion: Motion) -> np.ndarray:
    """The states at the steps' ends by an independent solver, (n + 1, 2 m)."""
    n, system = len(boom.B), (boom.A, boom.B[:, None], np.eye(len(boom.B)))
    held = np.append(motion.acceleration, 0.0)
    time = STEP * np.arange(len(held))
    found = lsim((*system, np.zeros((n, 1))), held, time, interp=False)
    return np.asarray(found[2])


def test_limit_of_a_stiff_boom_is_that_of_full_acceleration_and_braking() -> None:
    """A boom that follows at once bends by a / w^2, and a = 4 turn / T^2 is the least possible."""
    turn, duration, hertz = 0.1, 3.0, 5.0
    found = limit(_boom(hertz), Task(turn, duration, -FAST, FAST))
    least = 4.0 * turn / duration**2 / (2.0 * math.pi * hertz) ** 2
    assert found.largest == pytest.approx(least, rel=0.03)


def test_motion_arrives_and_leaves_nothing_swinging() -> None:
    boom = _boom(1.2, 8.0)
    task = Task(0.1, 3.3, -0.1, 0.1)
    motion = limit(boom, task)
    states = _simulated(boom, motion)
    assert motion.deflection == pytest.approx(states @ boom.C, abs=1e-6)
    assert states[-1] == pytest.approx(np.zeros(4), abs=1e-5)
    turned = STEP * np.sum(0.5 * (motion.rate[1:] + motion.rate[:-1]))
    assert turned == pytest.approx(task.turn, rel=1e-6)
    assert motion.rate[-1] == pytest.approx(0.0, abs=1e-9)
    assert abs(motion.rate).max() <= 0.1 + 1e-9


def test_no_trapezoid_bends_less_than_the_limit() -> None:
    boom = _boom(1.2, 8.0)
    task = Task(0.1, 3.3, -FAST, FAST)
    least = limit(boom, task).largest
    n = task.count
    for ramp in (40, 80, 160):
        rate = np.minimum.reduce(
            [np.arange(n + 1) / ramp, np.arange(n, -1, -1) / ramp, np.ones(n + 1)]
        )
        rate *= task.turn / (STEP * rate.sum())
        motion = Motion(np.diff(rate) / STEP, rate, np.zeros(n + 1))
        assert abs(_simulated(boom, motion) @ boom.C).max() > least


def test_too_far_for_the_joint_rate() -> None:
    with pytest.raises(NoMotionError, match="no motion turns the joint"):
        limit(_boom(1.2), Task(0.5, 1.0, -0.1, 0.1))

"""Holding a reference and following waypoints."""

from collections.abc import Callable

import numpy as np
import pytest

from emir_analysis.node_controls import JOINT1_ANGLE, JOINT1_STROKE
from emir_control.prefilter import PrefilterParameters, joint_angle, piston_stroke
from emir_control.trajectory import Motion, Reference, TrajectoryParameters, named
from emir_control.waypoints import Along, Axis, Followed, WaypointError, Waypoints, curve

NONE = np.empty((0, 0))
BEGIN = [Reference(0.3, 0.0)]
MOVING = [Reference(0.3, 0.02)]


def _points(
    times: list[float],
    strokes: list[float],
    velocities: list[float] | None = None,
    name: str = "cylinder1",
) -> Waypoints:
    rates = NONE if velocities is None else np.array(velocities)[:, np.newaxis]
    return Waypoints([name], np.array(times), np.array(strokes)[:, np.newaxis], rates)


def _followed(points: Waypoints, begin: list[Reference], axis: Axis = JOINT1_STROKE) -> Followed:
    found = curve(points, [axis], begin)
    return Followed(found, Along(float(found.x[-1])))


def _smooth(motion: Motion, start: float = 0.0) -> float:
    """The greatest acceleration, after a check that the velocity is that of the stroke."""
    times = np.linspace(0.0, 4.0, 4001)
    strokes, velocities = np.array([motion.at(t, start) for t in times]).T
    assert np.allclose(np.gradient(strokes, times)[1:-1], velocities[1:-1], atol=3e-5)
    return float(np.abs(np.diff(velocities)).max() / (times[1] - times[0]))


@pytest.mark.parametrize("time", [0.5, 1.3, 2.5, 3.9, 5.0, 10.4])
def test_a_held_move_comes_to_rest_with_its_own_deceleration(time: float) -> None:
    parameters = TrajectoryParameters()
    move = named("lift-lower", parameters)
    held = move.held(time, 0.3)
    assert held.at(0.0) == move.at(time, 0.3)
    slope = parameters.speed / parameters.ramp
    assert _smooth(held) <= slope * (1.0 + 1e-6)
    end = held.at(10.0)
    begin, speed = move.at(time, 0.3)
    assert end.velocity == 0.0
    assert end.stroke == pytest.approx(begin + 0.5 * speed * abs(speed) / slope)
    assert held.held(0.2).at(10.0).stroke == pytest.approx(end.stroke)


@pytest.mark.parametrize("begin", [BEGIN, MOVING])
@pytest.mark.parametrize("velocities", [None, [0.02, 0.01, 0.0]])
def test_waypoints_are_met(begin: list[Reference], velocities: list[float] | None) -> None:
    times, strokes = [1.0, 2.5, 4.0], [0.32, 0.35, 0.36]
    motion = _followed(_points(times, strokes, velocities), begin)
    assert motion.at(0.0) == pytest.approx(begin[0])
    assert [motion.at(t).stroke for t in times] == pytest.approx(strokes, abs=2e-5)
    if velocities:
        found = [motion.at(t).velocity for t in times]
        assert found == pytest.approx(velocities, abs=5e-4)
    assert motion.at(9.0).velocity == 0.0
    assert motion.duration == 4.0
    _smooth(motion)


def test_angles_go_through_the_linkage() -> None:
    linkage = PrefilterParameters()
    begin = [Reference(piston_stroke(0.8, linkage), 0.01)]
    motion = _followed(_points([2.0, 4.0], [0.85, 0.8], name="joint1"), begin, JOINT1_ANGLE)
    assert joint_angle(motion.at(2.0).stroke, linkage) == pytest.approx(0.85, abs=1e-5)
    assert motion.at(0.0).velocity == pytest.approx(0.01, rel=1e-6)


@pytest.mark.parametrize("time", [0.5, 2.0, 3.9])
def test_held_on_its_curve(time: float) -> None:
    motion = _followed(_points([4.0], [0.4]), BEGIN)
    held = motion.held(time)
    assert held.at(0.0) == pytest.approx(motion.at(time))
    _smooth(held)
    assert motion.at(time).stroke < held.at(9.0).stroke <= 0.4
    assert held.at(9.0).velocity == 0.0


def _without_end() -> Waypoints:
    return _points([1.0, 2.0], [0.31, 0.32], [0.01, 0.01])


BAD: dict[str, tuple[Callable[[], Waypoints], str]] = {
    "joint": (lambda: _points([1.0], [0.3], name="elbow"), "joint 'elbow': there are cylinder1"),
    "nobody": (lambda: Waypoints([], np.array([1.0]), NONE, NONE), "names no joint: wanted"),
    "points": (lambda: _points([], []), "has no point to go to"),
    "positions": (
        lambda: Waypoints(["cylinder1"], np.array([1.0, 2.0]), np.ones((1, 1)), NONE),
        "positions: not one for each joint in each point",
    ),
    "velocities": (
        lambda: Waypoints(["cylinder1"], np.array([1.0]), np.ones((1, 1)), np.ones((2, 1))),
        "velocities: not one for each joint in each point, nor none",
    ),
    "nan": (lambda: _points([1.0], [np.nan]), "holds what is not a number"),
    "times": (lambda: _points([1.0, 1.0], [0.3, 0.31]), "time_from_start does not increase"),
    "long": (lambda: _points([2e9], [0.3]), r"takes 2e\+09 s, longer than 300 s"),
    "end": (_without_end, "does not end at rest"),
    "begin": (lambda: _points([0.0, 5.0], [0.35, 0.4]), "begins 0.05 off where cylinder1's"),
    "range": (lambda: _points([30.0], [0.93]), r"cylinder1 leaves its range, 0.05 ... 0.9"),
    "overshoot": (
        lambda: _points([10.0, 20.0, 30.0], [0.89, 0.89, 0.5]), "cylinder1 leaves its range",
    ),
    "speed": (lambda: _points([1.0], [0.4]), "have to move at 0.15 m/s, it can 0.06"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_what_cannot_be_followed_is_said_in_one_line(case: str) -> None:
    make, said = BAD[case]
    with pytest.raises(WaypointError, match=said):
        curve(make(), [JOINT1_STROKE], BEGIN)

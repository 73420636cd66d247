"""Trapezoidal profiles: h_d is the integral of dh_d/dt, the limits hold, it ends at rest."""

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson

from emir_common.quantity import ParameterError
from emir_control.trajectory import (
    TrajectoryInputs,
    TrajectoryParameters,
    TrajectoryState,
    Trapezoid,
    named,
)

CASES = [Trapezoid(0.06375, 0.025, 0.75), Trapezoid(-0.2, 0.05, 0.4), Trapezoid(0.002, 0.025, 0.75)]


@pytest.mark.parametrize("move", CASES)
def test_stroke_is_the_integral_of_the_velocity(move: Trapezoid) -> None:
    time = np.linspace(0.0, move.duration, 20001)
    stroke, velocity = np.array([move.at(t) for t in time]).T
    assert stroke == pytest.approx(cumulative_simpson(velocity, x=time, initial=0.0), abs=1e-9)
    assert stroke[-1] == move.distance
    assert velocity[0] == velocity[-1] == 0.0


@pytest.mark.parametrize("move", CASES)
def test_speed_and_slope_stay_within_their_limits(move: Trapezoid) -> None:
    time = np.linspace(0.0, move.duration, 20001)
    velocity = np.array([move.at(t).velocity for t in time])
    assert np.abs(velocity).max() <= move.speed * (1 + 1e-12)
    slope = np.diff(velocity) / np.diff(time)
    assert np.abs(slope).max() <= move.speed / move.ramp * (1 + 1e-6)


def test_the_papers_move_takes_3_3_s() -> None:
    assert Trapezoid(0.06375, 0.025, 0.75).duration == pytest.approx(3.3)


def test_a_trajectory_starts_where_the_machine_stands_and_comes_back() -> None:
    trajectory = named("lift-lower", TrajectoryParameters())
    inputs = TrajectoryInputs(0.31)
    state = trajectory.initial(inputs)
    strokes = []
    for _ in range(round(trajectory.duration / 0.032) + 1):
        state, reference = trajectory.step(state, TrajectoryInputs(9.9), 0.032)
        strokes.append(reference.stroke)
    assert strokes[0] == 0.31
    assert strokes[-1] == pytest.approx(0.31, abs=1e-12)
    assert max(strokes) == pytest.approx(0.31 + 0.06375, abs=1e-12)
    assert min(strokes) >= 0.31 - 1e-12


def test_the_name_gives_the_direction() -> None:
    p = TrajectoryParameters()
    assert named("lower-lift", p).parameters.distance == -p.distance
    assert named("hold", p).parameters.distance == 0.0
    with pytest.raises(ParameterError, match="there are lift-lower, lower-lift, hold"):
        named("circle", p)


def test_what_is_seen_ahead_is_what_comes() -> None:
    trajectory = named("lower-lift", TrajectoryParameters(delay=0.5, pause=0.5))
    state = trajectory.initial(TrajectoryInputs(0.3))
    seen, came = [], []
    for _ in range(300):
        seen.append(trajectory.ahead(state, 20, 0.032))
        state, reference = trajectory.step(state, TrajectoryInputs(0.3), 0.032)
        came.append(reference.stroke)
    for k, strokes in enumerate(seen[:-20]):
        assert list(strokes) == came[k + 1 : k + 21]


def test_what_is_seen_ahead_is_the_same_where_the_state_keeps_it() -> None:
    trajectory = named("lift-lower", TrajectoryParameters(delay=0.5, pause=0.5))
    inputs = TrajectoryInputs(0.3)
    keeping = trajectory.initial(inputs)
    for ticks in range(300):
        ahead = trajectory.ahead(keeping, 20, 0.032)
        assert ahead == trajectory.ahead(TrajectoryState(0.3, ticks), 20, 0.032)
        keeping, _ = trajectory.step(keeping._replace(ahead=ahead), inputs, 0.032)

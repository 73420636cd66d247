"""Dry friction, however steep, in steps of a millisecond."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from emir_common.parameter_tree import with_values
from emir_plant import core, dry_friction
from emir_plant.core import Truth
from emir_plant.effects import terms
from emir_plant.effects.smooth_sign import smooth_sign
from emir_plant.plant import Plant
from emir_plant.sheet import joint1

FORTY_FIVE = math.radians(45.0)
UNDER_LOAD = terms.Situation(6e5, 0.5)
STROKE = Truth._fields.index("stroke")


def _with_friction(force: float, smoothing_speed: float) -> Plant:
    values = {
        "effects.coulomb_friction.force": force,
        "effects.coulomb_friction.smoothing_speed": smoothing_speed,
    }
    return Plant(with_values(joint1(), values))


@pytest.mark.parametrize("unhindered", [1e-6, 1e-3, 0.05, -1e-6, -0.05])
def test_friction_of_a_step_belongs_to_the_velocity_at_its_end(unhindered: float) -> None:
    p, mobility = _with_friction(2e4, 1e-4).record[0], 2e-7
    friction = dry_friction.at_end(unhindered, mobility, UNDER_LOAD, p)
    end = unhindered - mobility * friction
    assert abs(mobility * (friction - 2e4 * math.tanh(end / 1e-4))) <= 1e-9  # m/s
    assert end * unhindered >= 0.0  # it stops a motion, it does not turn it round


def test_a_piston_that_friction_can_hold_stands() -> None:
    """5 % more pressure than the load needs, 34 kN, against 60 kN of friction, for 10 s.

    It creeps at less than the smoothing speed; without friction it would swing over 1 mm.
    """
    plant = _with_friction(6e4, 1e-5)
    state = plant.initial(FORTY_FIVE, 20e5)
    state[core.P_H] *= 1.05
    run = plant.simulate(state, np.zeros(10_000), 1e-3, 10)
    free = Plant(joint1()).simulate(state, np.zeros(10_000), 1e-3, 10)
    assert np.ptp(run[:, STROKE]) < 10.0 * 1e-5
    assert np.ptp(free[:, STROKE]) > 1e-3


def test_sticking_and_sliding_agree_with_a_stiff_solver(
    stiff_solver: Callable[..., np.ndarray],
) -> None:
    """Lift, stop, lower: slope 2e7 N s/m, where an explicit step of 1 ms chatters."""
    plant, commands = _with_friction(2e4, 1e-3), np.zeros(3000)
    commands[100:1000], commands[1500:2500] = 0.5, -0.5
    start = plant.initial(FORTY_FIVE, 20e5)
    ours = plant.simulate(start, commands, 1e-3)
    exact = np.array([plant.outputs(x) for x in stiff_solver(plant, start, commands, "LSODA")])
    assert np.abs(ours[:, STROKE] - exact[:, STROKE]).max() < 5e-6  # a tenth of a resolver step
    for name in ("pressure_lifting", "pressure_lowering"):
        k = Truth._fields.index(name)
        assert np.abs(ours[:, k] - exact[:, k]).max() < 2e-3 * np.ptp(exact[:, k]), name


def test_stick_and_slip_that_keeps_up_a_bending_mode_agrees_with_a_stiff_solver(
    stiff_solver: Callable[..., np.ndarray],
) -> None:
    """Slow lifting: the piston stops and breaks away with every swing of the 63 Hz mode.

    An error in the instants of sticking adds up over all of them.
    """
    values = {
        "effects.stribeck_friction.force": 2.5e4,
        "effects.stribeck_friction.breakaway": 1.5,
        "effects.stribeck_friction.stribeck_speed": 6e-3,
        "effects.stribeck_friction.smoothing_speed": 2e-4,
    }
    plant, commands = Plant(with_values(joint1(), values)), np.zeros(2500)
    commands[100:] = 0.35
    start = plant.initial(FORTY_FIVE, 20e5)
    ours = plant.simulate(start, commands, 1e-3)
    exact = np.array([plant.outputs(x) for x in stiff_solver(plant, start, commands, "LSODA")])
    velocity = Truth._fields.index("velocity")
    late = exact[1500:, velocity]
    turns = np.count_nonzero(np.diff(np.sign(np.diff(late))))
    assert turns > 2 * 60  # the mode swings on ...
    assert np.ptp(late) > 0.01  # ... and largely
    difference = ours[1500:, velocity] - late
    assert np.sqrt(np.mean(difference**2)) < 0.1 * np.std(late)


def _piston(
    p: Any, velocity: float, acceleration: float, weight: float, swing: float = 0.0
) -> dry_friction.Piston:
    """Return a piston under 600 kN; weight: 1/kg, swing: m/s."""
    friction = terms.dry_friction(velocity, UNDER_LOAD, p)
    return dry_friction.Piston(velocity, acceleration, weight, UNDER_LOAD, friction, swing)


def test_a_step_is_short_only_where_friction_turns_round() -> None:
    p, longest = _with_friction(2e4, 1e-4).record[0], 1e-3
    weight = 1e-4  # 1/kg, of the piston

    def over_step(velocity: float, acceleration: float) -> dry_friction.Friction:
        piston = _piston(p, velocity, acceleration, weight)
        return dry_friction.over_step(piston, longest, longest, longest, p)

    assert over_step(0.02, 1.0) == (longest, pytest.approx(2e4), False)  # sliding
    stuck = over_step(1e-4 * math.atanh(0.5), 1.0)  # creeping
    assert stuck == (longest, pytest.approx(1.0 / weight, rel=1e-3), True)  # it holds the load
    assert over_step(-1e-4, 5.0).step <= dry_friction.SHORTEST * longest


def test_friction_changes_by_no_more_than_a_step_allows() -> None:
    """Random pistons about a break-away, under accelerations that make it stick or let it go."""
    values = {
        "effects.stribeck_friction.force": 2.5e4,
        "effects.stribeck_friction.breakaway": 1.7,
        "effects.stribeck_friction.stribeck_speed": 6e-3,
        "effects.stribeck_friction.smoothing_speed": 4e-4,
    }
    p, random = Plant(with_values(joint1(), values)).record[0], np.random.default_rng(0)
    usual, fine, weight = 1e-3, 2.5e-4, 2e-4
    shortest = dry_friction.SHORTEST * fine
    held = {True: 0, False: 0}
    for _ in range(2000):
        velocity = random.normal(0.0, 1e-3)
        nearly_held = weight * terms.dry_friction(velocity, UNDER_LOAD, p)
        acceleration = nearly_held + random.normal(0.0, 1.0)
        piston = _piston(p, velocity, acceleration, weight)
        step, force, whole = dry_friction.over_step(piston, usual, usual, fine, p)
        if not whole:
            continue
        end = velocity + step * (acceleration - weight * force)
        assert step * weight * abs(force - terms.dry_friction(end, UNDER_LOAD, p)) <= 1e-9  # m/s
        change = step * weight * abs(force - piston.friction)
        held[step > shortest] += 1
        assert step == shortest or change <= 1.001 * dry_friction.CHANGE * fine
        if step < usual:  # and the step twice as long would have changed it by more
            after = dry_friction.at_end(
                velocity + 2.0 * step * acceleration, 2.0 * step * weight, UNDER_LOAD, p
            )
            assert 2.0 * step * weight * abs(after - piston.friction) > dry_friction.CHANGE * fine
    assert min(held.values()) > 100  # both were met


@pytest.mark.parametrize("number", [-1e3, -20.0, -0.5, -1e-9, 0.0, 1e-3, 0.7, 3.0, 18.0, 800.0])
def test_the_smooth_sign_is_the_hyperbolic_tangent(number: float) -> None:
    assert abs(smooth_sign(number, 0.0) - math.tanh(number)) <= 2.3e-16


@pytest.mark.parametrize("number", [-30.0, -0.5, 0.0, 1e-3, 4.0, 800.0])
def test_the_gradual_sign_is_the_sine_of_the_arc_tangent(number: float) -> None:
    assert smooth_sign(number, 1.0) == pytest.approx(math.sin(math.atan(number)), abs=1e-15)
    middle = 0.5 * (math.tanh(number) + math.sin(math.atan(number)))
    assert smooth_sign(number, 0.5) == pytest.approx(middle, abs=1e-15)


def test_a_swing_is_followed_finely_only_where_it_reaches_standstill() -> None:
    p, usual, fine, swing = _with_friction(2e4, 1e-4).record[0], 1e-3, 2.5e-4, 5e-3

    def step(velocity: float, swing: float) -> float:
        piston = _piston(p, velocity, 0.1, 1e-4, swing)
        return dry_friction.over_step(piston, usual, usual, fine, p).step

    assert step(0.02, 0.0) == usual
    assert fine < step(0.02, swing) < usual
    assert step(0.02, 4.0 * swing) <= fine
    assert step(-0.02, 4.0 * swing) <= fine


def test_without_friction_nothing_changes() -> None:
    p = Plant(joint1()).record[0]
    piston = _piston(p, 0.01, 20.0, 1e-4)
    assert dry_friction.over_step(piston, 1e-3, 1e-3, 1e-3, p) == (1e-3, 0.0, False)

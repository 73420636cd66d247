"""A force that has no name, as a curve: beside another spline and beside effects that have one."""

import math

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from emir_common.parameter_tree import with_values
from emir_common.quantity import ParameterError
from emir_plant import core
from emir_plant.core import Truth
from emir_plant.curve import POINTS
from emir_plant.plant import Plant
from emir_plant.robot.actuators import machines
from emir_plant.robot.sheet import robot
from emir_plant.sheet import data, joint1, load_sheet
from emir_plant.unnamed.force import STROKE, VELOCITY

FORTY_FIVE = math.radians(45.0)
T = {name: k for k, name in enumerate(Truth._fields)}
STATED = data("joint1.yaml")


def _plant(over: int, ends: tuple[float, float], **curves: list[float]) -> Plant:
    values: dict[str, object] = {f"unnamed_force.{form}": points for form, points in curves.items()}
    values |= {
        "unnamed_force.over": over,
        "unnamed_force.first": ends[0],
        "unnamed_force.last": ends[1],
    }
    return Plant(with_values(joint1(), values))


def _with(**values: float) -> Plant:
    paths = {f"effects.{name.replace('__', '.')}": value for name, value in values.items()}
    return Plant(with_values(joint1(), paths))


def _run(plant: Plant) -> np.ndarray:
    """Lift, rest, lower: (n, 12)."""
    commands = np.zeros(4000)
    commands[100:1500], commands[2000:3500] = 0.5, -0.5
    return plant.simulate(plant.initial(FORTY_FIVE, 25e5), commands, 1e-3)


def test_between_its_points_a_is_the_cubic_of_its_chords() -> None:
    """The pressure at rest, where the oil carries what the curve does not."""
    points = np.random.default_rng(0).uniform(-5e4, 5e4, POINTS)
    ends = (0.2, 0.7)
    at = np.linspace(*ends, POINTS)
    beyond = np.concatenate(
        [[2.0 * points[0] - points[1]], points, [2.0 * points[-1] - points[-2]]]
    )
    slopes = (beyond[2:] - beyond[:-2]) / (2.0 * (at[1] - at[0]))
    spline = CubicHermiteSpline(at, points, slopes)
    plain, plant = Plant(joint1()), _plant(STROKE, ends, along=points.tolist())
    for angle in np.radians(np.linspace(12.0, 75.0, 50)):
        carried = plain.initial(angle)[core.P_H] - plant.initial(angle)[core.P_H]
        force = carried * joint1().cylinder.area_lifting
        stroke = plain.outputs(plain.initial(angle)).stroke
        expected = float(spline(min(max(stroke, ends[0]), ends[1])))
        assert force == pytest.approx(expected, abs=1e-6 * 5e4)


def test_a_at_rest_leaves_the_boom_at_rest() -> None:
    plant = _plant(STROKE, (0.2, 0.7), along=[2e4] * POINTS, friction=[3e4] * POINTS)
    run = plant.simulate(plant.initial(FORTY_FIVE, 25e5), np.zeros(3000), 1e-3)
    assert np.ptp(run[:, T["stroke"]]) < 1e-9


def test_the_same_friction_everywhere_is_coulombs() -> None:
    ours = _plant(STROKE, (0.2, 0.7), friction=[2e4] * POINTS)
    theirs = _with(coulomb_friction__force=2e4)  # its v_0 is the curve's
    assert _run(ours) == pytest.approx(_run(theirs), rel=1e-9, abs=1e-9)


def test_a_straight_line_over_the_velocity_is_viscous_friction() -> None:
    ends = (-0.2, 0.2)
    ours = _plant(VELOCITY, ends, along=(-1e5 * np.linspace(*ends, POINTS)).tolist())
    # and a trace of dry friction, for which steps are as for a curve
    theirs = _run(_with(viscous_friction__coefficient=1e5, coulomb_friction__force=1e-9))
    assert (np.abs(_run(ours) - theirs).max(axis=0) <= 1e-9 * np.ptp(theirs, axis=0)).all()


def test_a_force_over_the_stroke_gives_back_what_it_takes() -> None:
    """Its work from rest to rest is what the potential says, and what friction takes is more."""
    ends = (0.2, 0.7)
    at = np.linspace(*ends, POINTS)
    plant = _plant(STROKE, ends, along=(3e4 * np.sin(9.0 * at)).tolist())
    run = _run(plant)
    strokes = run[:, T["stroke"]]
    force = CubicHermiteSpline(at, 3e4 * np.sin(9.0 * at), 27e4 * np.cos(9.0 * at))
    potential = force.antiderivative()
    work = np.trapezoid(force(strokes), strokes)
    assert work == pytest.approx(potential(strokes[-1]) - potential(strokes[0]), abs=1.0)  # J
    # and the machine felt it: the oil's force differs by it where nothing is accelerated
    plain = _run(Plant(joint1()))
    rest = slice(1990, 2000)
    felt = plain[rest, T["force"]].mean() - run[rest, T["force"]].mean()
    assert abs(felt) > 5e3


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{friction: [1.0, 2.0]}", f"not a list of {POINTS} numbers"),
        ("{friction: 1.0}", f"not a list of {POINTS} numbers"),
        (f"{{friction: {[-1.0] * POINTS}}}", r"friction.0 = -1: outside 0 ... "),
        (f"{{along: {['soft'] * POINTS}}}", r"along.0 = 'soft': not a number"),
        ("{over: 3}", r"over = 3: outside 0 ... 2"),
    ],
)
def test_a_bad_is_told_in_one_line(
    text: str, said: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    file = tmp_path_factory.mktemp("machine") / "machine.yaml"
    file.write_text(f"based_on: {STATED}\nunnamed_force: {text}\n")
    with pytest.raises(ParameterError, match=said) as error:
        load_sheet(file)
    assert "\n" not in str(error.value)


def test_a_point_of_a_is_set_by_its_place() -> None:
    machine = with_values(joint1(), {"unnamed_force.friction.3": 5.0})
    assert machine.unnamed_force.friction[2:5] == (0.0, 5.0, 0.0)
    for place in (str(POINTS), "-1", "first"):
        with pytest.raises(ParameterError, match=f"friction.{place}: there is no such"):
            with_values(joint1(), {f"unnamed_force.friction.{place}": 5.0})


def test_the_whole_robot_says_that_it_has_none(tmp_path_factory: pytest.TempPathFactory) -> None:
    pytest.importorskip("pinocchio")
    file = tmp_path_factory.mktemp("machine") / "machine.yaml"
    file.write_text(f"based_on: {STATED}\nunnamed_force: {{over: 1}}\n")
    known = robot(None, file)
    with pytest.raises(ParameterError, match="unnamed_force: not in the model of the whole robot"):
        machines(known, ())

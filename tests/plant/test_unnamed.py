"""What has no name, as curves: beside another spline and beside effects that have a name."""

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
from emir_plant.unnamed import UNNAMED, compliance, force, leakage, load, opening

FORTY_FIVE = math.radians(45.0)
T = {name: k for k, name in enumerate(Truth._fields)}
STATED = data("joint1.yaml")


def _plant(
    over: int, ends: tuple[float, float], group: str = "force", **curves: list[float]
) -> Plant:
    values = curves | {"over": over, "first": ends[0], "last": ends[1]}
    paths = {f"unnamed_{group}.{name}": value for name, value in values.items()}
    return Plant(with_values(joint1(), paths))


def _with(**values: float) -> Plant:
    paths = {f"effects.{name.replace('__', '.')}": value for name, value in values.items()}
    return Plant(with_values(joint1(), paths))


def _run(plant: Plant) -> np.ndarray:
    """Lift, rest, lower: (n, 12)."""
    commands = np.zeros(4000)
    commands[100:1500], commands[2000:3500] = 0.5, -0.5
    return plant.simulate(plant.initial(FORTY_FIVE, 25e5), commands, 1e-3)


def test_between_its_points_a_curve_is_the_cubic_of_its_chords() -> None:
    """The pressure at rest, where the oil carries what the curve does not."""
    points = np.random.default_rng(0).uniform(-5e4, 5e4, POINTS)
    ends = (0.2, 0.7)
    at = np.linspace(*ends, POINTS)
    beyond = np.concatenate(
        [[2.0 * points[0] - points[1]], points, [2.0 * points[-1] - points[-2]]]
    )
    slopes = (beyond[2:] - beyond[:-2]) / (2.0 * (at[1] - at[0]))
    spline = CubicHermiteSpline(at, points, slopes)
    plain, plant = Plant(joint1()), _plant(force.STROKE, ends, along=points.tolist())
    for angle in np.radians(np.linspace(12.0, 75.0, 50)):
        carried = plain.initial(angle)[core.P_H] - plant.initial(angle)[core.P_H]
        given = carried * joint1().cylinder.area_lifting
        stroke = plain.outputs(plain.initial(angle)).stroke
        expected = float(spline(min(max(stroke, ends[0]), ends[1])))
        assert given == pytest.approx(expected, abs=1e-6 * 5e4)


def test_a_curve_at_rest_leaves_the_boom_at_rest() -> None:
    plant = _plant(force.STROKE, (0.2, 0.7), along=[2e4] * POINTS, friction=[3e4] * POINTS)
    run = plant.simulate(plant.initial(FORTY_FIVE, 25e5), np.zeros(3000), 1e-3)
    assert np.ptp(run[:, T["stroke"]]) < 1e-9


def test_the_same_friction_everywhere_is_coulombs() -> None:
    ours = _plant(force.STROKE, (0.2, 0.7), friction=[2e4] * POINTS)
    theirs = _with(coulomb_friction__force=2e4)  # its v_0 is the curve's
    assert _run(ours) == pytest.approx(_run(theirs), rel=1e-9, abs=1e-9)


def test_a_straight_line_over_the_velocity_is_viscous_friction() -> None:
    ends = (-0.01, 0.02)  # and straight on beyond, where the piston goes
    ours = _plant(force.VELOCITY, ends, along=(-1e5 * np.linspace(*ends, POINTS)).tolist())
    # and a trace of dry friction, for which steps are as for a curve
    theirs = _run(_with(viscous_friction__coefficient=1e5, coulomb_friction__force=1e-9))
    assert np.ptp(theirs[:, T["velocity"]]) > 2.0 * (ends[1] - ends[0])
    assert (np.abs(_run(ours) - theirs).max(axis=0) <= 1e-9 * np.ptp(theirs, axis=0)).all()


def test_a_force_over_the_stroke_gives_back_what_it_takes() -> None:
    """Its work from rest to rest is what the potential says, and what friction takes is more."""
    ends = (0.2, 0.7)
    at = np.linspace(*ends, POINTS)
    plant = _plant(force.STROKE, ends, along=(3e4 * np.sin(9.0 * at)).tolist())
    run = _run(plant)
    strokes = run[:, T["stroke"]]
    spline = CubicHermiteSpline(at, 3e4 * np.sin(9.0 * at), 27e4 * np.cos(9.0 * at))
    potential = spline.antiderivative()
    work = np.trapezoid(spline(strokes), strokes)
    assert work == pytest.approx(potential(strokes[-1]) - potential(strokes[0]), abs=1.0)  # J
    # and the machine felt it: the oil's force differs by it where nothing is accelerated
    plain = _run(Plant(joint1()))
    rest = slice(1990, 2000)
    felt = plain[rest, T["force"]].mean() - run[rest, T["force"]].mean()
    assert abs(felt) > 5e3


@pytest.mark.parametrize("over", [force.STROKE, opening.OPENING])
def test_the_same_change_of_the_opening_everywhere_is_a_gain_of_the_valve(over: int) -> None:
    ours = _plant(over, (-1.0, 1.0), "opening", change=[0.2] * POINTS)
    theirs = _with(valve_gain_asymmetry__lifting=0.2, valve_gain_asymmetry__lowering=0.2)
    assert _run(ours) == pytest.approx(_run(theirs), rel=1e-9, abs=1e-9)


def test_edges_that_stay_shut_beyond_a_stroke_end_the_motion_there() -> None:
    at = np.linspace(0.4, 0.6, POINTS)
    plant = _plant(opening.STROKE, (0.4, 0.6), "opening", change=(-1.0 * (at > 0.53)).tolist())
    commands = np.full(8000, 0.6)
    run = plant.simulate(plant.initial(FORTY_FIVE, 25e5), commands, 1e-3)
    late = run[-2000:, T["stroke"]]
    assert np.mean(late) == pytest.approx(0.53, abs=0.01)
    assert run[0, T["stroke"]] < 0.5
    free = Plant(joint1()).simulate(plant.initial(FORTY_FIVE, 25e5), commands, 1e-3)
    assert free[-1, T["stroke"]] > 0.6


def test_a_straight_line_over_the_pressure_is_a_laminar_leak() -> None:
    pressures = np.linspace(0.0, 3e7, POINTS)
    flow = (2e-12 * (pressures - joint1().supply.pT)).tolist()
    none = [0.0] * POINTS
    for ours, size in (
        ({"lifting": flow, "lowering": none}, "lifting"),
        ({"lifting": none, "lowering": flow}, "lowering"),
    ):
        curve = _plant(leakage.PRESSURE, (0.0, 3e7), "leakage", **ours)
        theirs = _run(_with(**{f"external_leakage__{size}": 2e-12}))
        assert (np.abs(_run(curve) - theirs).max(axis=0) <= 1e-9 * np.ptp(theirs, axis=0)).all()


def test_a_straight_line_over_the_difference_is_a_leak_past_the_piston() -> None:
    ends = (0.0, 1e7)
    flow = (3e-12 * np.linspace(*ends, POINTS)).tolist()
    ours = _run(_plant(leakage.DIFFERENCE, ends, "leakage", across=flow))
    theirs = _run(_with(internal_leakage__coefficient=3e-12))
    assert (np.abs(ours - theirs).max(axis=0) <= 1e-9 * np.ptp(theirs, axis=0)).all()


def test_the_same_compliance_at_all_pressures_is_that_of_a_vessel() -> None:
    ours = _plant(
        compliance.PRESSURE, (0.0, 2e7), "compliance",
        lifting=[1e-11] * POINTS, lowering=[2e-11] * POINTS,
    )  # fmt: skip
    theirs = _with(vessel_compliance__lifting=1e-11, vessel_compliance__lowering=2e-11)
    assert _run(ours) == pytest.approx(_run(theirs), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{friction: [1.0, 2.0]}", f"not a list of {POINTS} numbers"),
        ("{friction: 1.0}", f"not a list of {POINTS} numbers"),
        (f"{{friction: {[-1.0] * POINTS}}}", r"friction.0 = -1: outside 0 ... "),
        (f"{{along: {['soft'] * POINTS}}}", r"along.0 = 'soft': not a number"),
        ("{over: 1, first: 0.5, last: 0.5}", r"unnamed_force.last = 0.5: not above"),
        ("{over: 3}", r"unnamed_force.over = 3: outside 0 ... 2"),
    ],
)
def test_a_bad_curve_is_told_in_one_line(
    text: str, said: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    file = tmp_path_factory.mktemp("machine") / "machine.yaml"
    file.write_text(f"based_on: {STATED}\nunnamed_force: {text}\n")
    with pytest.raises(ParameterError, match=said) as error:
        load_sheet(file)
    assert "\n" not in str(error.value)


def test_a_point_of_a_curve_is_set_by_its_place() -> None:
    machine = with_values(joint1(), {"unnamed_force.friction.3": 5.0})
    assert machine.unnamed_force.friction[2:5] == (0.0, 5.0, 0.0)
    for place in (str(POINTS), "-1", "first"):
        with pytest.raises(ParameterError, match=f"friction.{place}: there is no such"):
            with_values(joint1(), {f"unnamed_force.friction.{place}": 5.0})


@pytest.mark.parametrize("group", UNNAMED)
def test_the_whole_robot_says_that_it_has_none(
    group: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    pytest.importorskip("pinocchio")
    file = tmp_path_factory.mktemp("machine") / "machine.yaml"
    file.write_text(f"based_on: {STATED}\n{group}: {{over: 1}}\n")
    known = robot(None, file)
    with pytest.raises(ParameterError, match=f"{group}: not in the model of the whole robot"):
        machines(known, ())


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_a_course_that_is_constant_is_a_load_with_a_formula(share: float) -> None:
    ours = _plant(load.TIME, (0.0, 4.0), "load", course=[2e3] * load.COURSE)
    ours = Plant(with_values(ours.machine, {"unnamed_load.joint_share": share}))
    known = _with(external_load__force=2e3, external_load__joint_share=share)
    assert np.allclose(_run(ours), _run(known), rtol=1e-9, atol=1e-9)


def test_a_course_through_points_of_a_swing_is_that_swing() -> None:
    """Between them a cubic: of a swing of 0.5 Hz, 45 points in a period, 1e-4 of its size."""
    time = np.linspace(0.0, 8.0, load.COURSE)
    swing = 2e3 * np.cos(2.0 * np.pi * 0.5 * time)
    ours = _run(_plant(load.TIME, (0.0, 8.0), "load", course=swing.tolist()))
    known = _run(_with(external_load__force=2e3, external_load__frequency=0.5))
    none = _run(Plant(joint1()))
    for name in ("stroke", "pressure_lifting", "tip_angle"):
        moved = np.std(known[:, T[name]] - none[:, T[name]])
        assert np.std(ours[:, T[name]] - known[:, T[name]]) < 1e-3 * moved

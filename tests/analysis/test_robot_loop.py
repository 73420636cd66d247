"""The whole robot under control, in a plain loop: joint 1 alone, and the TCP along a line."""

import dataclasses
from functools import cache

import numpy as np
import pytest

pytest.importorskip("pinocchio", reason="Pinocchio is missing: pip install 'emir_ros[robot]'")

from emir_analysis.robot_controls import (
    RobotCascadeControl,
    RobotForceLoopControl,
    RobotPfcControl,
    RobotTrajectoryControl,
)
from emir_analysis.robot_machine import RobotLoop
from emir_analysis.robot_setup import (
    Posture,
    cascade_parameters,
    force_loops,
    path_parameters,
    pfc_parameters,
    trajectory,
)
from emir_common.parameter_tree import with_values
from emir_control.arm import Arm
from emir_control.cascade import Cascade
from emir_control.pfc import Pfc
from emir_control.robot_trajectory import RobotTrajectoryInputs
from emir_control.trajectory import TrajectoryParameters
from emir_msgs_py.robot_topics import JOINTS, ROBOT_PFC_TERMS, ROBOT_TOPICS
from emir_plant.robot.plant import RobotPlant
from emir_plant.robot.posture import rest, rigid
from emir_plant.robot.reach import PostureError
from emir_plant.robot.sheet import robot

ROBOT = robot()
PLANT = RobotPlant(ROBOT)
START = Posture().angles
PATH = path_parameters(ROBOT)
MOVE = TrajectoryParameters(pause=6.0)
PERIOD = 0.032


def _loop(name: str, *, sag: bool = True, **values: float) -> RobotLoop:
    path = with_values(PATH, {"arm.sag": int(sag), **values})
    planned = RobotTrajectoryControl(trajectory(ROBOT, name, MOVE, path))
    inner = RobotForceLoopControl(force_loops(ROBOT))
    return RobotLoop(PLANT, [planned, RobotCascadeControl(Cascade(cascade_parameters())), inner])


@cache
def _line(sag: bool) -> dict[str, np.ndarray]:  # noqa: FBT001 (one of two runs)
    """Along the default line until 6 s after the stop."""
    loop = _loop("line", sag=sag)
    control = loop.controls[0]
    assert isinstance(control, RobotTrajectoryControl)
    planned = control.trajectory.initial(RobotTrajectoryInputs(START))
    stop = planned.timing.duration / 2.0 + MOVE.delay / 2.0
    return loop.run(START, 2e6, stop)


def _places(signals: dict[str, np.ndarray], name: str) -> np.ndarray:
    return np.stack([signals[f"{name}_{axis}"] for axis in "xyz"], axis=1)


def _end_error(signals: dict[str, np.ndarray]) -> np.ndarray:
    """Return the TCP's place less the goal, mean of the last second, (3,) m."""
    goal = PATH.line.place[:3]
    return (_places(signals, "tcp")[-125:] - goal).mean(axis=0)


def test_picture_of_the_arm_is_the_robots() -> None:
    """Rigid it has Pinocchio's TCP; bent it misses by 3 % of the sag, 6 mm."""
    stiff = Arm(dataclasses.replace(PATH.arm, sag=0))
    for joints in (START, np.radians([30.0, 60.0, -20.0, -20.0, -25.0, -25.0])):
        position, axes = PLANT.mechanics.tcp(rigid(PLANT.mechanics, joints))
        assert stiff.tcp(joints)[:3] == pytest.approx(position, abs=1e-9)
        assert np.sin(stiff.tcp(joints)[3]) == pytest.approx(axes[2, 0], abs=1e-9)
        bent, axes = PLANT.mechanics.tcp(rest(PLANT.mechanics, joints).coordinates)
        sag = np.linalg.norm(bent - position)
        assert np.linalg.norm(Arm(PATH.arm).tcp(joints)[:3] - bent) < 0.03 * sag
        assert Arm(PATH.arm).tcp(joints)[3] == pytest.approx(np.arcsin(axes[2, 0]), abs=4e-4)


def test_line_ends_at_its_goal_once_the_sag_is_compensated() -> None:
    """The rest is the resolvers' step, 1.5 mrad, and the valves' standstill."""
    with_it, without = _end_error(_line(sag=True)), _end_error(_line(sag=False))
    sag = PLANT.mechanics.tcp(rest(PLANT.mechanics, START).coordinates)[0][2]
    sag -= PLANT.mechanics.tcp(rigid(PLANT.mechanics, START))[0][2]
    assert without[2] == pytest.approx(sag, abs=0.04)  # it hangs by what bends it
    assert np.linalg.norm(with_it) < 0.04
    assert np.linalg.norm(with_it) < 0.25 * np.linalg.norm(without)


def test_tcp_stays_by_the_line_and_keeps_its_orientation() -> None:
    signals = _line(sag=True)
    places, reference = _places(signals, "tcp"), _places(signals, "tcp_reference")
    along = reference[-1] - reference[0]
    length = np.linalg.norm(along)
    assert length > 4.0
    off = places - reference[0]
    across = np.linalg.norm(np.cross(off, along / length), axis=1)
    assert across.max() < 0.025  # a step of joint 1's resolver is 3 cm here
    assert np.linalg.norm(places[::4] - reference, axis=1).max() < 0.04  # no lag to speak of
    assert np.abs(off @ along / length).max() < length + 0.05  # no overshoot to speak of
    turn = signals["tcp_qy"][::4] - signals["tcp_reference_qy"]
    assert np.abs(turn).max() < 2e-3  # of half the pitch, rad


def test_expected_forces_are_the_robots() -> None:
    """At rest, within what the linkages' own masses make; the payload is read off them."""
    for payload in (0.0, 1500.0):
        sheet = with_values(ROBOT, {"main.geometry.payload": payload})
        held = rest(RobotPlant(sheet).mechanics, START)
        planned = trajectory(sheet, "line", MOVE, with_values(PATH, {"supply": 5e7}))
        forces = np.append(held.torques[0], held.forces)
        state = planned.initial(RobotTrajectoryInputs(START, forces))
        assert state.arm.parameters.payload == pytest.approx(payload, abs=20.0)
        _, first = planned.step(state, RobotTrajectoryInputs(START), PERIOD)
        assert first.forces[1:] == pytest.approx(held.forces, rel=0.06)
        assert abs(first.forces[0]) < 1.0  # the base carries nothing


def test_measurements_that_are_no_numbers_begin_no_motion() -> None:
    control = _loop("line").controls[0]
    good = {f"{joint}_angle": a for joint, a in zip(JOINTS, START, strict=True)}
    good |= {f"{joint}_force": 0.0 for joint in JOINTS}
    state, shown = control.step(None, good | {"joint2_force": np.nan}, PERIOD)
    assert state is None
    assert all(np.isnan(value) for value in shown.values())
    assert control.step(state, good, PERIOD)[0] is not None


def test_reference_is_straight_and_every_joint_moves() -> None:
    signals = _line(sag=True)
    reference = _places(signals, "tcp_reference")
    along = (reference[-1] - reference[0]) / np.linalg.norm(reference[-1] - reference[0])
    assert np.abs(np.cross(reference - reference[0], along)).max() < 1e-6
    for joint in JOINTS:
        stroke = signals[f"{joint}_reference_stroke"]
        assert np.ptp(stroke) > 0.01, joint
        speed = np.gradient(stroke, PERIOD)
        assert signals[f"{joint}_reference_velocity"] == pytest.approx(speed, abs=1.5e-3), joint


@pytest.mark.parametrize("number", range(6), ids=JOINTS)
def test_a_joint_moves_alone_and_the_others_hold(number: int) -> None:
    """63.75 mm within 1.5 mm (of the base 64 mrad within 3 mrad) all the way, the others 1.5 mm."""
    signals = _loop("lift-lower", joint=number).run(START, 2e6, 5.0)
    moved = JOINTS[number]
    assert np.ptp(signals[f"{moved}_reference_stroke"]) == pytest.approx(0.06375, abs=1e-9)
    off = signals[f"{moved}_true_stroke"][::4] - signals[f"{moved}_reference_stroke"]
    assert np.abs(off).max() < (3e-3 if moved == "base" else 1.5e-3)
    for joint in set(JOINTS) - {moved}:
        stroke = signals[f"{joint}_true_stroke"]
        assert np.abs(stroke - stroke[0]).max() < 1.5e-3, joint
    assert signals["supply_pressure"].min() > 0.95 * ROBOT.main.supply.p0  # one pump for all
    there = [topic for topic in ROBOT_TOPICS if topic is not ROBOT_PFC_TERMS]
    assert signals.keys() == {name for topic in there for name in topic.fields}


def test_predictive_control_of_all_joints_moves_one_and_holds_the_others() -> None:
    """With the set point known ahead it rounds the ramps off, by 5 mm, and ends where it should."""
    planned, _, inner = _loop("lift-lower").controls
    loop = RobotLoop(PLANT, [planned, RobotPfcControl(Pfc(pfc_parameters())), inner])
    signals = loop.run(START, 2e6, 8.0)
    off = {j: signals[f"{j}_true_stroke"][::4] - signals[f"{j}_reference_stroke"] for j in JOINTS}
    assert np.abs(off["joint1"]).max() < 7e-3
    assert np.abs(off["joint1"][-31:]).max() < 2e-3
    for joint in JOINTS[2:]:
        assert np.abs(off[joint]).max() < 3e-3, joint
    assert np.ptp(signals["joint1_velocity_command"]) < 0.035


def test_sheet_makes_the_controllers_picture_of_each_cylinder() -> None:
    loops, drives = force_loops(ROBOT), PLANT.tables.drives
    for k, joint in enumerate(JOINTS):
        known = getattr(loops, joint).actuator
        assert known.static.area_lifting == drives[k]["area_lifting"]
        assert known.static.flow_lifting == drives[k]["flow_nominal"]
        assert known.volume_lifting_0 == drives[k]["volume_lifting_0"]


def test_sensors_are_quantised_noisy_and_repeatable() -> None:
    from emir_plant.robot.sensors import measure

    truth = PLANT.outputs(PLANT.initial(START, 2e6))
    first, again, next_one = (measure(PLANT, truth, k) for k in (7, 7, 8))
    sensors = ROBOT.main.sensors
    step = sensors.resolver_span / 2.0**sensors.resolver_bits
    assert np.abs(first.angle - truth.angle).max() <= 0.5 * step
    assert first.angle / step == pytest.approx(np.round(first.angle / step), abs=1e-9)
    assert np.array_equal(first.pressure_lifting, again.pressure_lifting)
    noise = np.array([measure(PLANT, truth, k).pressure_lifting for k in range(400)])
    noise -= truth.pressure_lifting
    assert noise.std(axis=0) == pytest.approx(sensors.pressure_noise, rel=0.15)
    assert not np.array_equal(first.pressure_lowering, next_one.pressure_lowering)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"line.x": 25.0}, r"line: the arm does not reach"),
        ({"line.speed": 2.0}, r"line: joint1 would have to move at \d+ mm/s, its valve gives 54.1"),
        (
            {"arm.payload": 1500.0},
            r"line: with 1500 kg joint4 would need 3\d\d bar, the pump gives 19\d",
        ),
    ],
)
def test_lines_that_cannot_be_are_refused(values: dict[str, float], said: str) -> None:
    control = _loop("line", **values).controls[0]
    assert isinstance(control, RobotTrajectoryControl)
    with pytest.raises(PostureError.__base__, match=said):
        control.trajectory.initial(RobotTrajectoryInputs(START))


def test_line_that_takes_more_than_the_shared_pump_gives_is_refused() -> None:
    """Each valve has the flow; all together need 165 l/min."""
    small = with_values(ROBOT, {"pump.flow_max": 1e-3})
    with pytest.raises(PostureError.__base__, match=r"together .* l/min, the pump gives 60"):
        trajectory(small, "line", MOVE, PATH).initial(RobotTrajectoryInputs(START))


def test_pump_that_droops_under_its_flow_gives_less_pressure() -> None:
    """All joints at once draw what leaves too little for the one with the largest load."""
    weak = with_values(ROBOT, {"pump.droop": 1e7, "pump.flow_max": 3e-3})
    with pytest.raises(
        PostureError.__base__, match=r"joint\d would need 1\d\d bar, the pump gives"
    ):
        trajectory(weak, "line", MOVE, PATH).initial(RobotTrajectoryInputs(START))
    trajectory(ROBOT, "line", MOVE, PATH).initial(RobotTrajectoryInputs(START))

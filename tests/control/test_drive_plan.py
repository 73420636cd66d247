"""The plan by velocities of the drive: an independent formulation, the limit, the valve's flow."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from emir_analysis.machine_model import actuator, boom_table
from emir_control.actuator import Actuator
from emir_control.boom import Boom
from emir_control.drive_plan import SUBSTEPS, Begin, Drive, HeldTask, gentlest, onward
from emir_control.least_bending import NoMotionError, Task, limit
from emir_control.motion_plan import Planner, UnderWay, holding
from emir_control.prefilter import joint_angle
from emir_control.trajectory import Move
from emir_plant.sheet import joint1

TASK = HeldTask(0.12, 0.032, 103)
DRIVE = Drive(arm=0.6, stiffness=5e7, slope=0.0, low=-0.06, high=0.06)
ALLOWANCE = 0.03


def _boom(payload: float) -> Boom:
    return boom_table(joint1()).loaded(payload)


def _free(boom: Boom, velocity: NDArray[np.float64]) -> NDArray[np.float64]:
    """The modal coordinates of the boom on the drive's oil, (m, n), joint free, weight left out."""
    m = len(boom.joint)

    def rates(_: float, x: NDArray[np.float64], u: float) -> NDArray[np.float64]:
        q, rate, pushed = x[:m], x[m:-1], x[-1]
        torque = DRIVE.arm * DRIVE.stiffness * pushed
        force = boom.joint * torque - boom.stiffness * q - boom.damping * rate
        return np.concatenate([rate, force, [u - DRIVE.arm * boom.joint @ rate]])

    states = [np.zeros(2 * m + 1)]
    for u in velocity:
        times = np.linspace(0.0, TASK.period, SUBSTEPS + 1)[1:]
        found = solve_ivp(
            rates, (0.0, TASK.period), states[-1], t_eval=times, args=(u,), rtol=1e-8, atol=1e-12
        )
        states += list(found.y.T)
    return np.array(states).T[: 2 * m]


@pytest.mark.parametrize("payload", [0.0, 1200.0])
def test_boom_on_its_oil_moves_as_planned_and_arrives_at_rest(payload: float) -> None:
    boom = _boom(payload)
    motion = gentlest(boom, DRIVE, TASK, ALLOWANCE)
    m = len(boom.joint)
    states = _free(boom, motion.velocity)
    largest = abs(motion.deflection).max()
    assert boom.deflection @ states[:m] == pytest.approx(motion.deflection, abs=1e-3 * largest)
    assert boom.joint @ states[:m] == pytest.approx(motion.angle, abs=1e-5)
    assert boom.joint @ states[:m, -1] == pytest.approx(TASK.turn, abs=1e-5)
    assert abs(boom.deflection @ states[:m, -1]) < 0.01 * largest
    assert abs(motion.velocity).max() <= DRIVE.high * (1.0 + 1e-9)


@pytest.mark.parametrize("payload", [0.0, 1200.0])
def test_it_bends_the_boom_little_more_than_the_limit(payload: float) -> None:
    """The limit knows no drive; a velocity held for a period costs some percent."""
    boom = _boom(payload)
    rate = DRIVE.high / DRIVE.arm
    least = limit(boom.clamped(), Task(TASK.turn, 3.3, -rate, rate)).largest
    motion = gentlest(boom, DRIVE, TASK, ALLOWANCE)
    assert least < abs(motion.deflection).max() < 1.15 * least


def test_more_allowance_moves_the_valve_less() -> None:
    travel = [
        abs(np.diff(gentlest(_boom(500.0), DRIVE, TASK, allowed).velocity)).sum()
        for allowed in (0.02, 0.3)
    ]
    assert travel[1] < 0.8 * travel[0]


@pytest.mark.parametrize("payload", [0.0, 1200.0])
def test_a_motion_under_way_is_led_to_its_end(payload: float) -> None:
    """From the middle of another one, that had gone on by its own velocities."""
    boom = _boom(payload)
    clamped, m, done = boom.clamped(), len(boom.joint), 45
    before = gentlest(boom, DRIVE, TASK, ALLOWANCE)
    x = _free(boom, before.velocity[:done])[:, -1]
    q, swinging = x[:m], x[m:]
    begin = Begin(
        bent=clamped.shapes.T @ (q - clamped.rigid * (boom.joint @ q)),
        swinging=clamped.shapes.T @ (swinging - clamped.rigid * (boom.joint @ swinging)),
        rate=float(boom.joint @ swinging),
        pushed=float(before.pushed[done * SUBSTEPS]),
        velocity=float(before.velocity[done - 1]),
        periods=2,
    )
    left = HeldTask(TASK.turn - float(boom.joint @ q), TASK.period, TASK.count - done)
    after = onward(boom, DRIVE, left, begin)
    assert after.velocity[:2] == pytest.approx(begin.velocity)
    states = _free(boom, np.concatenate([before.velocity[:done], after.velocity]))
    largest = abs(before.deflection).max()
    assert boom.joint @ states[:m, -1] == pytest.approx(TASK.turn, abs=1e-5)
    assert abs(boom.joint @ states[m:, -1]) < 1e-4
    assert abs(boom.deflection @ states[:m, -1]) < 0.02 * largest
    swing = boom.deflection @ states[:m, done * SUBSTEPS :]
    assert after.deflection == pytest.approx(swing, abs=1e-3 * largest)


def test_too_far_for_the_valves_flow() -> None:
    with pytest.raises(NoMotionError, match=r"no motion turns the joint by 0\.5 rad"):
        gentlest(_boom(0.0), DRIVE, HeldTask(0.5, 0.032, 60), ALLOWANCE)


@pytest.mark.parametrize("since", [-0.6, -0.585, -0.571])
def test_a_plan_changes_its_velocity_when_commands_act(since: float) -> None:
    """Between two of them the mean velocity of the plan is that of the whole period."""
    drive = Actuator(actuator(joint1()))
    plan = Planner(drive, 0.032, 0.0405, ALLOWANCE).plan(_boom(0.0), 0.4, Move(since, 3.3, 0.06))
    assert abs(plan.begins) <= 0.016
    periods = (plan.begins - since - 0.0405) / 0.032
    assert periods == pytest.approx(round(periods), abs=1e-9)
    for k in (20, 60):
        begin = plan.begins + k * 0.032
        whole = plan.velocity(begin, 0.032)
        assert plan.velocity(begin + 0.008, 0.016) == pytest.approx(whole, abs=4e-4)


def test_a_swinging_boom_that_is_where_it_should_be_is_brought_to_rest_there() -> None:
    drive, boom = Actuator(actuator(joint1())), _boom(300.0)
    angle, stroke = joint_angle(0.4, drive.parameters.static), 0.4
    shape = boom.clamped().rigid * angle + boom.sag() * math.cos(angle)
    swinging = 1e-2 * boom.clamped().shapes[:, 0]
    force = holding(boom, drive, angle)
    now = UnderWay(1.0, angle, float(boom.joint @ swinging), shape, swinging, force, 0.0)
    plan = Planner(drive, 0.032, 0.0405, ALLOWANCE).onward(boom, now, stroke, 2.0)
    assert plan.at(math.inf).stroke == pytest.approx(stroke, abs=1e-4)
    assert plan.bend(1.0 + 2.0) == pytest.approx(0.0, abs=0.1 * abs(plan.deflection).max())


def test_a_plan_ends_where_the_move_does() -> None:
    drive = Actuator(actuator(joint1()))
    plan = Planner(drive, 0.032, 0.0405, ALLOWANCE).plan(_boom(300.0), 0.4, Move(-0.6, 3.3, -0.06))
    assert plan.at(math.inf).stroke - plan.at(-1.0).stroke == pytest.approx(-0.06, abs=2e-5)

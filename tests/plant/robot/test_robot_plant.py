"""The integrated robot against an independent solver, conservation, and joint 1's own model."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

pytest.importorskip("pinocchio", reason="Pinocchio is missing: pip install 'emir_ros[robot]'")

from emir_common.parameter_tree import with_values
from emir_common.quantity import ParameterError
from emir_plant.core import LOGIC
from emir_plant.plant import Plant, SimulationError
from emir_plant.robot import actuators
from emir_plant.robot.actuators import ACTUATORS, EACH, SIZE, SUPPLY, _valve_flows, own
from emir_plant.robot.parameters import Pump, Robot
from emir_plant.robot.plant import RobotPlant
from emir_plant.robot.reach import PostureError
from emir_plant.robot.sheet import load_robot, robot

FORTY_FIVE = math.radians(45.0)
STRETCHED = np.array([0.0, FORTY_FIVE, 0.0, 0.0, 0.0, 0.0])
BENT = np.array([0.0, FORTY_FIVE, -0.3, 0.2, -0.2, 0.3])
MOVING = np.array([0.3, 0.5, -0.3, 0.4, 0.3, -0.3])
SHUT = np.zeros(6)
ROBOT = robot()
PLANT = RobotPlant(ROBOT)
N = PLANT.mechanics.size


def test_initial_state_is_at_rest_and_stays_there() -> None:
    start = PLANT.initial(BENT, 20e5)
    rate = PLANT.derivative(start, SHUT)
    assert np.abs(rate[SIZE:]).max() < 1e-7
    assert np.abs(rate[:SIZE]).max() < 1e-6
    after = start
    for _ in range(25):
        after, shown = PLANT.step(after, SHUT, 8e-3)
    assert np.abs(shown.angle - BENT).max() < 1e-6
    # the velocities of the stiff springs' settling on rounding alone
    assert np.abs(after[SIZE + N :]).max() < 1e-5


def test_motion_agrees_with_an_independent_solver() -> None:
    """DOP853 on the unsplit equations, all joints moving, 0.24 s."""
    start = PLANT.initial(BENT, 20e5)
    exact = solve_ivp(
        lambda _t, x: PLANT.derivative(x, MOVING),
        (0.0, 0.24),
        start,
        "DOP853",
        rtol=1e-7,
        atol=1e-8,
    ).y[:, -1]
    ours = PLANT.advance(start, MOVING, 0.24)
    shown, expected = PLANT.outputs(ours), PLANT.outputs(exact)
    travel = np.linalg.norm(expected.position - PLANT.outputs(start).position)
    assert travel > 0.01
    assert np.linalg.norm(shown.position - expected.position) < 1e-3 * travel
    for name in ("pressure_lifting", "pressure_lowering"):
        difference = np.abs(getattr(shown, name) - getattr(expected, name)).max()
        assert difference < 3e-4 * getattr(expected, name).max(), name
    finer = PLANT.outputs(PLANT.advance(start, MOVING, 0.24, step=2.5e-4, refresh=1e-3))
    coarse = np.abs(shown.angle - expected.angle).max()
    assert np.abs(finer.angle - expected.angle).max() < 0.3 * coarse  # it converges


def test_energy_balances() -> None:
    """What the oil brings in is in oil, motion, bending and height, or lost in the dampers."""
    dt, beta = 1e-3, ROBOT.main.cylinder.beta
    drives, m = PLANT.tables.drives, PLANT.mechanics
    states = [PLANT.initial(BENT, 20e5)]
    for k in range(900):
        commands = MOVING if k < 400 else (-MOVING if 500 < k < 800 else SHUT)
        states.append(PLANT.advance(states[-1], commands, dt))
    x = np.array(states)
    supplied, in_oil = np.zeros(len(x)), np.zeros(len(x))
    shown = [PLANT.outputs(s) for s in states]
    for k in range(ACTUATORS):
        p = drives[k]
        pressures = x[:, 1 + k * EACH : 1 + (k + 1) * EACH]
        flow = np.array([_flows_of(s, k, drives) for s in states[: len(x)]])
        stroke = np.array([s.stroke[k] if k > 0 else 0.0 for s in shown])
        lifting = p["volume_lifting_0"] + p["area_lifting"] * stroke
        lowering = p["volume_lowering_0"] - p["area_lowering"] * stroke
        supplied += pressures[:, 0] * flow[:, 0] + pressures[:, 1] * flow[:, 1]
        in_oil += pressures[:, 0] * lifting / beta * np.gradient(pressures[:, 0], dt)
        in_oil += pressures[:, 1] * lowering / beta * np.gradient(pressures[:, 1], dt)
    lost = np.array([s[SIZE + N :] @ m.damping @ s[SIZE + N :] for s in states])
    stored = np.array([sum(m.energy(s[SIZE : SIZE + N], s[SIZE + N :])) for s in states])

    def total(power: np.ndarray) -> np.ndarray:
        return np.concatenate(([0.0], np.cumsum(0.5 * (power[1:] + power[:-1])) * dt))

    residual = total(supplied - in_oil - lost) - (stored - stored[0])
    assert np.abs(residual).max() < 3e-3 * np.ptp(total(supplied))


def _like_the_chain(machine: Robot) -> Robot:
    """Return the robot with massless linkage parts and a pump that never tires."""
    names = ("barrel_mass", "piston_mass", "lever_mass", "thrust_bar_mass")
    values = {f"joint{n}.parts.{name}": 0.0 for n in range(1, 6) for name in names}
    tireless = Pump(flow_max=1.0, droop=1e4, line_volume=10.0)
    return dataclasses.replace(with_values(machine, values), pump=tireless)


def test_stretched_and_locked_robot_answers_as_joint_1s_own_model() -> None:
    """Lifting and lowering; the difference is that of 0.68 and 0.69 Hz over three swings."""
    free = (0.0, math.nan, 0.0, 0.0, 0.0, 0.0)
    plant, chain = RobotPlant(_like_the_chain(ROBOT), locked=free), Plant(ROBOT.main)
    x, j = plant.initial(STRETCHED, 20e5), chain.initial(FORTY_FIVE, 20e5)
    rows = []
    for k in range(550):
        y = 0.5 if 25 < k < 250 else (-0.6 if 325 < k < 450 else 0.0)
        x, robots = plant.step(x, y * np.eye(6)[1], 8e-3)
        j, chains = chain.step(j, y, 8e-3)
        up = np.array([-math.sin(robots.angle[1]), 0.0, math.cos(robots.angle[1])])
        assert np.abs(robots.angle[2:]).max() < 1e-5  # locked
        ours = (robots.stroke[1], robots.pressure_lifting[1], robots.deflection @ up)
        rows.append((ours, (chains.stroke, chains.pressure_lifting, chains.tcp_deflection)))
    ours, theirs = np.moveaxis(np.array(rows), 1, 0)
    error = np.sqrt(np.mean((ours - theirs) ** 2, axis=0)) / np.ptp(theirs, axis=0)
    assert error == pytest.approx(0.0, abs=0.05)
    assert error[0] < 0.02


def test_base_turns_at_its_flow_over_its_displacement() -> None:
    """Half open, after the start: the boom's swinging averaged out."""
    x, angles = PLANT.initial(STRETCHED, 20e5), []
    opening = 0.5
    command = PLANT.robot.main.valve.dead_zone + opening * (1.0 - PLANT.robot.main.valve.dead_zone)
    for _ in range(750):
        x, shown = PLANT.step(x, command * np.eye(6)[0], 8e-3)
        angles.append(shown.angle[0])
    speed = (angles[-1] - angles[250]) / (499 * 8e-3)
    expected = opening * ROBOT.base.flow_nominal / ROBOT.base.displacement
    assert speed == pytest.approx(expected, rel=0.1)
    assert shown.position[1] > 1.0  # to the left


def _flows_of(x: np.ndarray, k: int, drives: np.ndarray) -> tuple[float, float]:
    """Return actuator k's flows through its valve into its chambers, m^3/s."""
    lifting, lowering, _ = _valve_flows(own(x, k), x[SUPPLY], drives[k])
    return lifting, lowering


def _flows(plant: RobotPlant, openings: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what each actuator draws, (6,) m^3/s, and the supply pressure, means of 2.5-3 s."""
    zone = ROBOT.main.valve.dead_zone
    commands = np.where(openings > 0.0, zone + openings * (1.0 - zone), 0.0)
    x = plant.advance(plant.initial(BENT, 20e5), commands, 2.5)
    drawn, supply = [], []
    for _ in range(125):
        x = plant.advance(x, commands, 4e-3)
        drawn.append([_flows_of(x, k, plant.tables.drives)[0] for k in range(ACTUATORS)])
        supply.append(x[SUPPLY])
    return np.mean(drawn, axis=0), np.mean(supply)


def test_one_pump_feeds_all_and_droops() -> None:
    """At 300 bar, where no load takes a valve its pressure as long as the flow lasts."""
    plant, pump = RobotPlant(with_values(ROBOT, {"main.supply.p0": 300e5})), ROBOT.pump
    alone, supply = _flows(plant, 0.9 * np.eye(6)[5])
    assert alone[5] == pytest.approx(0.9 * ROBOT.joint5.drive.flow_nominal, rel=1e-3)
    droop = pump.droop * alone[5] / pump.flow_max
    assert 300e5 - supply == pytest.approx(droop, rel=1e-2)
    shared, low = _flows(plant, np.full(6, 0.9))
    wanted = 0.9 * np.array([d["flow_nominal"] for d in plant.tables.drives])
    assert wanted.sum() > 1.3 * pump.flow_max  # more than there is
    assert shared.sum() == pytest.approx(pump.flow_max, rel=0.1)  # the boom swings
    assert low < 300e5 - pump.droop
    short = shared / wanted
    assert short[2] < short[5]  # the heavily loaded joint 2 goes short before joint 5


@pytest.mark.parametrize(("actuator", "place"), [(0, "base"), (1, "main"), (4, "joint4")])
def test_effects_act_on_the_joint_that_they_are_stated_for(actuator: int, place: str) -> None:
    """Leaking chambers at rest: their pressures fall, the others' do not."""
    path = f"{place}.effects.external_leakage.lifting"
    leaking = RobotPlant(with_values(ROBOT, {path: 1e-11}))
    rate = leaking.derivative(leaking.initial(BENT, 20e5), SHUT)[1:SIZE].reshape(ACTUATORS, EACH)
    falling = np.abs(rate[:, :2]).max(axis=1)
    assert falling[actuator] > 1e3
    assert np.delete(falling, actuator).max() < 1e-3 * falling[actuator]


@pytest.mark.parametrize("place", ["main", "joint3"])
def test_friction_of_a_joint_shows_in_its_pressure(place: str) -> None:
    k = 1 if place == "main" else 3
    area = PLANT.tables.drives[k]["area_lifting"]
    force = 0.03 * area * 1e7
    sticky = with_values(ROBOT, {f"{place}.effects.coulomb_friction.force": force})
    x, y = PLANT.initial(BENT, 20e5), RobotPlant(sticky).initial(BENT, 20e5)
    lifting = np.full(6, 0.5)
    x, y = PLANT.advance(x, lifting, 0.5), RobotPlant(sticky).advance(y, lifting, 0.5)
    more = y[1 + k * EACH] - x[1 + k * EACH]
    assert 0.0 < more < 2.0 * force / area


def test_seals_of_a_joint_are_pressed_on_by_both_its_chambers() -> None:
    """As the piston slides fast: mu (p_H A_H + p_S A_S), which the oil's force is not."""
    seals = "joint3.effects.pressure_dependent_friction"
    sealed = RobotPlant(
        with_values(ROBOT, {f"{seals}.coefficient": 0.02, f"{seals}.seal_share": 1})
    )
    x, drives = PLANT.initial(BENT, 20e5), sealed.tables.drives
    sliding, standing = np.empty(ACTUATORS), np.empty(ACTUATORS)
    actuators.forces(x, np.full(ACTUATORS, 0.1), drives, sliding)
    actuators.forces(x, np.zeros(ACTUATORS), drives, standing)
    (high, low), p = own(x, 3)[:2], drives[3]
    pressed = high * p["area_lifting"] + low * p["area_lowering"]
    assert standing[3] - sliding[3] == pytest.approx(0.02 * pressed)


def test_a_blocked_logic_block_rests_as_far_open_as_it_goes() -> None:
    blocked = RobotPlant(with_values(ROBOT, {"main.effects.logic_block_fault.blocked": 0.6}))
    start = blocked.initial(BENT, 20e5)
    assert own(start, 1)[LOGIC] == pytest.approx(0.4)
    assert own(blocked.derivative(start, SHUT), 1)[LOGIC] == 0.0


@pytest.mark.parametrize(
    ("path", "said"),
    [
        ("main.effects.command_delay.delay", r"^effects.command_delay: not in the model"),
        ("joint2.effects.payload.mass", r"^joint2.effects.payload: not in the model"),
    ],
)
def test_effects_without_a_place_are_refused(path: str, said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        RobotPlant(with_values(ROBOT, {path: 0.01})).initial(BENT)


def test_effects_of_a_joint_are_switched_on_in_its_file(tmp_path: Path) -> None:
    stated = (Path(actuators.__file__).parents[1] / "data" / "robot.yaml").read_text()
    file = tmp_path / "robot.yaml"
    on = "joint2:\n  effects: {coulomb_friction: {force: 3.0e+3}}\n"
    file.write_text(stated.replace("joint2:\n", on))
    expected = with_values(ROBOT, {"joint2.effects.coulomb_friction.force": 3e3})
    assert load_robot(file, ROBOT.main) == expected
    file.write_text(stated.replace("joint2:\n", on.replace("coulomb", "colomb")))
    with pytest.raises(ParameterError, match=r"joint2.effects.colomb_friction: there is no such"):
        load_robot(file, ROBOT.main)
    file.write_text(stated.replace("joint2:\n", on.replace("3.0e+3", "-1.0")))
    with pytest.raises(ParameterError, match=r"joint2.effects.coulomb_friction.force = -1: out"):
        load_robot(file, ROBOT.main)


def test_end_stop_holds_the_piston() -> None:
    posture = STRETCHED.copy()
    highest = PLANT.mechanics.reaches[4]
    posture[5] = highest.angle_high - 0.05
    x = PLANT.initial(posture, 20e5)
    for _ in range(100):
        x, shown = PLANT.step(x, np.eye(6)[5], 16e-3)
    assert shown.stroke[5] == pytest.approx(highest.stroke_high, abs=5e-3)
    assert shown.pressure_lifting[5] > 0.9 * shown.supply_pressure  # pushes against it


def test_step_is_the_same_whether_called_once_or_in_a_sequence() -> None:
    start = PLANT.initial(BENT, 20e5)
    once = PLANT.advance(start, MOVING, 16e-3)
    twice = PLANT.advance(PLANT.advance(start, MOVING, 8e-3), MOVING, 8e-3)
    assert twice == pytest.approx(once, rel=1e-9, abs=1e-12)
    assert np.array_equal(start, PLANT.initial(BENT, 20e5))  # not touched


def test_what_cannot_be_simulated_is_said_in_one_line() -> None:
    with pytest.raises(SimulationError, match="not finite"):
        PLANT.step(PLANT.initial(BENT), np.full(6, math.nan), 1e-3)
    heavy = RobotPlant(with_values(ROBOT, {"main.geometry.payload": 3000.0}))
    with pytest.raises(SimulationError, match=r"joint \d needs \d+ bar to rest on"):
        heavy.initial(np.zeros(6))
    with pytest.raises(PostureError, match=r"joint 5: 100.0 deg is outside"):
        PLANT.initial(np.radians([0.0, 45.0, 0.0, 0.0, 0.0, 100.0]))

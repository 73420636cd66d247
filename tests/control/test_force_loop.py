"""Force feedback and prefilter: limit cases, and on the nonlinear machine."""

import math

import numpy as np
import pytest

from emir_analysis.closed_loop import ClosedLoop
from emir_analysis.design_pfc import OperatingPoint, steady_motion
from emir_common.parameter_tree import with_values
from emir_control.force_loop import (
    ForceLoop,
    ForceLoopInputs,
    ForceLoopParameters,
)
from emir_control.prefilter import (
    PrefilterParameters,
    joint_angle,
    piston_velocity,
    valve_command,
)
from emir_control.trajectory import TrajectoryParameters, named
from emir_plant import linkage
from emir_plant.core import Truth
from emir_plant.plant import Plant
from emir_plant.sheet import joint1

DT = 0.032
LOOP = ForceLoop(ForceLoopParameters())
FILTER = PrefilterParameters()
FORTY_FIVE = math.radians(45.0)
AREA = FILTER.area_lifting


def _inputs(force: float, velocity: float = 0.01) -> ForceLoopInputs:
    return ForceLoopInputs(velocity, 0.0, FORTY_FIVE, force / AREA, 0.0)


def test_a_constant_force_has_no_influence() -> None:
    """The high pass: the load does not move the static working point (paper 3.1)."""
    state = LOOP.initial(_inputs(1e5))
    for _ in range(600):
        state, outputs = LOOP.step(state, _inputs(6e5), DT)
    assert outputs.velocity == pytest.approx(0.01, rel=1e-6)


def test_a_force_step_passes_with_the_gain_and_decays_with_the_time_constant() -> None:
    state, step = LOOP.initial(_inputs(0.0)), 1e4
    feedback = []
    for _ in range(100):
        state, outputs = LOOP.step(state, _inputs(step), DT)
        feedback.append(outputs.feedback)
    times = DT * np.arange(1, 101)
    gain, slow = LOOP.parameters.gain, LOOP.parameters.time_constant
    assert np.array(feedback) == pytest.approx(gain * step * np.exp(-times / slow), rel=1e-9)


@pytest.mark.parametrize("index", range(5))
def test_an_input_that_is_no_number_shuts_the_valve(index: int) -> None:
    bad = list(_inputs(1e5))
    bad[index] = math.nan
    state = LOOP.initial(_inputs(1e5))
    after, outputs = LOOP.step(state, ForceLoopInputs(*bad), DT)
    assert outputs.valve_command == 0.0
    assert after == state


def test_command_stays_within_the_valves_range() -> None:
    for velocity in (-10.0, 10.0):
        state = LOOP.initial(_inputs(0.0))
        for _ in range(10):  # the rate is limited as well
            state, outputs = LOOP.step(state, _inputs(0.0, velocity), DT)
        assert outputs.valve_command == math.copysign(1.0, velocity)
        assert outputs.saturated


@pytest.mark.parametrize("velocity", [0.02, 0.01, -0.01, -0.02])
def test_prefilter_inverts_valve_and_cylinder(velocity: float) -> None:
    """Without any feedback the machine settles at the wanted piston velocity."""
    plant = Plant(joint1())
    commands = np.full(2000, valve_command(velocity, FILTER))
    start = plant.initial(FORTY_FIVE, 60e5)
    run = plant.simulate(start, commands, 1e-2, 1)[: round(0.2 / abs(velocity) / 1e-2)]
    time, stroke = np.arange(len(run)) * 1e-2, run[:, Truth._fields.index("stroke")]
    half = len(run) // 2  # once the pressures have built up; swinging averages out
    assert np.polyfit(time[half:], stroke[half:], 1)[0] == pytest.approx(velocity, rel=0.06)


def test_static_accuracy_does_not_depend_on_the_load() -> None:
    """Paper 3.1: the high pass keeps the load out. Rest and steady speed, empty and loaded."""
    trajectory = named("lift-lower", TrajectoryParameters(pause=4.0))
    speeds, errors = [], []
    for payload in (0.0, 1000.0):
        plant = Plant(with_values(joint1(), {"geometry.payload": payload}))
        found = ClosedLoop(plant, trajectory).run(math.radians(60.0), 2e6, 8.2)
        errors.append(float(np.mean(found["true_stroke"][-100:])) - found["reference_stroke"][-1])
        _, command = steady_motion(plant, OperatingPoint(payload=payload, velocity=0.02))
        speeds.append((abs(command) - FILTER.dead_zone) / (1.0 - FILTER.dead_zone))
    step = 2.0 * math.pi / 2**12 * 0.65  # m, of the resolver at the longest lever arm
    assert np.abs(errors).max() < 2.0 * step
    assert speeds[1] == pytest.approx(speeds[0], rel=0.01)  # the pressure balance does its part


@pytest.mark.parametrize("rate", [0.03, -0.03])
def test_a_wanted_joint_rate_is_what_the_joint_does_in_any_posture(rate: float) -> None:
    """Linkage ratio, dead zone and flow curve inverted together, on the machine.

    Without feedback: with it, a weight that changes with the posture adds k_F T_H dF/dt.
    """
    static = ForceLoop(ForceLoopParameters(gain=0.0))
    for degrees in (45.0, 70.0):
        plant = Plant(joint1())
        state = plant.initial(math.radians(degrees), 60e5)
        shown, control, angles = plant.outputs(state), None, []
        for _ in range(150):
            sensed = ForceLoopInputs(
                0.0, rate, shown.angle, shown.pressure_lifting, shown.pressure_lowering
            )
            control, out = static.step(control or static.initial(sensed), sensed, DT)
            state, shown = plant.step(state, out.valve_command, DT)
            angles.append(shown.angle)
        late = np.array(angles[75:])
        assert np.polyfit(DT * np.arange(late.size), late, 1)[0] == pytest.approx(rate, rel=0.1)


def test_prefilter_leaves_the_dead_zone_at_once_and_rests_at_standstill() -> None:
    assert valve_command(0.0, FILTER) == 0.0
    assert abs(valve_command(0.4 * FILTER.standstill, FILTER)) == 0.0
    assert valve_command(1.1 * FILTER.standstill, FILTER) > FILTER.dead_zone
    assert valve_command(-1.1 * FILTER.standstill, FILTER) < -FILTER.dead_zone


def test_joint_rate_is_turned_into_piston_velocity_by_the_linkage() -> None:
    p = Plant(joint1()).record[0]
    for angle in np.radians([0.0, 30.0, 60.0, 85.0]):
        assert piston_velocity(0.1, angle, FILTER) == pytest.approx(
            0.1 * linkage.lever_arm(angle, p), rel=1e-12
        )


def test_joint_angle_is_the_linkages_own() -> None:
    p = Plant(joint1()).record[0]
    for angle in np.radians([-10.0, 0.0, 45.0, 85.0]):
        assert joint_angle(linkage.stroke(angle, p), FILTER) == pytest.approx(angle, abs=1e-12)
    assert math.isnan(joint_angle(5.0, FILTER))  # longer than the triangle's sides


def test_controllers_picture_of_the_machine_is_the_machines_own() -> None:
    m = joint1()
    expected = PrefilterParameters(
        area_lifting=m.cylinder.area_lifting,
        area_lowering=m.cylinder.area_lowering,
        flow_lifting=m.valve.flow_nominal,
        flow_lowering=m.valve.flow_nominal * m.valve.flow_ratio_lowering,
        dead_zone=m.valve.dead_zone,
        triangle_a=m.geometry.triangle_a,
        triangle_b=m.geometry.triangle_b,
        triangle_gamma0=m.geometry.triangle_gamma0,
    )
    for name in expected.__dataclass_fields__:
        assert getattr(FILTER, name) == pytest.approx(getattr(expected, name), rel=1e-12)


def _swing_after_a_stop(gain: float) -> np.ndarray:
    """Lift for 0.7 s, stop at once; return the size of the piston velocity from then on."""
    plant = Plant(joint1())
    loop = ForceLoop(ForceLoopParameters(gain=gain, prefilter=PrefilterParameters(standstill=0.0)))
    state = plant.initial(FORTY_FIVE, 40e5)
    shown, control, velocity = plant.outputs(state), None, []
    for k in range(400):
        wanted = 0.02 if k < 22 else 0.0
        inputs = ForceLoopInputs(
            wanted, 0.0, shown.angle, shown.pressure_lifting, shown.pressure_lowering
        )
        control = control or loop.initial(inputs)
        control, outputs = loop.step(control, inputs, DT)
        state, shown = plant.step(state, outputs.valve_command, DT)
        velocity.append(shown.velocity)
    return np.abs(np.array(velocity[22:]))


def test_force_feedback_damps_the_machine() -> None:
    undamped, damped = _swing_after_a_stop(0.0), _swing_after_a_stop(8.8e-8)
    early, late = slice(0, 50), slice(150, 200)  # 0-1.6 s and 4.8-6.4 s after the stop
    assert undamped[late].max() > 0.7 * undamped[early].max()
    assert damped[late].max() < 0.1 * damped[early].max()

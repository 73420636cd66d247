"""The drive loop on joint 1's nonlinear machine, beside the force loop and its prefilter."""

import math
from functools import cache

import numpy as np
import pytest

from emir_analysis.machine_model import actuator
from emir_common.parameter_tree import with_values
from emir_control.actuator import Actuator
from emir_control.drive_loop import DriveLoop, DriveLoopInputs, DriveLoopParameters
from emir_control.force_loop import ForceLoop, ForceLoopInputs, ForceLoopParameters
from emir_plant.operating_point import under_command
from emir_plant.plant import Plant
from emir_plant.sheet import joint1

MACHINE = joint1()
PLANT = Plant(MACHINE)
LOOP = DriveLoop(DriveLoopParameters(actuator=actuator(MACHINE)))
STATIC = ForceLoop(ForceLoopParameters())
START, PERIOD = math.radians(45.0), 0.008


@cache
def _weight() -> tuple[np.ndarray, np.ndarray]:
    """Return the piston's force at rest, N, over the stroke, m."""
    rests = [PLANT.outputs(PLANT.initial(START + math.radians(k))) for k in range(-15, 16)]
    return np.array([at.stroke for at in rests]), np.array([at.force for at in rests])


def _moved(velocity: float, *, by_drive: bool) -> float:
    """Return how far the piston is behind the commanded way after 4 s, m; both begin at rest."""
    state = PLANT.initial(START, 20e5)
    truth = first = PLANT.outputs(state)
    own = None
    for _ in range(round(4.0 / PERIOD)):
        pressures = truth.pressure_lifting, truth.pressure_lowering
        if by_drive:
            expected = float(np.interp(truth.stroke, *_weight()))
            inputs = DriveLoopInputs(velocity, expected, truth.stroke, *pressures)
            own, shown = LOOP.step(own or LOOP.initial(inputs), inputs, PERIOD)
        else:
            inputs = ForceLoopInputs(velocity, 0.0, truth.angle, *pressures)
            own, shown = STATIC.step(own or STATIC.initial(inputs), inputs, PERIOD)
        state, truth = PLANT.step(state, shown.valve_command, PERIOD)
    return velocity * 4.0 - (truth.stroke - first.stroke)


def test_filling_of_the_chambers_is_not_lost_way() -> None:
    """Lowering, 50 bar have to come into the lowering chamber first: 7 mm of the piston."""
    assert abs(_moved(-0.015, by_drive=False)) > 4e-3
    assert abs(_moved(-0.015, by_drive=True)) < 1e-3
    assert abs(_moved(0.015, by_drive=True)) < 1e-3


def test_force_that_is_expected_is_not_damped() -> None:
    """A slope of the force that the plan knows moves nothing but the oil that it compresses."""
    drive = LOOP.drive
    area, force = MACHINE.cylinder.area_lifting, drive.force(120e5, 20e5)

    def settled(slope: float, told: float) -> float:
        state, shown = None, None
        for k in range(500):
            now = k * PERIOD * slope
            inputs = DriveLoopInputs(0.01, force + told * now, 0.4, 120e5 + now / area, 20e5)
            state, shown = LOOP.step(state or LOOP.initial(inputs), inputs, PERIOD)
        assert shown is not None
        return shown.velocity

    slope = 5e3  # N/s
    pushed = slope / drive.stiffness(0.4)
    assert settled(slope, 1.0) == pytest.approx(0.01 + pushed, abs=1e-5)
    damped = LOOP.parameters.gain * LOOP.parameters.time_constant * slope
    assert settled(slope, 0.0) == pytest.approx(0.01 - damped, abs=0.05 * damped)


def test_what_is_no_number_shuts_the_valve_and_it_recovers() -> None:
    good = DriveLoopInputs(0.01, 7e5, 0.4, 120e5, 20e5)
    state, before = LOOP.step(LOOP.initial(good), good, PERIOD)
    for k in range(len(good)):
        bad = DriveLoopInputs(*(math.nan if i == k else v for i, v in enumerate(good)))
        after, shown = LOOP.step(state, bad, PERIOD)
        assert shown.valve_command == 0.0
        assert after.static_force == state.static_force
        assert LOOP.step(after, good, PERIOD)[1].valve_command > 0.0
        begun = LOOP.initial(bad)
        assert LOOP.step(begun, good, PERIOD)[1].valve_command == pytest.approx(
            before.valve_command
        )


@pytest.mark.parametrize(("command", "supply"), [(1.0, 120e5), (-1.0, 196e5)])
def test_pressure_needed_is_the_machines_at_full_opening(command: float, supply: float) -> None:
    """Short of pressure, the fully open valve moves the piston as fast as that pressure allows."""
    low = with_values(MACHINE, {"supply.p0": supply})
    plant = Plant(low)
    truth = plant.outputs(under_command(plant, START, command))
    drive = Actuator(actuator(MACHINE))
    force = drive.force(truth.pressure_lifting, truth.pressure_lowering)
    needed = drive.supply_needed(force, truth.velocity)
    assert needed == pytest.approx(supply, rel=0.01)
    assert drive.supply_needed(force, 0.0) == 0.0
    assert np.sign(truth.velocity) == command

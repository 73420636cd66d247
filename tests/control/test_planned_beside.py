"""LQG in real time: plans made beside, moves that cannot be made, moves that it comes late for."""

import math

import numpy as np
import pytest

from emir_analysis.machine_model import lqg_parameters
from emir_control.least_bending import NoMotionError
from emir_control.lqg import Lqg, LqgInputs, LqgState, PlannedBeside
from emir_control.prefilter import joint_angle
from emir_control.trajectory import Move
from emir_plant import core
from emir_plant.plant import Plant
from emir_plant.sheet import joint1

PERIOD = 0.032
STROKE, DISTANCE, DURATION = 0.35, 0.06, 3.3
LAW = Lqg(lqg_parameters(joint1()))
LINKAGE = LAW.parameters.actuator.static


def _inputs(since: float, distance: float = DISTANCE, stroke: float = STROKE) -> LqgInputs:
    """The machine at rest at a stroke, m, the reference at STROKE."""
    angle = joint_angle(stroke, LINKAGE)
    lifting = float(Plant(joint1()).initial(angle, 2e6)[core.P_H])
    return LqgInputs(STROKE, Move(since, DURATION, distance), angle, lifting, 2e6, -0.01)


def _rested(inputs: LqgInputs) -> LqgState:
    return LAW.initial(inputs)


def _wait_for_plan(law: PlannedBeside) -> None:
    law._planned.exception()  # returns when it is over


def test_a_move_is_planned_while_the_machine_is_held_at_rest() -> None:
    """And is the one that is planned in a step otherwise."""
    beside, first = PlannedBeside(LAW), _inputs(-0.6)
    state, outputs = beside.step(_rested(first), first, PERIOD)
    assert not state.moving
    assert outputs.valve_command == 0.0
    _wait_for_plan(beside)
    state, outputs = beside.step(state, _inputs(-0.6 + PERIOD), PERIOD)
    assert state.moving
    assert outputs.valve_command == 0.0  # it has not begun yet
    planned = LAW.planned(_rested(first), first).plan
    assert np.array_equal(state.plan.stroke, planned.stroke)
    assert state.plan.begins == planned.begins


def test_a_plan_that_comes_late_leads_on_from_where_the_machine_is() -> None:
    beside, first = PlannedBeside(LAW), _inputs(-0.6)
    state, _ = beside.step(_rested(first), first, PERIOD)
    _wait_for_plan(beside)
    late = 0.4
    state, outputs = beside.step(state, _inputs(late), PERIOD)
    assert state.moving
    assert state.plan.at(late).stroke == pytest.approx(STROKE, abs=1e-4)
    assert state.plan.at(math.inf).stroke == pytest.approx(STROKE + DISTANCE, abs=1e-4)
    assert abs(outputs.planned) < 0.01  # it begins gently


def test_a_plan_that_comes_at_the_moves_end_is_not_made() -> None:
    beside, first = PlannedBeside(LAW), _inputs(-0.6)
    state, _ = beside.step(_rested(first), first, PERIOD)
    _wait_for_plan(beside)
    for late in (DURATION - 0.9, DURATION + 0.7):
        state, outputs = beside.step(state, _inputs(late), PERIOD)
        assert not state.moving
        assert outputs.valve_command == 0.0


def test_a_number_that_is_none_meanwhile_does_not_lose_the_move() -> None:
    beside, first = PlannedBeside(LAW), _inputs(-0.6)
    state, _ = beside.step(_rested(first), first, PERIOD)
    state, outputs = beside.step(state, _inputs(-0.5)._replace(angle=math.nan), PERIOD)
    assert outputs.valve_command == 0.0
    _wait_for_plan(beside)
    state, _ = beside.step(state, _inputs(0.2), PERIOD)
    assert state.moving


def test_another_move_asked_for_meanwhile_is_the_one_that_is_made() -> None:
    beside, first = PlannedBeside(LAW), _inputs(-0.6)
    state, _ = beside.step(_rested(first), first, PERIOD)
    _wait_for_plan(beside)
    other = _inputs(-0.5, distance=-0.02)
    state, _ = beside.step(state, other, PERIOD)
    assert not state.moving
    _wait_for_plan(beside)
    state, _ = beside.step(state, other, PERIOD)
    assert state.plan.at(math.inf).stroke == pytest.approx(STROKE - 0.02, abs=1e-3)


def test_a_move_that_the_drive_cannot_make_is_refused_in_words() -> None:
    fast = _inputs(-0.6)
    fast = fast._replace(move=fast.move._replace(duration=0.7))
    with pytest.raises(NoMotionError, match="no motion turns the joint"):
        LAW.step(_rested(fast), fast, PERIOD)
    beside = PlannedBeside(LAW)
    state, _ = beside.step(_rested(fast), fast, PERIOD)
    _wait_for_plan(beside)
    state, outputs = beside.step(state, fast, PERIOD)
    assert beside.refused.startswith("no motion turns the joint by")
    assert not state.moving
    assert outputs.valve_command == 0.0
    beside.step(state, _inputs(-math.inf, 0.0), PERIOD)
    assert beside.refused == ""


@pytest.mark.parametrize("law", [LAW, PlannedBeside(LAW)])
def test_a_move_that_had_begun_before_is_left_out(law: Lqg | PlannedBeside) -> None:
    """Nobody tells how far it has come: the machine would be led beyond its end."""
    inputs = _inputs(1.0)
    inputs = inputs._replace(reference=STROKE + 0.025)
    state, outputs = law.step(law.initial(inputs), inputs, PERIOD)
    assert not state.moving
    assert outputs.valve_command == 0.0


def test_a_machine_off_its_reference_is_led_from_where_it_is() -> None:
    off = STROKE - 0.06
    inputs = _inputs(-0.6, stroke=off)
    state, outputs = LAW.step(_rested(inputs), inputs, PERIOD)
    assert outputs.valve_command == 0.0
    assert state.plan.stroke[0] == pytest.approx(off, abs=1e-6)
    assert state.plan.stroke[-1] == pytest.approx(STROKE + DISTANCE, abs=1e-6)
    near = _inputs(-0.6, stroke=STROKE - 0.002)
    plan = LAW.planned(_rested(near), near).plan
    assert plan.stroke[0] == pytest.approx(STROKE, abs=1e-6)
    state, outputs = LAW.step(_rested(inputs), _inputs(-math.inf, 0.0, off), PERIOD)
    assert outputs.valve_command == 0.0  # nor does it creep to a reference that is far away

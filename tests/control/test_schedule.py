"""The schedule against its definition, the scheduled law against the law of one model."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from emir_analysis.closed_loop import ClosedLoop
from emir_analysis.design_pfc import (
    ORDERS,
    DesignTask,
    OperatingPoint,
    design_pfc,
    pump_is_short,
)
from emir_analysis.node_controls import PfcControl, PfcTipControl
from emir_analysis.stability_map import ANGLES, PAYLOADS, stability_map
from emir_common.parameter_tree import with_values
from emir_common.quantity import ParameterError
from emir_control import pfc_file
from emir_control.pfc import PREVIEW, Pfc, PfcInputs
from emir_control.pfc_file import SCHEDULED, STROKE, TIP_ANGLE
from emir_control.schedule import Schedule
from emir_control.scheduled_pfc import ScheduledPfc, law_of
from emir_control.tip import Tip
from emir_control.trajectory import TrajectoryParameters, named
from emir_plant.plant import Plant
from emir_plant.sheet import joint1

DT = 0.032
PLAIN = pfc_file.load(pfc_file.default_file(STROKE), STROKE)
GIVEN = pfc_file.load(pfc_file.find(SCHEDULED, STROKE), STROKE)
LAW = ScheduledPfc(GIVEN)


def _schedule() -> Schedule:
    assert GIVEN.schedule is not None
    return GIVEN.schedule


def _same_everywhere() -> ScheduledPfc:
    """Return a schedule of four times the same model."""
    row = (PLAIN.model, PLAIN.model)
    forces = np.array([[1e5, 1.1e5], [4e5, 4.4e5]])
    schedule = Schedule(np.array([0.0, 0.9]), np.array([0.0, 1500.0]), forces, (row, row))
    return ScheduledPfc(replace(PLAIN, schedule=schedule))


@pytest.mark.parametrize("payload", [0.0, 400.0, 900.0])
@pytest.mark.parametrize("degrees", [35.0, 52.0, 75.0])
def test_payload_is_read_off_the_force_on_which_the_machine_rests(
    payload: float, degrees: float
) -> None:
    plant = Plant(with_values(joint1(), {"geometry.payload": payload}))
    shown = plant.outputs(plant.initial(math.radians(degrees), 2e6))
    assert _schedule().payload(shown.stroke, shown.force) == pytest.approx(payload, abs=40.0)


@pytest.mark.parametrize(("controller", "output"), [("pfc", STROKE), ("pfc_tip", TIP_ANGLE)])
def test_schedules_that_come_with_the_project_are_what_the_command_makes(
    controller: str, output: str
) -> None:
    """At two nodes; the state's basis is free, what the model answers is not."""
    kept = pfc_file.load(pfc_file.find(SCHEDULED, output), output).schedule
    assert kept is not None
    for row, column in ((1, 1), (3, 3)):
        point = OperatingPoint(angle=ANGLES[column], payload=PAYLOADS[row])
        task = DesignTask(controller=controller, order=ORDERS[output], point=point)
        made = design_pfc(joint1(), task).model
        for steps in (1, 7, 20):
            answer = kept.models[row][column].held_response(steps)
            assert made.held_response(steps) == pytest.approx(answer, rel=1e-2)  # LAPACKs differ


def test_weights_are_bilinear_and_one_at_a_node() -> None:
    s = _schedule()
    stroke, payload = s.strokes[1], s.payloads[2]
    assert s.weights(stroke, payload) == {2 * s.strokes.size + 1: 1.0}
    between = s.weights(0.5 * (s.strokes[1] + s.strokes[2]), 0.25 * s.payloads[1])
    assert between == pytest.approx({1: 0.375, 2: 0.375, 5: 0.125, 6: 0.125})
    beyond = s.weights(s.strokes[-1] + 0.1, s.payloads[-1] + 500.0)
    assert beyond == {s.payloads.size * s.strokes.size - 1: 1.0}


def test_of_equal_models_the_schedule_changes_nothing() -> None:
    """Between the nodes, with limits that act, followed and taken over."""
    many, one = _same_everywhere(), Pfc(PLAIN)
    rng = np.random.default_rng(2)
    set_points = 0.4 + np.cumsum(rng.normal(size=160)) * 3e-3
    states = None
    for k in range(160 - PREVIEW):
        inputs = PfcInputs(
            set_points[k], 0.0, set_points[k + 1 : k + 1 + PREVIEW],
            0.4 + 1e-3 * rng.normal(), 0.4, 2.2e5,
        )  # fmt: skip
        mine, other = states or (many.initial(inputs), one.initial(inputs))
        if 60 <= k < 80:
            states = many.follow(mine, inputs, 0.01), one.follow(other, inputs, 0.01)
            continue
        if k == 80:
            mine, other = many.take_over(mine, inputs), one.take_over(other, inputs)
        after, told = many.step(mine, inputs, DT)
        alone, expected = one.step(other, inputs, DT)
        states = after, alone
        assert told.velocity_command == pytest.approx(expected.velocity_command, abs=1e-12)


@pytest.mark.parametrize("lost", ["output", "stroke", "set_point"])
def test_a_number_that_is_none_stops_the_machine(lost: str) -> None:
    inputs = PfcInputs(0.5, 0.0, [0.5] * PREVIEW, 0.49, 0.49, 2e5)
    state = LAW.initial(inputs)
    for _ in range(20):
        state, outputs = LAW.step(state, inputs, DT)
    assert outputs.velocity_command > 0.0
    state, outputs = LAW.step(state, inputs._replace(**{lost: math.nan}), DT)
    assert outputs.velocity_command == 0.0
    state, outputs = LAW.step(state, inputs._replace(force=math.nan), DT)
    assert outputs.velocity_command > 0.0  # the force of before will do


def test_a_schedule_survives_its_file(tmp_path: Path) -> None:
    pfc_file.save(tmp_path / "pfc.yaml", GIVEN, STROKE, {"why": "a test"})
    back = pfc_file.load(tmp_path / "pfc.yaml", STROKE).schedule
    assert back is not None
    for name in ("strokes", "payloads", "forces"):
        assert np.array_equal(getattr(back, name), getattr(_schedule(), name))
    for one, other in zip(back.flat, _schedule().flat, strict=True):
        assert np.array_equal(one.A, other.A)


def test_schedules_that_make_no_sense_are_refused() -> None:
    s = _schedule()
    with pytest.raises(ParameterError, match="schedule: strokes do not rise"):
        replace(s, strokes=s.strokes[::-1])
    with pytest.raises(ParameterError, match="have to be 4 rows of 4"):
        replace(s, models=s.models[:2])
    with pytest.raises(ParameterError, match="schedule: missing"):
        ScheduledPfc(PLAIN)


def test_the_heavy_and_steep_corner_is_stable_with_it_and_comes_to_rest() -> None:
    """60 deg, 1500 kg, where the design made empty swings on (`test_design_pfc`)."""
    machine = with_values(joint1(), {"geometry.payload": 1500.0})
    trajectory = named("lift-lower", TrajectoryParameters(pause=3.0))
    tip = law_of(pfc_file.load(pfc_file.find(SCHEDULED, TIP_ANGLE), TIP_ANGLE))
    for outer in (PfcControl(LAW), PfcTipControl(Tip(tip))):
        run = ClosedLoop(Plant(machine), trajectory, outer).run(math.radians(60.0), 2e6, 7.2)
        assert np.ptp(run["tcp_deflection"][-125:]) < 0.03  # m, in the last second
        assert run["true_stroke"][-1] == pytest.approx(run["reference_stroke"][-1], abs=4e-3)


def test_map_of_the_schedule_between_its_nodes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the pump is all but short of pressure, too: 30 to 38 deg with 1250 kg."""
    angles = tuple(np.radians([30.0, 37.5, 75.0]))
    monkeypatch.setattr("emir_analysis.stability_map.FINE_ANGLES", angles)
    monkeypatch.setattr("emir_analysis.stability_map.FINE_PAYLOADS", (0.0, 1250.0))
    tip = pfc_file.load(pfc_file.find(SCHEDULED, TIP_ANGLE), TIP_ANGLE)
    for controller, parameters in (("pfc", GIVEN), ("pfc_tip", tip)):
        found = stability_map(joint1(), controller, parameters)
        assert found.worst < 1.0, controller
        assert found.radius[0.01].shape == (2, 3)


def test_pump_is_short_where_the_load_takes_its_pressure() -> None:
    """The fully open valve cannot have the balance's drop: 1500 kg at 30 deg, not at 60."""
    for degrees, short in ((30.0, True), (60.0, False)):
        point = OperatingPoint(angle=math.radians(degrees), payload=1500.0)
        assert pump_is_short(joint1(), point) is short
        plenty = with_values(joint1(), {"supply.p0": 300e5})
        assert not pump_is_short(plenty, point)

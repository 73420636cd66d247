"""PFC on alpha_6: what it is given, and what it holds."""

import math

import numpy as np
import pytest

from emir_control import pfc_file
from emir_control.pfc import PREVIEW, Pfc
from emir_control.tip import Tip, TipInputs
from emir_control.trajectory import Reference
from emir_plant import linkage
from emir_plant.plant import Plant
from emir_plant.sheet import joint1

DT = 0.032
TIP = Tip(Pfc(pfc_file.load(pfc_file.default_file("tip_angle"), "tip_angle")))
TRIANGLE = Plant(joint1()).record[0]
SAG = -0.0105  # rad, at the tip


def _inputs(stroke: float, angle: float, deflection: float = SAG) -> TipInputs:
    return TipInputs(Reference(stroke, 0.0), [stroke] * PREVIEW, angle, deflection)


def test_a_boom_that_sags_at_rest_is_left_at_rest() -> None:
    angle = math.radians(45.0)
    inputs = _inputs(linkage.stroke(angle, TRIANGLE), angle)
    state = TIP.initial(inputs)
    for _ in range(100):
        state, outputs = TIP.step(state, inputs, DT)
        assert outputs.velocity_command == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("wanted", [44.0, 47.0])
def test_the_model_is_led_to_the_joint_angle_of_the_reference_stroke(wanted: float) -> None:
    """The machine is the model itself; the deflection is of the tip, the joint does the rest."""
    model, start = TIP.pfc.parameters.model, math.radians(45.0)
    x = np.zeros(model.order)
    here = linkage.stroke(start, TRIANGLE)
    state = TIP.initial(_inputs(here, start))
    there = linkage.stroke(math.radians(wanted), TRIANGLE)
    for _ in range(1000):
        alpha_6 = start + SAG + float(model.C @ x)
        state, outputs = TIP.step(state, _inputs(there, alpha_6 - SAG), DT)
        x = model.next(x, outputs.velocity_command)
    assert math.degrees(start + float(model.C @ x)) == pytest.approx(wanted, abs=1e-6)


@pytest.mark.parametrize("field", ["angle", "deflection"])
def test_an_input_that_is_no_number_stops_the_machine_and_is_forgotten(field: str) -> None:
    good = _inputs(0.4, 0.8)
    bad = good._replace(**{field: math.nan})
    state = TIP.initial(bad)
    for inputs in (bad, good, bad, good):
        state, outputs = TIP.step(state, inputs, DT)
        expected = 0.0 if inputs is bad else outputs.velocity_command
        assert outputs.velocity_command == expected
        assert math.isfinite(outputs.velocity_command)
    assert math.isfinite(outputs.unlimited)


def test_reference_beyond_the_linkage_stops_the_machine() -> None:
    state = TIP.initial(_inputs(0.4, 0.8))
    _, outputs = TIP.step(state, _inputs(9.0, 0.8), DT)
    assert outputs.velocity_command == 0.0

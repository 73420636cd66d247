"""The controller's drive and its inverse: consistency, limits, and the machine as the judge."""

import math

import pytest

from emir_control.actuator import Actuator, ActuatorParameters, Oil

DRIVE = Actuator(ActuatorParameters())
OIL = Oil(stroke=0.5, lifting=100e5, lowering=30e5)


@pytest.mark.parametrize("wanted", [-0.04, -0.01, -1e-3, 1e-3, 0.01, 0.04])
@pytest.mark.parametrize("logic", [1.0, 0.2])
def test_inverse_gives_the_wanted_velocity(wanted: float, logic: float) -> None:
    oil = OIL._replace(logic=logic)
    opening = DRIVE.opening(wanted, oil)
    assert DRIVE.velocity(opening, oil) == pytest.approx(wanted, rel=1e-3)
    assert math.copysign(1.0, opening) == math.copysign(1.0, wanted)


def test_full_opening_where_the_drive_cannot_do_more() -> None:
    assert DRIVE.opening(1.0, OIL) == 1.0
    assert DRIVE.opening(-1.0, OIL) == -1.0
    assert DRIVE.command(1.0) == 1.0
    assert DRIVE.command(-1e-9) == pytest.approx(-DRIVE.parameters.static.dead_zone)


def test_no_flow_no_velocity() -> None:
    assert DRIVE.velocity(0.0, OIL) == 0.0
    assert DRIVE.opening(0.0, OIL) == 0.0
    shut = OIL._replace(logic=0.0)
    out, into = DRIVE.flows(-0.5, shut)
    assert out == 0.0
    assert into > 0.0


def test_pump_short_of_pressure_gives_less() -> None:
    low = Actuator(ActuatorParameters(supply=102e5))
    assert 0.0 < low.flows(0.8, OIL)[0] < DRIVE.flows(0.8, OIL)[0]
    assert low.flows(0.8, OIL._replace(lifting=110e5))[0] == 0.0


def test_logic_block_opens_fast_and_shuts_slowly() -> None:
    p = DRIVE.parameters
    assert DRIVE.next_logic(0.0, 50e5, p.opening_time) == pytest.approx(1.0 - math.exp(-1.0))
    assert DRIVE.next_logic(1.0, 30e5, p.closing_time) == pytest.approx(math.exp(-1.0))

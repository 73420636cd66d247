"""Valve, flow paths and logic block in their limit cases."""

import itertools
import math

import numpy as np
import pytest

from emir_common.parameter_tree import with_values
from emir_plant import linkage
from emir_plant.hydraulics import logic_block, valve
from emir_plant.hydraulics.flows import flows, pump_flow
from emir_plant.hydraulics.orifice import turbulent_flow
from emir_plant.plant import Plant
from emir_plant.sheet import joint1

PLANT = Plant(joint1())
P = PLANT.record[0]
BAR = 1e5


def test_orifice_is_turbulent_far_from_zero_and_smooth_at_zero() -> None:
    assert turbulent_flow(100 * BAR, 1e-6) == pytest.approx(1e-6 * math.sqrt(100 * BAR), rel=1e-4)
    assert turbulent_flow(0.0, 1e-6) == 0.0
    assert turbulent_flow(-7 * BAR, 1e-6) == -turbulent_flow(7 * BAR, 1e-6)
    slope = turbulent_flow(1.0, 1e-6)
    assert slope == pytest.approx(1e-6 / math.sqrt(BAR), rel=1e-6)


def test_both_chambers_are_shut_in_the_dead_zone() -> None:
    for spool in np.linspace(-0.1, 0.1, 21):
        assert valve.opening(spool, P) == 0.0
    assert flows(0.0, 100 * BAR, 20 * BAR, 1.0, P) == (0.0, 0.0)
    assert valve.opening(1.0, P) == 1.0
    assert valve.opening(-0.55, P) == pytest.approx(-0.5)


@pytest.mark.parametrize("supply", [100, 150, 200, 250, 320])
def test_flow_is_almost_linear_in_the_current_for_100_to_320_bar(supply: int) -> None:
    """Paper Fig. 5; against the straight line through the flow at half opening."""
    p = Plant(with_values(joint1(), {"supply.p0": supply * BAR})).record[0]
    load = 60 * BAR
    openings = np.linspace(0.05, 1.0, 20)
    flow = np.array([pump_flow(o, p["flow_nominal"], load, p) for o in openings])
    straight = openings * pump_flow(0.5, p["flow_nominal"], load, p) / 0.5
    assert flow == pytest.approx(straight, rel=0.02)


def test_pump_delivers_nothing_against_a_higher_pressure() -> None:
    nominal = P["flow_nominal"]
    assert pump_flow(1.0, nominal, P["p0"], P) == 0.0
    assert pump_flow(1.0, nominal, P["p0"] + 50 * BAR, P) == 0.0  # check valve
    falling = [pump_flow(1.0, nominal, p, P) for p in np.linspace(0, 200, 41) * BAR]
    assert all(a >= b for a, b in itertools.pairwise(falling))


def test_return_flow_meets_the_series_of_resistances() -> None:
    """Lowering: the pressure drops over edge, line and block add up to p_H - p_T."""
    opening, logic = -0.4, 0.7
    flow = -flows(opening, 120 * BAR, 50 * BAR, logic, P)[0]
    resistance = P["k_meter_out_lowering"] / opening**2 + P["k_return_line"]
    resistance += P["k_block_out"] / logic**2
    assert resistance * flow**2 == pytest.approx(120 * BAR - P["pT"], rel=1e-3)


def test_closed_logic_block_lets_nothing_out() -> None:
    out, inflow = flows(-0.5, 120 * BAR, 50 * BAR, 0.0, P)
    assert out == 0.0
    assert inflow > 0.0


def test_logic_block_opens_fast_and_closes_slowly() -> None:
    above, below = P["threshold"] + BAR, P["threshold"] - BAR
    assert logic_block.opening_rate(0.0, above, P) == pytest.approx(1.0 / 0.02)
    assert logic_block.opening_rate(1.0, below, P) == pytest.approx(-1.0 / 0.3)


def test_steady_lifting_speed_is_the_nominal_flow_over_the_area() -> None:
    start = PLANT.initial(math.radians(30.0), 20 * BAR)
    run = PLANT.simulate(start, np.full(1200, 0.55), 1e-2)
    time = np.arange(run.shape[0]) * 1e-2
    speed = np.polyfit(time[200:], run[200:, 2], 1)[0]  # the swinging about it averaged out
    assert speed == pytest.approx(0.5 * P["flow_nominal"] / P["area_lifting"], rel=0.03)


def test_lever_arm_is_the_derivative_of_the_stroke() -> None:
    for angle in np.radians(np.linspace(-10, 90, 21)):
        step = 1e-5
        slope = linkage.stroke(angle + step, P) - linkage.stroke(angle - step, P)
        assert linkage.lever_arm(angle, P) == pytest.approx(slope / (2 * step), rel=1e-8)
        assert linkage.angle(linkage.stroke(angle, P), P) == pytest.approx(angle, abs=1e-12)
    assert linkage.stroke(0.0, P) == 0.0

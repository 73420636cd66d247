"""Valve, flow paths and logic block in their limit cases."""

import itertools
import math

import numpy as np
import pytest

from emir_common.parameter_tree import with_values
from emir_plant import core, linkage
from emir_plant.core import Truth
from emir_plant.hydraulics import logic_block, valve
from emir_plant.hydraulics.flows import Edges, Pressures, flows, pump_flow
from emir_plant.hydraulics.orifice import turbulent_flow
from emir_plant.plant import Plant
from emir_plant.sheet import even_edges, joint1

PLANT = Plant(joint1())
P = PLANT.record[0]
BAR = 1e5


def _edges(opening: float) -> Edges:
    """Both metering edges open alike."""
    return Edges(opening, opening)


def test_orifice_is_turbulent_far_from_zero_and_smooth_at_zero() -> None:
    assert turbulent_flow(100 * BAR, 1e-6) == pytest.approx(1e-6 * math.sqrt(100 * BAR), rel=1e-4)
    assert turbulent_flow(0.0, 1e-6) == 0.0
    assert turbulent_flow(-7 * BAR, 1e-6) == -turbulent_flow(7 * BAR, 1e-6)
    slope = turbulent_flow(1.0, 1e-6)
    assert slope == pytest.approx(1e-6 / math.sqrt(BAR), rel=1e-6)


def test_both_chambers_are_shut_in_the_dead_zone() -> None:
    for spool in np.linspace(-0.1, 0.1, 21):
        assert valve.opening(spool, P) == 0.0
    assert flows(_edges(0.0), Pressures(P["p0"], 100 * BAR, 20 * BAR), 1.0, P) == (0.0, 0.0)
    assert valve.opening(1.0, P) == 1.0
    assert valve.opening(-0.55, P) == pytest.approx(-0.5)


@pytest.mark.parametrize("supply", [100, 150, 200, 250, 320])
def test_flow_is_almost_linear_in_the_current_for_100_to_320_bar(supply: int) -> None:
    """Paper Fig. 5; against the straight line through the flow at half opening."""
    p = Plant(with_values(joint1(), {"supply.p0": supply * BAR})).record[0]
    load = 60 * BAR
    openings = np.linspace(0.05, 1.0, 20)
    flow = np.array([pump_flow(o, p["flow_nominal"], p["p0"], load, p) for o in openings])
    straight = openings * pump_flow(0.5, p["flow_nominal"], p["p0"], load, p) / 0.5
    assert flow == pytest.approx(straight, rel=0.02)


def test_pump_delivers_nothing_against_a_higher_pressure() -> None:
    nominal = P["flow_nominal"]
    supply = P["p0"]
    assert pump_flow(1.0, nominal, supply, supply, P) == 0.0
    assert pump_flow(1.0, nominal, supply, supply + 50 * BAR, P) == 0.0  # check valve
    falling = [pump_flow(1.0, nominal, supply, p, P) for p in np.linspace(0, 200, 41) * BAR]
    assert all(a >= b for a, b in itertools.pairwise(falling))


def test_return_flow_meets_the_series_of_resistances() -> None:
    """Lowering: the pressure drops over edge, line and block add up to p_H - p_T."""
    opening, logic = -0.4, 0.7
    flow = -flows(_edges(opening), Pressures(P["p0"], 120 * BAR, 50 * BAR), logic, P)[0]
    resistance = P["k_meter_out_lowering"] / opening**2 + P["k_return_line"]
    resistance += P["k_block_out"] / logic**2
    assert resistance * flow**2 == pytest.approx(120 * BAR - P["pT"], rel=1e-3)


def test_pressure_balance_in_the_return_lowers_any_load_alike() -> None:
    p = Plant(even_edges()).record[0]
    for opening in (-0.2, -0.6, -1.0):
        out = [flows(_edges(opening), Pressures(p["p0"], load, BAR), 1.0, p)[0]
               for load in np.array([20, 80, 300]) * BAR]  # fmt: skip
        assert out == pytest.approx([opening * p["flow_nominal"]] * 3)
    short = flows(_edges(-1.0), Pressures(p["p0"], 5 * BAR, BAR), 1.0, p)[0]
    resistance = p["k_meter_out_lowering"] + p["k_return_line"] + p["k_block_out"]
    assert resistance * short**2 == pytest.approx(5 * BAR - p["pT"], rel=0.1)  # laminar below 1 bar
    assert short > -p["flow_nominal"]


def test_lowering_chamber_is_fed_up_to_its_limit_and_never_drained_to_the_pump() -> None:
    p = Plant(even_edges()).record[0]
    inflow = [flows(_edges(-0.5), Pressures(p["p0"], 100 * BAR, at), 1.0, p)[1]
              for at in (0.0, p["limit_lowering"], 50 * BAR)]  # fmt: skip
    resistance = p["k_pump_line"] + p["k_block_in"]
    resistance += p["balance_pressure"] / (0.5 * p["flow_nominal"]) ** 2
    assert resistance * inflow[0] ** 2 == pytest.approx(p["limit_lowering"], rel=0.01)
    assert inflow[1:] == [0.0, 0.0]


def test_closed_logic_block_lets_nothing_out() -> None:
    out, inflow = flows(_edges(-0.5), Pressures(P["p0"], 120 * BAR, 50 * BAR), 0.0, P)
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
    angles, step = np.radians(np.linspace(-10, 90, 21)), 1e-5
    slopes = (linkage.strokes(angles + step, P) - linkage.strokes(angles - step, P)) / (2 * step)
    assert linkage.lever_arms(angles, P) == pytest.approx(slopes, rel=1e-8)
    for angle, slope in zip(angles, slopes, strict=True):
        assert linkage.lever_arm(angle, P) == pytest.approx(slope, rel=1e-8)
        assert linkage.angle(linkage.stroke(angle, P), P) == pytest.approx(angle, abs=1e-12)
    assert linkage.stroke(0.0, P) == 0.0


def test_logic_block_is_piloted_by_the_chamber_that_is_stated() -> None:
    assert joint1().logic_block.pilot == 0  # the paper's reading
    low = Plant(with_values(joint1(), {"logic_block.pilot": 1})).record[0]
    high, little = 90 * BAR, 10 * BAR
    assert logic_block.pilot_pressure(high, little, P) == high
    assert logic_block.pilot_pressure(high, little, low) == little
    assert logic_block.is_piloted(0.0, high, P)
    assert not logic_block.is_piloted(0.0, little, P)


def test_a_block_that_the_lowering_chamber_pilots_waits_for_its_pressure() -> None:
    plant = Plant(with_values(joint1(), {"logic_block.pilot": 1}))
    start = plant.initial(math.radians(45.0), 5 * BAR)
    run = plant.simulate(start, np.full(600, -0.5), 1e-3)
    flow = -run[:, Truth._fields.index("flow_lifting")]
    pilot = run[:, Truth._fields.index("pressure_lowering")]
    moves = int(np.argmax(flow > 0.0))
    assert flow[0] == 0.0
    assert pilot[moves] == pytest.approx(P["threshold"], rel=0.05)


@pytest.mark.parametrize("chamber", ["pressure_lifting", "pressure_lowering"])
def test_relief_valve_limits_the_pressure_of_a_chamber(chamber: str) -> None:
    """Nothing leaves at the relief pressure; above it the flow grows with the excess."""
    limit = 70 * BAR
    plant = Plant(with_values(joint1(), {"cylinder.relief_pressure": limit}))
    state = plant.initial(math.radians(45.0), 20 * BAR)
    index = core.P_H if chamber == "pressure_lifting" else core.P_S
    state[index] = limit
    below = plant.derivative(state, 0.0)[index]
    state[index] = limit + 10 * BAR
    above = plant.derivative(state, 0.0)[index]
    c, h = plant.machine.cylinder, plant.outputs(state).stroke
    volume = {
        core.P_H: c.volume_lifting_0 + c.area_lifting * h,
        core.P_S: c.volume_lowering_0 - c.area_lowering * h,
    }[index]
    assert below == pytest.approx(0.0, abs=1e-6)
    assert above == pytest.approx(-c.relief_slope * 10 * BAR * c.beta / volume)


def test_a_machine_whose_sheet_says_nothing_of_relief_valves_has_none() -> None:
    from dataclasses import fields

    from emir_plant.hydraulics import chambers
    from emir_plant.parameters import Cylinder, LogicBlock

    neutral = {f.name: f.default for f in (*fields(Cylinder), *fields(LogicBlock))}
    values = {f"cylinder.{n}": neutral[n] for n in ("relief_pressure", "relief_slope")}
    p = Plant(with_values(joint1(), values)).record[0]
    assert chambers.relief_flow(2000 * BAR, p) == 0.0
    assert neutral["pilot"] == 0

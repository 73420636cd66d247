"""The paper's figures 3, 5 and 7 and the table against beams, balances and known signals."""

import json
import math
import re
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from emir_analysis import paper_numbers_machine, paper_numbers_robot
from emir_analysis.cli import main
from emir_analysis.figure_boom import PERIOD, REST_PRESSURE, STEP_SIZE, SWING, deflections
from emir_analysis.figure_flow import stationary
from emir_analysis.figure_steps import (
    BALANCE_IN_INLET,
    BLOCK_OPEN,
    FULL_SUPPLY,
    LIFTING,
    LOWERING,
    NARROW_RETURN,
    SIZES,
    STANDARD,
    StepResponses,
    slow_mode,
    step_responses,
)
from emir_analysis.paper_number import NO, NOT_MEASURED, YES
from emir_common.parameter_tree import with_values
from emir_plant import linkage
from emir_plant.core import Truth
from emir_plant.linearize import linearize
from emir_plant.plant import Plant
from emir_plant.sheet import even_edges, joint1

FORTY_FIVE = math.radians(45.0)
MACHINE = joint1()


@pytest.fixture(scope="module")
def steps() -> StepResponses:
    return step_responses(even_edges())


def test_boom_at_rest_is_the_line_of_the_uniform_beam() -> None:
    g = MACHINE.geometry
    springs = g.arms * (g.sections_per_arm - 1)
    bending_stiffness = g.section_spring * g.boom_length / springs
    load = g.boom_mass / g.boom_length * 9.81 * math.cos(FORTY_FIVE)
    found = deflections(MACHINE)
    x, length = found.along, g.boom_length
    beam = load * x**2 * (6.0 * length**2 - 4.0 * length * x + x**2) / (24.0 * bending_stiffness)
    assert found.static == pytest.approx(-beam, abs=0.03 * beam[-1])


def test_swinging_boom_ends_where_the_plant_has_its_tcp() -> None:
    plant, found = Plant(MACHINE), deflections(MACHINE)
    commands = np.full(round(SWING / PERIOD), STEP_SIZE)
    run = plant.simulate(plant.initial(FORTY_FIVE, REST_PRESSURE), commands, PERIOD)
    tcp = run[1:, Truth._fields.index("tcp_deflection")]
    assert found.lowest[-1] == pytest.approx(tcp.min(), rel=1e-6)
    assert found.highest[-1] == pytest.approx(tcp.max(), rel=1e-6)


@pytest.mark.parametrize(("supply", "current"), [(50e5, 1.0), (50e5, 0.7), (100e5, 0.5)])
def test_flow_is_that_of_the_resistances_in_series(supply: float, current: float) -> None:
    """By hand: all drops grow with Q^2; the pressure balance allows o Q_n at most."""
    force, r, v, c = 2e5, MACHINE.resistances, MACHINE.valve, MACHINE.cylinder
    opening, ratio = (current - v.dead_zone) / (1.0 - v.dead_zone), c.area_lowering / c.area_lifting
    most = opening * v.flow_nominal
    into = r.k_pump_line + r.k_block_in + v.balance_pressure / most**2
    out = r.k_meter_out_lifting / opening**2 + r.k_return_line
    left = supply - force / c.area_lifting - MACHINE.supply.pT * ratio
    by_hand = min(most, math.sqrt(left / (into + out * ratio**3)))
    assert stationary(MACHINE, force, supply, current) == pytest.approx(by_hand, rel=0.01)


def test_no_flow_in_the_dead_zone_or_against_too_much_load() -> None:
    assert stationary(MACHINE, 2e5, 200e5, 0.09) == 0.0
    assert stationary(MACHINE, 2e6, 200e5, 1.0) == 0.0


@pytest.mark.parametrize("drift", [0.0, -0.2])
@pytest.mark.parametrize(("frequency", "damping"), [(0.7, 0.005), (0.5, 0.15), (0.9, 0.05)])
def test_slow_mode_of_a_known_signal(frequency: float, damping: float, drift: float) -> None:
    time = np.arange(0.0, 4.7, 5e-3)
    w = 2.0 * math.pi * frequency
    phase = w * math.sqrt(1.0 - damping**2) * (time + 0.5 * drift * time**2 / time[-1])
    swing = np.exp(-damping * w * time) * np.cos(phase + 1.0)
    bending = 0.1 * np.sin(2.0 * math.pi * 7.0 * time)
    found = slow_mode(time, 1.0 + 0.2 * time - 0.02 * time**2 + swing + bending)
    assert found.frequency == pytest.approx(frequency, rel=0.02)
    assert found.damping == pytest.approx(damping, abs=0.01)


def test_smallest_step_swings_with_the_linear_models_mode(steps: StepResponses) -> None:
    """The standard machine's edges are narrow: it swings as with the valve shut."""
    plant = Plant(MACHINE)
    frequency, _ = linearize(plant, plant.initial(FORTY_FIVE, REST_PRESSURE)).modes()
    for direction in (LIFTING, LOWERING):
        mode = steps.of(45.0, direction, STANDARD)[0].mode
        assert mode.frequency == pytest.approx(frequency[0], rel=0.03)


@pytest.mark.parametrize("direction", [LIFTING, LOWERING])
def test_damping_falls_with_the_step_as_the_paper_says(
    steps: StepResponses, direction: int
) -> None:
    responses = steps.of(45.0, direction)
    fitted = np.array([r.mode.damping for r in responses])
    assert np.all(np.diff(fitted) < 0.0)
    assert fitted == pytest.approx([r.linear for r in responses], abs=0.003)


def test_damping_by_hand(steps: StepResponses) -> None:
    """The open chamber is a spring with a leak of time constant tau = V / (beta dQ/dp).

    Its loss is k w tau / (1 + (w tau)^2), w that of the mode. Oil and boom are springs in series:
    the oil has w^2 m / k of the energy, the boom the rest, damped by a hundredth.
    """
    machine, start = even_edges(), Plant(even_edges()).initial(FORTY_FIVE)
    c, r, g = machine.cylinder, machine.resistances, machine.geometry
    stroke = Plant(machine).outputs(start).stroke
    arm = linkage.lever_arm(FORTY_FIVE, Plant(machine).record[0])
    mass = g.boom_mass * g.boom_length**2 / 3.0 / arm**2
    volume = c.volume_lowering_0 - c.area_lowering * stroke
    leaking = c.beta * c.area_lowering**2 / volume
    shut = c.beta * c.area_lifting**2 / (c.volume_lifting_0 + c.area_lifting * stroke)
    for found in steps.of(45.0, LIFTING):
        w = 2.0 * math.pi * found.mode.frequency
        opening = (found.size - 0.1) / 0.9
        flow = opening * machine.valve.flow_nominal * c.area_lowering / c.area_lifting
        slope = 1.0 / (2.0 * (r.k_meter_out_lifting / opening**2 + r.k_return_line) * flow)
        wt = w * volume / (c.beta * slope)
        oil = shut + leaking * wt**2 / (1.0 + wt**2)
        share = w**2 * mass / oil
        by_hand = share * 0.5 * leaking / oil * wt / (1.0 + wt**2) + (1.0 - share) * 0.01
        assert found.mode.damping == pytest.approx(by_hand, rel=0.1, abs=0.003)


def test_other_edges_turn_the_trend_of_the_damping(steps: StepResponses) -> None:
    for other in (NARROW_RETURN, BALANCE_IN_INLET):
        damping = [r.mode.damping for r in steps.of(45.0, other.direction, other.name)]
        assert np.all(np.diff(damping[1:]) > 0.0)
        assert damping[-1] > 5.0 * steps.of(45.0, other.direction)[-1].mode.damping
    for direction in (LIFTING, LOWERING):
        damping = [r.mode.damping for r in steps.of(45.0, direction, STANDARD)]
        assert np.all(np.diff(damping) > 0.0)


def test_logic_block_interrupts_lowering_where_the_pressure_swings_low(
    steps: StepResponses,
) -> None:
    closings = [r.interruptions for r in steps.of(45.0, LOWERING)]
    threshold = even_edges().logic_block.threshold
    assert [n > 0 for n in closings] == [r.lowest < threshold for r in steps.of(45.0, LOWERING)]
    assert closings[-1] > 2
    assert steps.of(45.0, LOWERING)[-1].least_flow < 0.8
    for other in (BLOCK_OPEN, FULL_SUPPLY):
        assert [r.interruptions for r in steps.of(45.0, LOWERING, other.name)] == [0] * len(SIZES)
    assert steps.of(45.0, LOWERING, BLOCK_OPEN.name)[-1].least_flow > 0.99


def test_without_pinocchio_the_robots_numbers_are_not_measured(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(paper_numbers_robot, "find_spec", lambda _: None)
    found = paper_numbers_robot.measure()
    assert {n.number for n in found} == {2, 4, 5, 7, 11}
    assert all(n.met == NOT_MEASURED and "emir_ros[robot]" in n.reason for n in found)


@pytest.mark.skipif(not find_spec("pinocchio"), reason="Pinocchio is missing: extra robot")
def test_stretched_and_locked_robot_is_joint_1s_own_model() -> None:
    found = {n.what: n for n in paper_numbers_robot.measure()}
    assert [n.what for n in found.values() if n.met != YES] == []
    uniform = 5.4  # Hz, of the uniform boom; sagging 17.7 cm
    assert float(found["slowest mode, whole robot"].ours.split()[0]) == pytest.approx(
        uniform, rel=0.03
    )
    assert float(found["static deflection, whole robot"].ours.split()[0]) == pytest.approx(
        17.7, rel=0.04
    )


def test_table_follows_the_machine(steps: StepResponses) -> None:
    """Another machine misses what the standard one meets: nothing of ours is written down."""
    other = with_values(
        MACHINE,
        {
            "geometry.section_spring": 1e8,
            "valve.dead_zone": 0.05,
            "valve.natural_frequency": 100.0,
            "logic_block.time_constant_closing": 1.0,
            "cylinder.beta": 2e9,
            "sensors.resolver_bits": 10,
        },
    )
    met = {n.what: n.met for n in paper_numbers_machine.measure(other, steps)}
    missed = [what for what, said in met.items() if said == NO and "step" not in what]
    assert missed == [
        "slowest mode of the mechanics",
        "static deflection of the TCP",
        "rigid mechanics on the oil",
        "dominant mode",
        "valve: dead zone",
        "valve: bandwidth",
        "logic block",
        "position resolver",
    ]


def test_command_draws_and_writes_the_table(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["figures", str(tmp_path / "new"), "--only", "3,5,7"]) == 0
    names = ["figure_03.png", "figure_05.png", "figure_07.png", "table.json", "table.md"]
    assert sorted(file.name for file in (tmp_path / "new").iterdir()) == names
    assert capsys.readouterr().out.count("\n") == len(names)
    table = json.loads((tmp_path / "new" / "table.json").read_text())
    assert {row["number"] for row in table["numbers"]} == set(range(1, 20))
    for row in table["numbers"]:
        assert row["met"] in {"yes", "no", "not measured"}
        assert row["met"] == "yes" or row["reason"]
    counts = next(row for row in table["numbers"] if row["number"] == 2)
    assert counts["met"] == ("yes" if find_spec("pinocchio") else "not measured")
    text = (tmp_path / "new" / "table.md").read_text()
    documented = (Path(__file__).parents[2] / "docs" / "robot.md").read_text().splitlines()
    rows = [line for line in documented if re.match(r"\| [1-5] \| [-0]", line)]
    assert len(rows) == 5
    assert all(row in text for row in rows)  # range, ratio and dead points of the linkages
    assert all(row["ours"] in text for row in table["numbers"])


def test_bad_input_is_one_clear_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("")
    assert main(["figures", str(tmp_path / "file")]) == 1
    assert capsys.readouterr().err == f"emir figures: {tmp_path / 'file'}: File exists\n"
    assert main(["figures", str(tmp_path), "--only", "6"]) == 1
    assert "figure 6: there are 3, 5, 7, 9, 11, 12" in capsys.readouterr().err

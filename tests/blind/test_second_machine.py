"""The blind test's machine beside the project's: two formulations, two integrators, one physics."""

import ast
import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import emir_analysis.blind
from emir_analysis.blind import hidden_mechanics, hidden_oil, hidden_sensors, hidden_valve
from emir_analysis.blind.boom import boom
from emir_analysis.blind.catalogue import CATALOGUE
from emir_analysis.blind.hidden import Hidden
from emir_analysis.blind.machine import Array, Machine
from emir_analysis.blind.numbers import DATA_SHEET, read_numbers
from emir_analysis.blind.plan import foreign_effects
from emir_analysis.blind.puzzle import ATTEMPTS, STRONGER
from emir_analysis.blind.recording import Run, Start, repeated
from emir_common.parameter_tree import with_values
from emir_plant.boom import PointMass, boom_modes
from emir_plant.parameters import GRAVITY
from emir_plant.plant import Plant
from emir_plant.sensors import readings
from emir_plant.sheet import load_sheet

STATED = read_numbers(DATA_SHEET).numbers
SHEET = load_sheet(DATA_SHEET, strict=True).machine
START = Start(1.15, 25e5)
SIGNALS = {  # a tenth of the sensor noise, or of the resolver's step as RMS
    "angle": 1e-5,
    "pressure_lifting": 2e3,
    "pressure_lowering": 2e3,
    "deflection": 2e-6,
}


def moves(seconds: float) -> Array:
    """Return up, rest, down hard, so that the logic block shuts: commands every 32 ms."""
    time = np.arange(0.0, seconds, STATED.command_period)
    command = np.where(time < 0.3, 0.0, 0.55)
    command[time > 0.3 * seconds] = 0.0
    command[time > 0.4 * seconds] = -0.9
    command[time > 0.75 * seconds] = 0.3
    return command


def jerks(seconds: float) -> Array:
    """Return down hard and less so in turn: the logic block shuts and opens again on the way."""
    time = np.arange(0.0, seconds, STATED.command_period)
    command = np.where(time % 1.0 < 0.5, -1.0, -0.5)
    command[time < 1.0] = 0.5
    return command


def of_plant(effects: dict[str, float], commands: Array) -> dict[str, Array]:
    """Return what the sensors of the project's machine show, without noise."""
    machine = with_values(SHEET, {f"effects.{path}": value for path, value in effects.items()})
    plant = Plant(machine)
    state = plant.initial(START.angle, START.p_s)
    truth = plant.simulate(state, np.repeat(commands, 32), 1e-3, 10)
    return readings(plant, truth, 0.01)._asdict()


def apart(run: Run, other: dict[str, Array]) -> dict[str, float]:
    """Return the RMS between two runs by signal."""

    def rms(name: str) -> float:
        shown = run.shown[name]
        return float(np.sqrt(np.mean((shown - other[name][: shown.size]) ** 2)))

    return {name: rms(name) for name in SIGNALS}


def test_what_is_judged_has_no_share_in_the_question() -> None:
    folder = Path(emir_analysis.blind.__file__).parent
    files = list(folder.rglob("*.py"))
    assert folder / "machine.py" in files
    assert folder / "actuator" / "machine.py" in files
    for file in files:
        for node in ast.walk(ast.parse(file.read_text())):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [str(node.module)] if isinstance(node, ast.ImportFrom) else []
            for name in names:
                assert not name.startswith(("emir_plant", "emir_analysis.diagnosis")), file.name


@pytest.mark.parametrize("payload", [0.0, 700.0])
@pytest.mark.parametrize("carried", [(0.0, 1.0), (300.0, 0.37), (200.0, 1.08)])
def test_finite_elements_have_the_modes_of_the_section_chain(
    payload: float, carried: tuple[float, float]
) -> None:
    mass, place = carried
    elements = boom(replace(STATED, payload=payload, carried=mass, carried_at=place))
    chain = boom_modes(replace(SHEET.geometry, payload=payload), PointMass(mass, place))
    sign = np.sign(elements.tip)
    np.testing.assert_allclose(elements.stiffness, chain.frequency**2, rtol=1e-6, atol=1e-3)
    np.testing.assert_allclose(elements.joint * sign, chain.joint, rtol=1e-6)
    np.testing.assert_allclose(elements.tip_angle * sign, chain.tip_angle, rtol=1e-6)
    np.testing.assert_allclose(elements.weight * sign, chain.weight, rtol=1e-6, atol=1e-6)


def test_a_healthy_machine_moves_as_the_projects_own() -> None:
    commands = moves(10.0)
    run = repeated(Machine(STATED), START, commands)
    assert np.ptp(run.shown["angle"]) > 0.2
    assert run.shown["pressure_lifting"].min() < STATED.threshold  # the logic block works
    for name, error in apart(run, of_plant({}, commands)).items():
        assert error < SIGNALS[name], name


# sizes here, and the same in the registry
SAME: dict[type[Hidden], tuple[dict[str, float], dict[str, float]]] = {
    hidden_mechanics.CoulombFriction: (
        {"coulomb_force": 2e4, "coulomb_smoothing": 1e-3},
        {"force": 2e4, "smoothing_speed": 1e-3, "gradual_share": 1.0},
    ),
    hidden_mechanics.StribeckFriction: (
        {
            "stribeck_force": 1e4,
            "stribeck_breakaway": 2.0,
            "stribeck_speed": 1e-2,
            "stribeck_smoothing": 1e-3,
        },
        {
            "force": 1e4,
            "breakaway": 2.0,
            "stribeck_speed": 1e-2,
            "smoothing_speed": 1e-3,
            "gradual_share": 1.0,
        },
    ),
    hidden_mechanics.ViscousFriction: ({"viscous": 2e5}, {"coefficient": 2e5}),
    hidden_mechanics.PressureDependentFriction: (
        {"share_of_load": 0.03, "share_smoothing": 1e-3},
        {"coefficient": 0.03, "smoothing_speed": 1e-3, "gradual_share": 1.0},
    ),
    hidden_mechanics.Payload: ({"mass": 300.0}, {"mass": 300.0}),
    hidden_mechanics.ExternalLoad: (
        {"load": 1e3, "load_start": 1.0, "load_duration": 2.0, "load_frequency": 0.0},
        {"force": 1e3, "start": 1.0, "duration": 2.0},
    ),
    hidden_mechanics.LinkageError: (
        {"arm_scale": 0.01, "arm_slope": -0.03},
        {"scale": 0.01, "slope": -0.03},
    ),
    hidden_oil.InternalLeakage: ({"past_piston": 1e-11}, {"coefficient": 1e-11}),
    hidden_oil.ExternalLeakage: ({"leak_lowering": 1e-11}, {"lowering": 1e-11}),
    hidden_oil.EntrainedAir: (
        {"air": 0.02, "polytropic": 1.2, "swells_down_to": 5e3},
        {"share": 0.02, "exponent": 1.2, "least_pressure": 5e3},
    ),
    hidden_oil.VesselCompliance: ({"hose_lifting": 5e-11}, {"lifting": 5e-11}),
    hidden_oil.SupplyPressureDroop: (
        {"droop": 2e10, "droop_time": 0.2},
        {"resistance": 2e10, "time_constant": 0.2},
    ),
    hidden_valve.ValveNullOffset: ({"null": 0.03}, {"offset": 0.03}),
    hidden_valve.ValveGainAsymmetry: ({"gain_lowering": 0.1}, {"lowering": 0.1}),
    hidden_valve.ValveDeadZoneError: ({"overlap": 0.03}, {"error": 0.03}),
    hidden_valve.ValveHysteresis: ({"spool_play": 0.04}, {"width": 0.04}),
    hidden_valve.CommandDelay: ({"late": 0.045}, {"delay": 0.045}),
    hidden_valve.FlowGainDrift: (
        {"drift": 0.3, "drift_time": 10.0},
        {"change": -0.3 * math.expm1(-6.0), "time_constant": 10.0},  # in a minute
    ),
    hidden_oil.LogicBlockFault: ({"threshold_off": 3e6}, {"threshold": 3e6}),
    hidden_mechanics.Backlash: (
        {"gap": 3e-3, "seating": 2e5, "crossing": 0.02},
        {"gap": 3e-3, "seating_force": 2e5, "crossing_time": 0.02, "gradual_share": 1.0},
    ),
    hidden_sensors.SensorBias: ({"bias_angle": 0.01}, {"angle": 0.01}),
    hidden_sensors.SensorGain: ({"gain_pressure_lifting": 0.03}, {"pressure_lifting": 0.03}),
    hidden_sensors.SensorDelay: ({"lag_pressure_lowering": 0.05}, {"pressure_lowering": 0.05}),
}


_OTHERS = foreign_effects((Path(__file__).parent / "foreign_forms.py").read_text(), Hidden)
_OTHER = {kind.name: kind for kind in _OTHERS}
FORMS: dict[type[Hidden], tuple[dict[str, float], dict[str, float]]] = {
    _OTHER["internal_leakage~turbulent"]: (  # 1e-11 (100 bar)^0.5
        {"scratch": 1e-11 * 1e7**0.5},
        {"coefficient": 1e-11, "turbulent_share": 1.0},
    ),
    _OTHER["external_leakage~turbulent"]: (
        {"drip": 1e-11 * 1e7**0.5},
        {"lifting": 1e-11, "turbulent_share": 1.0},
    ),
    _OTHER["sensor_delay~dead time"]: (
        {"late_pressure_lifting": 0.037},
        {"pressure_lifting": 0.037, "dead_share": 1.0},
    ),
    _OTHER["flow_gain_drift~linear"]: ({"per_minute": 0.6}, {"change": 0.6, "time_constant": 1e5}),
    _OTHER["flow_gain_drift~at the inlet"]: (
        {"inlet_per_minute": 0.6},
        {"change": 0.6, "time_constant": 1e5, "inlet_share": 1.0},
    ),
    _OTHER["valve_gain_asymmetry~at the inlet"]: (
        {"inlet_lifting": 0.2},
        {"lifting": 0.2, "inlet_share": 1.0},
    ),
    _OTHER["external_load~on the piston"]: (
        {"leans": 4e4, "leans_at": 0.7, "leans_for": 2.0},
        {
            "force": 4e4 * STATED.triangle_b / STATED.boom_length,
            "start": 0.7,
            "rise": 0.3,
            "duration": 1.7,
            "piston_share": 1.0,
        },
    ),
    _OTHER["external_load~about the joint"]: (
        {"torque": 2e4, "torque_at": 0.7, "turns_at": 0.4},
        {
            "force": 2e4 / STATED.boom_length,
            "frequency": 0.4,
            "start": 0.7,
            "joint_share": 1.0,
        },
    ),
    _OTHER["external_load~vertical"]: (
        {"hung_on": -1e3, "hung_at": 0.7, "swings_at": 0.4},
        {"force": -1e3, "frequency": 0.4, "start": 0.7, "vertical_share": 1.0},
    ),
    _OTHER["external_load~filling hose"]: (
        {"concrete": 100.0, "filling_from": 0.7, "filling_for": 0.8},
        {"force": -100.0 * GRAVITY, "start": 0.7, "rise": 0.8, "vertical_share": 1.0},
    ),
    _OTHER["external_load~slow"]: (
        {"pull": 1e3, "comes_at": 0.7, "comes_in": 0.8, "stays": 2.0},
        {"force": 1e3, "start": 0.7, "rise": 0.8, "duration": 2.0},
    ),
    _OTHER["external_load~mean and swing"]: (
        {"hangs": -500.0, "swings": 0.8, "swing_frequency": 0.4, "swing_phase": 1.2},
        {"mean": -500.0, "force": -400.0, "frequency": 0.4, "phase": 1.2},
    ),
    _OTHER["payload~elsewhere"]: (
        {"hung_mass": 300.0, "hung_place": 0.72},
        {"mass": 300.0, "place": 0.72},
    ),
    _OTHER["logic_block_fault~blocked"]: ({"in_the_way": 0.6}, {"blocked": 0.6}),
    _OTHER["logic_block_fault~slow to open"]: (
        {"opens_in": 0.8, "opens_at": 1.2},
        {
            "opening": 0.8 / STATED.time_constant_opening - 1.0,
            "threshold": 0.2 * STATED.threshold,
        },
    ),
    _OTHER["logic_block_fault~held open"]: (
        {"opens_at": 2.0, "shuts_lower": 0.4},
        {"threshold": STATED.threshold, "hysteresis": 0.8 * STATED.threshold},
    ),
    _OTHER["vessel_compliance~beta"]: (
        {"softer": -0.3, "where": 1.0},
        {"lowering": -0.3 * STATED.volume_lowering_0 / STATED.beta, "wall_share": 1.0},
    ),
    _OTHER["valve_dead_zone_error~same slope"]: ({"moved": 0.03}, {"error": 0.03, "rescaled": 0.0}),
    _OTHER["valve_dead_zone_error~one edge"]: (
        {"ground": 0.04, "lifts": -1.0},
        {"error": 0.04, "edge": -1.0},
    ),
    _OTHER["supply_pressure_droop~square"]: (
        {"at_full_flow": 8e6},
        {
            "resistance": 8e6 / STATED.flow_nominal,
            "time_constant": 0.02,
            "turbulent_share": 1.0,
        },
    ),
    _OTHER["valve_hysteresis~on the command"]: (
        {"magnet": 0.04},
        {"width": 0.04, "command_share": 1.0},
    ),
    _OTHER["command_delay~lag"]: ({"filtered": 0.04}, {"delay": 0.04, "lag_share": 1.0}),
    _OTHER["stribeck_friction~bristles"]: (
        {
            "slides": 1e4,
            "breaks_away": 1.6,
            "falls_at": 8e-3,
            "gives": 5e-5,
            "bristle_time": 1.5e-3,
        },
        {
            "force": 1e4,
            "breakaway": 1.6,
            "stribeck_speed": 8e-3,
            "presliding": 5e-5,
            "presliding_time": 1.5e-3,
        },
    ),
    _OTHER["pressure_dependent_friction~bristles"]: (
        {"rubs": 0.03, "gives": 5e-5, "bristle_time": 0.0},
        {"coefficient": 0.03, "presliding": 5e-5},
    ),
    _OTHER["coulomb_friction~elastic bristles"]: (  # a step in the middle of his transition
        {
            "slides": 2e4,
            "gives": 2e-4,
            "springs_to": 0.75,
            "slides_from": 0.85,
            "bristle_time": 0.0,
        },
        {"force": 2e4, "presliding": 2e-4, "elastic_share": 0.8},
    ),
    _OTHER["pressure_dependent_friction~seals"]: (
        {"seals_rub": 0.03, "rubs_from": 1e-3},
        {"coefficient": 0.03, "smoothing_speed": 1e-3, "gradual_share": 1.0, "seal_share": 1.0},
    ),
    _OTHER["coulomb_friction~by_direction"]: (
        {"rub": 1.6e4, "less": 0.5},
        {"force": 1.2e4, "smoothing_speed": 1e-3, "gradual_share": 1.0, "asymmetry": 1.0 / 3.0},
    ),
    _OTHER["viscous_friction~square"]: (
        {"film": 5e4, "gap": 4e6},
        {"coefficient": 5e4, "square": 4e6},
    ),
}


@cache
def healthy(moved: Callable[[float], Array]) -> dict[str, Array]:
    """Return what the sensors of the project's machine without effects show over some moves."""
    return of_plant({}, moved(5.0))


@pytest.mark.parametrize("kind", SAME | FORMS, ids=lambda kind: kind.name)
def test_an_effect_written_twice_does_the_same(kind: type[Hidden]) -> None:
    moved = jerks if kind.name == "logic_block_fault~slow to open" else moves
    commands = moved(5.0)
    here, there = (SAME | FORMS)[kind]
    name = kind.name.split("~")[0]
    run = repeated(kind(STATED, here), START, commands)
    made = apart(run, healthy(moved))
    error = apart(run, of_plant({f"{name}.{k}": v for k, v in there.items()}, commands))
    loudest = max(SIGNALS, key=lambda name: made[name] / SIGNALS[name])
    assert made[loudest] > 10.0 * SIGNALS[loudest]  # else nothing is compared
    # what is left is sampled against continuous
    assert error[loudest] < 0.05 * made[loudest], error


def test_all_of_the_catalogue_is_compared() -> None:
    assert set(CATALOGUE) == SAME.keys()
    assert set(_OTHERS) == FORMS.keys()


def test_two_effects_act_together() -> None:
    commands = moves(5.0)
    both: Any = type("Both", (hidden_valve.ValveNullOffset, hidden_oil.InternalLeakage), {})
    run = repeated(both(STATED, {"null": 0.03, "past_piston": 1e-11}), START, commands)
    names = {"valve_null_offset.offset": 0.03, "internal_leakage.coefficient": 1e-11}
    for name, error in apart(run, of_plant(names, commands)).items():
        assert error < SIGNALS[name], name


def test_any_two_effects_go_together_in_either_order() -> None:
    random = np.random.default_rng(1)
    for one, other in permutations(CATALOGUE, 2):
        both: Any = type("Both", (one, other), {})
        machine = both(STATED, one.draw(random) | other.draw(random))
        x = machine.start(START.angle, START.p_s)
        assert np.isfinite(machine.rates(x, 0.0, 0.0)).all(), (one.name, other.name)


@pytest.mark.parametrize(
    "file",
    [
        "foreign.py",
        "foreign_more.py",
        "foreign_third.py",
        "foreign_relatives.py",
        "foreign_forms.py",
    ],
)
def test_machines_with_foreign_effects_start_at_rest(file: str) -> None:
    source = (Path(__file__).parent / file).read_text()
    for effect in foreign_effects(source, Hidden):
        machine = effect(STATED, effect.drawn(np.random.default_rng(1), STATED))
        x = machine.start(START.angle, START.p_s)
        rates = machine.rates(x, 0.0, 0.0)
        still = np.abs(rates[machine.modes]) < 1e-6 * np.abs(machine.boom.weight).max()
        assert np.all(still), effect.name
        leaks = any(machine.leaving(x[0], x[1]))
        assert leaks or np.all(rates[:2] == 0.0), effect.name


def test_a_boom_that_is_much_bent_and_stiffens_starts_at_rest() -> None:
    """Half as long again as EMIR's, and as stiff a law as the blind test may come to."""
    source = (Path(__file__).parent / "foreign_more.py").read_text()
    stiffening = next(e for e in foreign_effects(source, Hidden) if e.name == "stiffening_boom")
    long = replace(STATED, boom_length=1.5 * STATED.boom_length, boom_mass=1.5 * STATED.boom_mass)
    for stiffness in (1.0, STRONGER, STRONGER ** (ATTEMPTS - 1)):
        machine = stiffening(long, {"stiffening": stiffness})
        modes = machine.start(START.angle, START.p_s)[machine.modes]
        bent = modes[: modes.size // 2]
        forces = machine.bending(bent, np.zeros(bent.size)) - machine.weight(0.0, START.angle)
        across = forces - machine.boom.joint * forces[0] / machine.boom.joint[0]
        assert np.all(np.abs(across) < 1e-6 * np.abs(machine.boom.weight).max())

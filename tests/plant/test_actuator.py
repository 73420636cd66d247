"""The actuator against its equations written a second time, and its data sheet."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from emir_common.parameter_tree import with_values
from emir_common.quantity import ParameterError, quantities
from emir_plant.actuator import (
    REGISTRY,
    Actuator,
    ActuatorSheet,
    is_actuator,
    load_actuator,
    simulate,
    write_actuator,
)
from emir_plant.actuator.model import driven
from emir_plant.actuator.parameters import Load, Valve
from emir_plant.actuator.unnamed import PLACES

PLAIN = Actuator(Valve(gain=1.5, time_constant=2.0), Load(frequency=0.3, viscous_friction=0.4))
WHOLE = "valve: {gain: 1.0, time_constant: 1.0}\nload: {frequency: 1.0}"
TIME = np.arange(300.0)
OPENING = np.interp(TIME, [0, 20, 60, 90, 150, 180, 299], [0, 0, 0.8, 0.8, -0.9, 0.1, 0.1])


def _with(effect: str, **values: float) -> Actuator:
    trial = REGISTRY[effect].trial | values
    return with_values(PLAIN, {f"effects.{effect}.{name}": v for name, v in trial.items()})


def test_free_run_agrees_with_an_independent_solver() -> None:
    machine = with_values(PLAIN, {
        "effects.elastic_boom.compliance": 1.5,
        "effects.elastic_boom.damping": 0.1, "effects.elastic_boom.play": 0.1,
        "effects.load_holding_valve.line": 0.4, "effects.swinging_load.mass_ratio": 0.1,
        "effects.swinging_load.frequency": 0.2, "effects.swinging_load.damping": 0.01,
        "effects.turbulent_resistance.coefficient": 0.3, "effects.valve_null_offset.offset": 0.05,
        "effects.internal_leakage.conductance": 0.02, "effects.external_load.force": 0.1,
        "effects.command_delay.delay": 2.5, "effects.line_resistance.coefficient": 0.5,
    })  # fmt: skip

    damper = 2.0 * 0.1 / (0.3 * np.sqrt(1.5))

    def slope(t: float, x: np.ndarray) -> list[float]:
        spool, oil, arm, spring, swing, swing_way = x
        flow = 1.5 * (spool + 0.05)
        bent = np.sign(spring) * max(abs(spring) - 0.1, 0.0)
        filled = 1.0 if flow > 0.0 else 0.6

        def surplus(piston: float) -> float:  # of the pressure, beside a piston without mass
            friction = 0.4 * piston + 0.3 * piston * abs(piston)
            return oil - 0.1 - friction - bent / 1.5 - damper * (piston - arm)

        piston = brentq(surplus, -50.0, 50.0, xtol=1e-12)
        tug = 0.2**2 * swing_way + 2 * 0.01 * 0.2 * (arm - swing)
        return [
            (np.interp(t - 2.5, TIME, OPENING) - spool) / 2.0,
            (flow - piston - 0.02 * oil) / filled,
            0.3**2 * (bent / 1.5 + damper * (piston - arm)) - 0.1 * tug,
            piston - arm,
            tug,
            arm - swing,
        ]

    run = solve_ivp(slope, (0, 299), np.zeros(6), t_eval=TIME, max_step=0.25, rtol=1e-8)
    flow = 1.5 * (run.y[0] + 0.05)
    expected = run.y[1] + 0.5 * flow * np.abs(flow)
    np.testing.assert_allclose(simulate(machine, OPENING, 1.0), expected, atol=0.02)


def test_play_behind_the_spool_agrees_with_an_independent_solver() -> None:
    """The spool does not know what it drags: its way, then the edges', then the oil's pressure."""
    machine = _with("valve_hysteresis", play=0.1, command_share=0.0)
    fine = np.linspace(0.0, 299.0, 299 * 50 + 1)

    def follow(t: float, x: np.ndarray) -> np.ndarray:
        return (np.interp(t, TIME, OPENING) - x) / 2.0

    spool = solve_ivp(follow, (0, 299), [0.0], t_eval=fine, max_step=0.25, rtol=1e-8).y[0]
    edges, held = np.empty_like(spool), 0.0
    for k, leading in enumerate(spool):
        held = min(max(held, leading - 0.1), leading + 0.1)
        edges[k] = held

    def slope(t: float, x: np.ndarray) -> list[float]:
        return [1.5 * np.interp(t, fine, edges) - x[1], 0.3**2 * (x[0] - 0.4 * x[1])]

    oil = solve_ivp(slope, (0, 299), [0.0, 0.0], t_eval=TIME, max_step=0.25, rtol=1e-8).y[0]
    np.testing.assert_allclose(simulate(machine, OPENING, 1.0), oil, atol=0.01)


def test_a_piston_with_mass_and_a_swing_that_air_damps_agree_with_an_independent_solver() -> None:
    machine = with_values(PLAIN, {
        "effects.elastic_boom.compliance": 1.5, "effects.elastic_boom.damping": 0.1,
        "effects.elastic_boom.piston_share": 0.3, "effects.swinging_load.mass_ratio": 0.8,
        "effects.swinging_load.frequency": 0.2, "effects.swinging_load.damping": 0.1,
        "effects.swinging_load.air_share": 1.0,
    })  # fmt: skip
    damper = 2.0 * 0.1 / (0.3 * np.sqrt(1.5))

    def slope(t: float, x: np.ndarray) -> list[float]:
        spool, oil, piston, arm, spring, swing, swing_way = x
        bent = spring / 1.5 + damper * (piston - arm)
        pull = 0.2**2 * swing_way
        return [
            (np.interp(t, TIME, OPENING) - spool) / 2.0,
            1.5 * spool - piston,
            0.3**2 / 0.3 * (oil - 0.4 * piston - bent),
            0.3**2 / 0.7 * bent - 0.8 * pull,
            piston - arm,
            pull + 2.0 * 0.1 * 0.2 * (arm - swing),
            arm - swing,
        ]

    run = solve_ivp(slope, (0, 299), np.zeros(7), t_eval=TIME, max_step=0.25, rtol=1e-8)
    np.testing.assert_allclose(simulate(machine, OPENING, 1.0), run.y[1], atol=0.01)


def test_a_piston_that_creeps_from_the_start_goes_on_to() -> None:
    """Pressure and velocity are those of steady motion, which nothing disturbs."""
    machine = _with("valve_null_offset", offset=0.1, creeping=1.0)
    steady = 0.4 * 1.5 * 0.1
    np.testing.assert_allclose(simulate(machine, 0.0 * TIME, 1.0, steady), steady, rtol=1e-9)
    still = with_values(machine, {"effects.valve_null_offset.creeping": 0.0})
    assert np.ptp(simulate(still, 0.0 * TIME, 1.0, steady)) > 0.5 * steady


def test_dry_friction_that_falls_with_speed_holds_a_light_piston_until_it_breaks_away() -> None:
    stick = {"force": 0.2, "breakaway": 0.3, "velocity": 0.1}
    values = {f"effects.stribeck_friction.{name}": value for name, value in stick.items()}
    values["effects.elastic_boom.compliance"] = 1.0
    for force, moves in ((0.49, False), (0.51, True)):
        machine = with_values(PLAIN, values | {"effects.external_load.force": force})
        assert (np.abs(simulate(machine, 0.0 * TIME, 1.0)).max() > 0.0) == moves


def test_the_measured_pressure_of_its_own_machine_leaves_nothing_missing() -> None:
    machine = _with("flow_limit", lifting=0.6, lowering=0.8)
    pressure = simulate(machine, OPENING, 1.0)
    missing = np.abs(pressure - driven(machine, OPENING, pressure, 1.0)).max()
    other = np.abs(pressure - driven(PLAIN, OPENING, pressure, 1.0)).max()
    assert missing < 0.05 * other


@pytest.mark.parametrize("effect", REGISTRY)
def test_effects_are_off_at_zero_and_change_something_when_on(effect: str) -> None:
    kind = REGISTRY[effect]
    assert kind.source
    assert set(kind.trial) == set(quantities(kind))
    off = simulate(_with(effect, **dict.fromkeys(kind.sizes, 0.0)), OPENING, 1.0)
    plain = simulate(PLAIN, OPENING, 1.0)
    np.testing.assert_array_equal(off, plain)
    small = {"relief_valve": {"high": 0.5, "low": 0.5}, "flow_limit": {"lifting": 0.5}}
    on = simulate(_with(effect, **small.get(effect, {})), OPENING, 1.0)
    assert np.all(np.isfinite(on))
    assert np.abs(on - plain).max() > 1e-3


@pytest.mark.parametrize(
    ("curve", "slope", "named"),
    [
        ("unnamed_flow", 0.5, {"valve.gain": 2.0}),
        ("unnamed_leakage", 0.05, {"effects.internal_leakage.conductance": 0.05}),
        ("unnamed_friction", 0.2, {"load.viscous_friction": 0.6}),
        ("unnamed_force", -0.01, {"effects.external_load.gradient": 0.01}),
    ],
)
def test_a_straight_curve_is_what_has_a_name(
    curve: str, slope: float, named: dict[str, float]
) -> None:
    places = np.linspace(-100.0, 100.0, PLACES)
    values = {"low": -100.0, "high": 100.0, "points": (slope * places).tolist()}
    machine = with_values(PLAIN, {f"effects.{curve}.{k}": v for k, v in values.items()})
    expected = simulate(with_values(PLAIN, named), OPENING, 1.0)
    np.testing.assert_allclose(simulate(machine, OPENING, 1.0), expected, atol=1e-9)


def test_a_flow_limit_limits_the_steady_velocity_and_so_the_pressure() -> None:
    opening = np.minimum(TIME / 20.0, 1.0)
    settled = simulate(_with("flow_limit", lifting=0.6), opening, 1.0)[-1]
    assert settled == pytest.approx(0.4 * 0.6, rel=0.05)  # pressure = friction * flow


def _frequency_after_a_jolt(size: float, **effects: float) -> float:
    """Return that of the pressure, valve shut, in rad per time."""
    values = {name.replace("__", "."): value for name, value in effects.items()}
    machine = with_values(PLAIN, {"load.viscous_friction": 0.0} | values)
    opening = size * np.interp(TIME, [0, 1, 2], [1.0, 1.0, 0.0])
    free = simulate(machine, opening, 1.0)[60:]
    above = free - free.mean()
    after = np.flatnonzero((above[:-1] < 0.0) & (above[1:] >= 0.0))
    crossings = after - above[after] / (above[after + 1] - above[after])
    return float(2.0 * np.pi / np.mean(np.diff(crossings)))


ARM = {"effects__elastic_boom__compliance": 3.0, "effects__elastic_boom__damping": 0.02}


def test_an_arm_softer_than_the_oil_swings_as_slowly_as_both_springs_in_series() -> None:
    assert _frequency_after_a_jolt(1.0, **ARM) == pytest.approx(0.3 / np.sqrt(1.0 + 3.0), rel=0.03)


def test_play_in_the_arm_makes_small_motions_slower_and_leaves_large_ones() -> None:
    with_play = ARM | {"effects__elastic_boom__play": 0.2}
    without = _frequency_after_a_jolt(1.0, **ARM)
    assert _frequency_after_a_jolt(100.0, **with_play) == pytest.approx(without, rel=0.01)
    assert _frequency_after_a_jolt(0.3, **with_play) < 0.95 * without


def test_oil_beyond_a_shut_load_holding_valve_is_no_spring() -> None:
    shut = _frequency_after_a_jolt(-1.0, effects__load_holding_valve__line=0.5)
    assert shut == pytest.approx(0.3 / np.sqrt(0.5), rel=0.01)


def test_dry_friction_holds_a_light_piston_until_the_pressure_exceeds_it() -> None:
    still = {"effects.elastic_boom.compliance": 1.0, "effects.coulomb_friction.force": 0.5}
    for force, moves in ((0.49, False), (0.51, True)):
        machine = with_values(PLAIN, still | {"effects.external_load.force": force})
        way = np.abs(simulate(machine, 0.0 * TIME, 1.0)).max()
        assert (way > 0.0) == moves


@pytest.mark.parametrize("head", ["", "machine: excavator\n"])
def test_an_actuator_s_sheet_that_is_not_called_so_is_told(head: str, tmp_path: Path) -> None:
    """It would be read as the boom's, and its values be no parameters."""
    sheet = tmp_path / "sheet.yaml"
    sheet.write_text(f"{head}valve: {{gain: 1.0, time_constant: 2.0}}\nload: {{frequency: 0.3}}\n")
    with pytest.raises(ParameterError, match=r"sheet\.yaml: machine = .*'actuator' is meant"):
        is_actuator(sheet)


def test_a_sheet_written_is_the_sheet_read(tmp_path: Path) -> None:
    measured = {"effects.unnamed_flow.high": 1.0, "effects.unnamed_flow.points.2": 0.3}
    machine = with_values(_with("valve_hysteresis"), measured)
    sheet = ActuatorSheet(machine, {"valve.gain": (0.5, 3.0)}, "sample")
    write_actuator(tmp_path / "sheet.yaml", sheet)
    assert load_actuator(tmp_path / "sheet.yaml") == sheet


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("valve: {gain: 1.0, time_constant: 1.0}", "load.frequency: missing"),
        ("valve: {gain: much, time_constant: 1.0}\nload: {frequency: 1.0}", "not a number"),
        ("valve: {gain: 1.0, time_constant: 0.0}\nload: {frequency: 1.0}", "outside"),
        ("valve: {gain: 1.0, time_constant: 0.01}\nload: {frequency: 1.0}", "time_unit: sample"),
        ("valve: {volume: 1.0}", "valve.volume: there is no such parameter"),
        (f"{WHOLE}\nsensor: {{pressure_noise: {{value: 1, range: [0, 20]}}}}", "its range"),
        (f"{WHOLE}\nsensor: {{pressure_noise: {{value: 1, range: [2, 1]}}}}", "comes first"),
        ("effects: {magic: {size: 1.0}}", "effects.magic: there is no such effect"),
        ("time_unit: hours", "time_unit"),
        (f"{WHOLE}\neffects: {{unnamed_flow: {{points: [1.0]}}}}", "not a list of 7 numbers"),
        (
            f"{WHOLE}\neffects: {{unnamed_flow: {{points: {{value: [0], range: [0, 1]}}}}}}",
            "a list has no range",
        ),
        ("valve: {gain: [1.0], time_constant: 1.0}\nload: {frequency: 1.0}", "not a number"),
        ("efects: {}", "efects: there is no such entry"),
        (
            "valve: {gain: {value: 9, range: [1, 2]}, time_constant: 1.0}\nload: {frequency: 1.0}",
            "outside its range",
        ),
    ],
)
def test_a_sheet_of_no_use_is_told(text: str, reason: str, tmp_path: Path) -> None:
    (tmp_path / "sheet.yaml").write_text(f"machine: actuator\n{text}\n")
    with pytest.raises(ParameterError, match=reason) as told:
        load_actuator(tmp_path / "sheet.yaml")
    assert "\n" not in str(told.value)

"""What every effect has to satisfy, whichever it is; then each against its own law."""

import itertools
import math
import re
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from scipy import signal
from scipy.integrate import solve_ivp

from emir_common.parameter_tree import with_values
from emir_common.quantity import ParameterError, quantities
from emir_plant import core, dry_friction, integration, linkage
from emir_plant.core import Truth
from emir_plant.effects import (
    REGISTRY,
    backlash,
    command_delay,
    entrained_air,
    external_load,
    flow_gain_drift,
    linkage_error,
    logic_block_fault,
    pressure_dependent_friction,
    sensor_delay,
    supply_pressure_droop,
    terms,
    valve_hysteresis,
    vessel_compliance,
)
from emir_plant.hydraulics import logic_block, valve
from emir_plant.hydraulics.flows import Edges, Pressures, flows
from emir_plant.parameters import GRAVITY, Machine
from emir_plant.plant import Plant
from emir_plant.sensors import measure, readings
from emir_plant.sheet import joint1, load_sheet

FORTY_FIVE = math.radians(45.0)
BAR = 1e5
FRICTION = [name for name in REGISTRY if name.endswith("_friction")]
LEAKAGE = [name for name in REGISTRY if name.endswith("_leakage")]
T = {name: k for k, name in enumerate(Truth._fields)}

# A logic block that has to work when the boom is lowered, and a pump that is short of pressure
# when it is lifted, so that faults of both show.
MACHINE = with_values(joint1(), {"logic_block.threshold": 100e5, "supply.p0": 130e5})
PLAIN = Plant(MACHINE)
OWN_STROKE = with_values(MACHINE, {"sensors.own_stroke": 1})  # has a sensor of its own


def _switched_on(name: str, factor: float = 1.0) -> Machine:
    kind = REGISTRY[name]
    values = {f"effects.{name}.{key}": value for key, value in kind.trial.items()}
    for size in kind.sizes:
        values[f"effects.{name}.{size}"] = factor * kind.trial[size]
    return with_values(MACHINE, values)


def _with(**effects: dict[str, float]) -> Plant:
    """A plant with effects switched on by name and parameters."""
    values = {f"effects.{e}.{name}": v for e, about in effects.items() for name, v in about.items()}
    return Plant(with_values(MACHINE, values))


def _moving_state() -> np.ndarray:
    state = PLAIN.initial(FORTY_FIVE, 30e5)
    state[core.MODES + 5] = 30.0  # rate of the rigid mode: the boom is being lifted
    return state


def _shown(machine: Machine) -> np.ndarray:
    """What the sensors show of lifting, rest and lowering: (n, 6)."""
    plant = Plant(machine)
    commands = np.zeros(3500)
    commands[100:1200], commands[1500:3000] = 0.5, -0.6
    run = plant.simulate(plant.initial(FORTY_FIVE, 30e5), commands, 1e-3)
    return np.stack(readings(plant, run, 1e-3), axis=1)


@pytest.fixture(scope="module")
def plain_run() -> np.ndarray:
    return _shown(MACHINE)


# what every effect has to satisfy


@pytest.mark.parametrize("name", REGISTRY)
def test_effect_is_off_by_default_and_vanishes_with_its_sizes(
    name: str, plain_run: np.ndarray
) -> None:
    off = getattr(joint1().effects, name)
    assert all(getattr(off, size) == 0.0 for size in REGISTRY[name].sizes)
    state = _moving_state()
    tiny = _switched_on(name, 1e-9)
    expected = PLAIN.derivative(state, 0.3)
    assert Plant(tiny).derivative(state, 0.3) == pytest.approx(expected, rel=1e-6, abs=1e-6)
    # a lag or a delay of nothing may cost half an integration step
    span = np.ptp(plain_run, axis=0)
    assert (np.abs(_shown(tiny) - plain_run).max(axis=0) < 0.01 * span).all()


@pytest.mark.parametrize(
    ("name", "size"), [(name, size) for name, kind in REGISTRY.items() for size in kind.sizes]
)
def test_each_size_alone_reaches_what_the_sensors_show(
    name: str, size: str, plain_run: np.ndarray
) -> None:
    kind = REGISTRY[name]
    values = {f"effects.{name}.{key}": v for key, v in kind.trial.items() if key not in kind.sizes}
    values[f"effects.{name}.{size}"] = kind.trial[size]
    shown = _shown(with_values(OWN_STROKE if size == "stroke" else MACHINE, values))
    assert np.isfinite(shown).all()
    assert not np.allclose(shown, plain_run, rtol=1e-6, atol=0.0)


@pytest.mark.parametrize("name", REGISTRY)
def test_effect_is_finite_at_rest_and_without_pressure(name: str) -> None:
    plant = Plant(_switched_on(name, 1.5))
    state = plant.initial(FORTY_FIVE, 0.0)
    for lifting, lowering in ((0.0, 0.0), (20e5, 20e5), (plant.record["pT"][0],) * 2):
        state[core.P_H], state[core.P_S] = lifting, lowering
        assert np.isfinite(plant.derivative(state, 0.0)).all()
        assert np.isfinite(plant.outputs(state)).all()


@pytest.mark.parametrize("name", REGISTRY)
def test_effect_names_its_source_and_starts_a_search_inside_its_range(name: str) -> None:
    kind = REGISTRY[name]
    assert kind.source
    assert set(kind.sizes) <= kind.trial.keys()
    assert kind.trial.keys() <= {field.name for field in fields(kind)}
    _switched_on(name)  # checks the ranges
    defaults = {field.name: field.default for field in fields(kind)}
    asked = quantities(kind).keys() - {*kind.other_law, *kind.given}
    start = {key: kind.trial.get(key, defaults[key]) for key in asked}
    assert all(start.values())  # a search scales each parameter by its start


@pytest.mark.parametrize("name", REGISTRY)
def test_a_value_out_of_range_is_told_in_one_line(name: str) -> None:
    for parameter, about in quantities(REGISTRY[name]).items():
        path = f"effects.{name}.{parameter}"
        for value in (2.0 * about.high + 1.0, about.low - 1.0, math.nan):
            with pytest.raises(ParameterError) as error:
                with_values(joint1(), {path: value})
            assert str(error.value).startswith(f"{path} = ")
            assert "outside" in str(error.value)
            assert "\n" not in str(error.value)


def test_an_unknown_effect_is_told_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=r"^effects.gremlins.size: there is no such parameter"):
        with_values(joint1(), {"effects.gremlins.size": 1.0})
    file = tmp_path / "machine.yaml"
    stated = (Path(core.__file__).parent / "data" / "joint1.yaml").read_text()
    for text, said in (
        ("effects: {gremlins: {size: 1.0}}", "effects.gremlins: there is no such effect"),
        ("effects: {payload: {weight: 1.0}}", "effects.payload.weight: there is no such parameter"),
        ("effects: {payload: {mass: -1.0}}", r"effects.payload.mass = -1: outside 0 ... 3000 kg"),
        ("effects: {payload: 100.0}", r"effects.payload = 100.0: not a map"),
        ("effects: payload", r"effects = 'payload': not a map"),
    ):
        file.write_text(f"{stated}\n{text}\n")
        with pytest.raises(ParameterError, match=rf"^{re.escape(str(file))}: {said}"):
            load_sheet(file)


def test_effects_are_switched_on_by_name_in_a_machine_file(tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    stated = (Path(core.__file__).parent / "data" / "joint1.yaml").read_text()
    file.write_text(
        f"{stated}\neffects:\n  coulomb_friction: {{force: {{value: 3.0e+3, unit: N}}}}\n"
    )
    expected = with_values(joint1(), {"effects.coulomb_friction.force": 3e3})
    assert load_sheet(file, strict=True).machine == expected


def test_every_effect_of_the_sheet_is_in_the_registry(shared: Path) -> None:
    rows = (shared / "reference" / "effects.md").read_text().splitlines()
    first_columns = [row.split("|")[1] for row in rows if row.startswith("| `")]
    named = {name for column in first_columns for name in re.findall(r"`(\w+)`", column)}
    assert len(named) > 20
    assert named == REGISTRY.keys()


def test_every_effect_has_its_page() -> None:
    pages = Path(__file__).parents[2] / "docs" / "effects"
    assert {page.stem for page in pages.glob("*.md")} == REGISTRY.keys()
    for name in REGISTRY:
        text = (pages / f"{name}.md").read_text()
        assert text.startswith(f"# {name}\n")
        assert "- Balance: " in text


# energy


@pytest.mark.parametrize("name", FRICTION)
def test_friction_never_feeds_energy_in(name: str) -> None:
    p = Plant(_switched_on(name)).record[0]
    for velocity, load in itertools.product(np.linspace(-0.1, 0.1, 201), (-5e5, 0.0, 6e5)):
        assert terms.friction(velocity, load, p) * velocity >= 0.0
        assert terms.friction(0.0, load, p) == 0.0


@pytest.mark.parametrize("name", LEAKAGE)
def test_leakage_never_feeds_energy_in(name: str) -> None:
    p = Plant(_switched_on(name)).record[0]
    tank = p["pT"]
    for lifting, lowering in itertools.product(np.linspace(0.0, 300e5, 31), repeat=2):
        from_lifting, from_lowering = terms.leakage(lifting, lowering, p)
        lost = from_lifting * (lifting - tank) + from_lowering * (lowering - tank)
        assert lost >= 0.0


@pytest.mark.parametrize("gradual_share", [0.0, 1.0])
def test_backlash_takes_energy_on_every_closed_path(gradual_share: float) -> None:
    """Work of the oil on the play over a period, however fast the force swings."""
    p = _with(backlash={"gap": 1e-3, "gradual_share": gradual_share}).record[0]
    for period in (0.02, 0.1, 1.0):
        dt = period / 2000
        force = 1e5 * np.sin(2.0 * math.pi * np.arange(6000) * dt / period)
        offset, work = 0.0, 0.0
        for k, f in enumerate(force):
            rate = backlash.rate(offset, f, p)
            offset += dt * rate
            work += dt * f * rate * (k >= 2000)  # the first period settles
        assert work > 0.0


@pytest.mark.parametrize("name", ["viscous_friction", "pressure_dependent_friction", *LEAKAGE])
def test_dissipation_damps_the_slow_mode(name: str) -> None:
    """A boom let go from beside its rest swings less than without the effect."""

    def swing(plant: Plant) -> float:
        state = plant.initial(FORTY_FIVE, 60e5)
        state[core.P_H] *= 1.05
        velocity = plant.simulate(state, np.zeros(6000), 1e-3, 10)[:, T["velocity"]]
        return float(np.ptp(velocity[-200:]))

    assert swing(Plant(_switched_on(name, 3.0))) < 0.98 * swing(PLAIN)


# force


def test_sliding_friction_is_the_stated_force_and_breakaway_is_higher() -> None:
    coulomb = _with(coulomb_friction={"force": 3e3}).record[0]
    assert terms.friction(0.1, 0.0, coulomb) == pytest.approx(3e3)
    stribeck = Plant(_switched_on("stribeck_friction")).record[0]
    assert terms.friction(0.1, 0.0, stribeck) == pytest.approx(3e3, rel=1e-3)
    assert max(terms.friction(v, 0.0, stribeck) for v in np.linspace(0, 0.02, 100)) > 1.2 * 3e3


def test_viscous_friction_is_proportional_to_the_speed() -> None:
    p = _with(viscous_friction={"coefficient": 1e5}).record[0]
    assert terms.friction(0.025, 6e5, p) == pytest.approx(2.5e3)
    assert terms.friction(-0.05, 6e5, p) == pytest.approx(-5e3)


def test_oil_pushed_through_what_is_narrow_resists_by_the_square_of_the_speed() -> None:
    p = _with(viscous_friction={"coefficient": 1e5, "square": 2e6}).record[0]
    assert terms.friction(0.05, 6e5, p) == pytest.approx(5e3 + 5e3)
    assert terms.friction(-0.1, 6e5, p) == pytest.approx(-(10e3 + 20e3))


DRY_SIZES = {
    "coulomb_friction": {"force": 1e4},
    "stribeck_friction": {"force": 1e4},
    "pressure_dependent_friction": {"coefficient": 1e4 / 6e5},
}


@pytest.mark.parametrize("gradual", [0.0, 1.0])
@pytest.mark.parametrize("name", DRY_SIZES)
def test_dry_friction_may_be_larger_in_one_direction(name: str, gradual: float) -> None:
    """And however much, what is slower never meets more of it than what creeps beside it."""
    sizes = {**DRY_SIZES[name], "asymmetry": -0.5, "gradual_share": gradual}
    if name == "stribeck_friction":
        sizes["breakaway"] = 1.0
    p = _with(**{name: sizes}).record[0]
    assert terms.friction(1.0, 6e5, p) == pytest.approx(5e3, rel=1e-4)
    assert terms.friction(-1.0, 6e5, p) == pytest.approx(-15e3, rel=1e-4)
    velocities = np.linspace(-0.01, 0.01, 401)
    assert np.all(np.diff([terms.friction(v, 6e5, p) for v in velocities]) > -1e-6)


@pytest.mark.parametrize("name", DRY_SIZES)
def test_seals_that_give_slide_at_more_in_one_direction(name: str) -> None:
    sizes = {**DRY_SIZES[name], "asymmetry": 0.3, "presliding": 1e-4}
    p = _with(**{name: sizes}).record[0]
    assert terms.bristles(1.0, 6e5, p).sliding == pytest.approx(13e3)
    assert terms.bristles(-1.0, 6e5, p).sliding == pytest.approx(7e3)


@pytest.mark.parametrize("lifted", [1.0, -1.0])
def test_a_piston_is_held_by_more_in_one_direction(lifted: float) -> None:
    """Pushed with 1.2 of 1.3 or of 0.7 times the friction, the piston stands or goes."""
    p = _with(coulomb_friction={"force": 1e4, "smoothing_speed": 1e-5, "asymmetry": 0.3}).record[0]
    at = terms.Situation(6e5, 0.0)
    pushed = lifted * 1.2e4 * 1e-6  # m/s, that the push makes in a step
    left = pushed - 1e-6 * dry_friction.at_end(pushed, 1e-6, at, p)
    assert abs(left) == pytest.approx(0.0 if lifted > 0.0 else 5e-3, abs=5e-5)


def test_pressure_dependent_friction_is_a_share_of_the_load_and_smooth_at_rest() -> None:
    p = _with(pressure_dependent_friction={"coefficient": 0.02}).record[0]
    for load in (6e5, -6e5):
        assert terms.friction(0.05, load, p) == pytest.approx(0.02 * 6e5)
        assert terms.friction(-0.05, load, p) == pytest.approx(-0.02 * 6e5)
    slope = 0.02 * 6e5 / p["pressure_dependent_friction_smoothing_speed"]
    assert terms.friction(1e-6, 6e5, p) == pytest.approx(1e-6 * slope, rel=1e-5)


def test_bearings_carry_the_difference_of_the_chambers_and_seals_each_its_own() -> None:
    """Under equal forces from both sides bearings carry nothing, and seals both."""
    cylinder = MACHINE.cylinder
    low = 40e5 * cylinder.area_lifting / cylinder.area_lowering
    for share in (0.0, 0.5, 1.0):
        p = _with(pressure_dependent_friction={"coefficient": 0.02, "seal_share": share}).record[0]
        pressing = pressure_dependent_friction.pressing(40e5, low, p)
        assert pressing == pytest.approx(share * 2.0 * 40e5 * cylinder.area_lifting)
        emptied = pressure_dependent_friction.pressing(40e5, 0.0, p)
        assert emptied == pytest.approx(40e5 * cylinder.area_lifting)


def test_payload_is_felt_as_weight_and_inertia() -> None:
    plain, loaded = Plant(joint1()), Plant(_switched_on("payload"))
    extra = (
        loaded.outputs(loaded.initial(FORTY_FIVE)).force
        - plain.outputs(plain.initial(FORTY_FIVE)).force
    )
    moment = 100.0 * 9.81 * 22.5 * math.cos(FORTY_FIVE)
    assert extra * linkage.lever_arm(FORTY_FIVE, plain.record[0]) == pytest.approx(moment)


def test_a_constant_load_is_carried_by_the_piston_and_bends_the_boom() -> None:
    """Statics by hand: F L = dF_piston r; the boom bends as one clamped at the joint."""
    loaded = _with(external_load={"force": -2e3})
    rest = loaded.initial(FORTY_FIVE, 20e5)
    rate = np.delete(loaded.derivative(rest, 0.0), core.TIME)
    assert np.abs(rate).max() < 1e-5
    before, after = PLAIN.outputs(PLAIN.initial(FORTY_FIVE, 20e5)), loaded.outputs(rest)
    arm = linkage.lever_arm(FORTY_FIVE, PLAIN.record[0])
    assert (after.force - before.force) * arm == pytest.approx(2e3 * 22.5)
    g = MACHINE.geometry
    springs = g.arms * (g.sections_per_arm - 1)
    bending_stiffness = g.section_spring * g.boom_length / springs
    cantilever = -2e3 * g.boom_length**3 / (3.0 * bending_stiffness)
    assert after.tcp_deflection - before.tcp_deflection == pytest.approx(cantilever, rel=0.05)


@pytest.mark.parametrize("share", ["piston_share", "joint_share"])
@pytest.mark.parametrize("degrees", [30.0, 60.0])
def test_a_load_on_the_piston_or_the_joint_is_carried_by_the_oil_and_bends_no_arm(
    degrees: float, share: str
) -> None:
    """Statics by hand: the oil pushes by F L / b less at any angle, or by F L / r."""
    angle = math.radians(degrees)
    loaded = _with(external_load={"mean": 1e3, share: 1.0})
    rest = loaded.initial(angle, 20e5)
    rate = np.delete(loaded.derivative(rest, 0.0), core.TIME)
    assert np.abs(rate).max() < 1e-5
    before, after = PLAIN.outputs(PLAIN.initial(angle, 20e5)), loaded.outputs(rest)
    g = MACHINE.geometry
    lever = {"piston_share": g.triangle_b, "joint_share": linkage.lever_arm(angle, PLAIN.record[0])}
    assert before.force - after.force == pytest.approx(1e3 * g.boom_length / lever[share])
    assert after.tcp_deflection == pytest.approx(before.tcp_deflection, rel=1e-6)


@pytest.mark.parametrize("degrees", [45.0, 75.0])
def test_a_vertical_load_is_a_weight(degrees: float) -> None:
    angle = math.radians(degrees)
    pulled = _with(external_load={"mean": -100.0 * GRAVITY, "vertical_share": 1.0})
    heavier = _with(payload={"mass": 100.0})
    one, other = (m.outputs(m.initial(angle, 20e5)) for m in (pulled, heavier))
    assert one.force == pytest.approx(other.force)
    assert one.tcp_deflection == pytest.approx(other.tcp_deflection)


def test_a_load_acts_from_its_start_for_its_duration() -> None:
    pulse = _with(external_load={"force": 1e3, "start": 2.0, "duration": 0.5}).record[0]
    assert [external_load.force(t, pulse) for t in (1.99, 2.0, 2.49, 2.5)] == [0.0, 1e3, 1e3, 0.0]
    swing = _with(external_load={"force": 1e3, "frequency": 0.5, "start": 1.0}).record[0]
    values = [external_load.force(1.0 + t, swing) for t in (0.0, 0.5, 1.0, 2.0)]
    assert values == pytest.approx([1e3, 0.0, -1e3, 1e3], abs=1e-9)


def test_a_load_rises_and_falls_along_straight_lines_about_a_mean() -> None:
    wind = {"force": 500.0, "mean": 1e3, "frequency": 0.25, "start": 2.0, "duration": 8.0}
    p = _with(external_load=wind | {"rise": 2.0}).record[0]
    values = [external_load.force(t, p) for t in (1.9, 3.0, 4.0, 6.0, 10.0, 11.0, 12.1)]
    # after 1, 2, 4, 8 and 9 s a swing of 4 s stands at 0, -1, 1, 1 and 0
    assert values == pytest.approx([0.0, 500.0, 500.0, 1500.0, 1500.0, 500.0, 0.0], abs=1e-9)


# kinematics


def test_a_swing_decays_from_where_it_set_in() -> None:
    """Half of it is left after ln 2 / d; what came before it set in is nothing."""
    swing = {"force": 1e3, "mean": 200.0, "frequency": 1.0, "start": 50.0, "decay": math.log(2.0)}
    p = _with(external_load=swing).record[0]
    values = [external_load.force(t, p) for t in (0.0, 50.0, 51.0, 53.5)]
    assert values == pytest.approx([0.0, 1200.0, 700.0, 200.0 - 1e3 / 2**3.5], abs=1e-9)


@pytest.mark.parametrize("about", [0.0, 0.45])
def test_linkage_error_is_the_stated_one_and_keeps_the_power(about: float) -> None:
    error = {"scale": 0.01, "slope": 0.05, "curvature": -0.04, "cubic": 0.1, "quartic": -0.2}
    p = _with(linkage_error=error | {"about": about}).record[0]
    for angle in np.radians(np.linspace(-10, 90, 21)):
        stated, h = linkage.lever_arm(angle, p), linkage.stroke(angle, p)
        arm = linkage_error.lever_arm(angle, p)
        u = h - about
        factor = 1.01 + 0.05 * u - 0.04 * u**2 + 0.1 * u**3 - 0.2 * u**4
        assert arm == pytest.approx(stated * factor, rel=1e-12)
        step = 1e-5
        slope = linkage_error.stroke(angle + step, p) - linkage_error.stroke(angle - step, p)
        assert arm == pytest.approx(slope / (2 * step), rel=1e-8)
    assert linkage_error.stroke(0.0, p) == 0.0


def test_a_linkage_error_comes_near_a_wave_of_one_period() -> None:
    """As the document of the effect says: by all five terms, over the stroke from 0 to 80 deg."""
    stated = PLAIN.record[0]
    angles = np.radians(np.linspace(0.0, 80.0, 81))
    h = linkage.strokes(angles, stated)
    wave = 0.02 * np.sin(2.0 * math.pi * h / np.ptp(h))
    terms_of_h = dict(
        zip(linkage_error.LinkageError.sizes, np.polyfit(h, wave, 4)[::-1], strict=True)
    )
    p = _with(linkage_error={name: float(value) for name, value in terms_of_h.items()}).record[0]
    made = np.array(
        [linkage_error.lever_arm(a, p) / linkage.lever_arm(a, stated) - 1.0 for a in angles]
    )
    assert np.sqrt(np.mean((made - wave) ** 2)) < 0.125 * wave.std()


def test_the_measured_stroke_is_that_of_the_stated_linkage() -> None:
    plant = _with(linkage_error={"scale": 0.05})
    truth = plant.outputs(plant.initial(FORTY_FIVE, 20e5))
    assert truth.stroke == pytest.approx(1.05 * linkage.stroke(FORTY_FIVE, plant.record[0]))
    step = 2.0 * math.pi / 4096 * truth.stroke
    assert measure(plant, truth, 0).stroke == pytest.approx(truth.stroke / 1.05, abs=step)


def test_play_shifts_the_piston_by_the_gap_when_the_force_changes_sign() -> None:
    gap = 2e-3
    p = _with(backlash={"gap": gap}).record[0]
    assert backlash.flank(6e5, p) == pytest.approx(gap / 2)
    assert backlash.flank(-6e5, p) == pytest.approx(-gap / 2)
    plant = _with(backlash={"gap": gap})
    over = [plant.initial(math.radians(a), 120e5) for a in (80.0, 100.0)]
    forces = [plant.outputs(x).force for x in over]
    assert forces[0] > 0.0 > forces[1]
    shift = [plant.outputs(x).stroke - linkage.stroke(plant.outputs(x).angle, p) for x in over]
    assert shift[0] - shift[1] == pytest.approx(gap, rel=1e-3)


def test_a_pin_gives_way_in_proportion_to_the_force() -> None:
    """Beside the half gap; the joint stays where it is."""
    stiffness = 1e9  # N/m
    plant = _with(backlash={"gap": 2e-3, "pin_force": 1e-3 * stiffness})
    for angle in (0.9, 1.3):
        rest = plant.outputs(plant.initial(angle, 20e5))
        stated = linkage.stroke(angle, plant.record[0])
        assert rest.angle == pytest.approx(angle)
        assert rest.stroke - stated == pytest.approx(1e-3 + rest.force / stiffness, rel=1e-9)


@pytest.mark.parametrize("gradual_share", [0.0, 1.0])
def test_crossing_the_play_is_followed_by_the_integration(gradual_share: float) -> None:
    """Upright the boom swings from flank to flank; a fourth of the step changes little."""
    plant = _with(backlash={"gap": 2e-3, "gradual_share": gradual_share})
    state = plant.initial(math.radians(90.0), 120e5)
    state[core.MODES + 5] = 5.0  # rate of the rigid mode
    runs = [plant.simulate(state, np.zeros(4000 * n), 1e-3 / n, 10 * n) for n in (1, 4)]
    force = runs[1][:, T["force"]]
    assert force.min() < -2e4 < 2e4 < force.max()
    assert np.abs(runs[0] - runs[1])[:, T["force"]].max() < 2e-3 * np.ptp(force)


@pytest.mark.parametrize("gap", [1e-4, 1e-2])
@pytest.mark.parametrize("seating_force", [200.0, 1e6])
@pytest.mark.parametrize("crossing_time", [0.002, 0.5])
def test_any_play_in_range_is_followed(
    gap: float, seating_force: float, crossing_time: float
) -> None:
    """As by steps of 0.05 ms: the stiffest play settles within 0.03 ms."""
    play = {"gap": gap, "seating_force": seating_force, "crossing_time": crossing_time}
    plant = _with(backlash=play)
    state = plant.initial(math.radians(90.0), 120e5)
    state[core.MODES + 5] = 5.0  # rate of the rigid mode
    runs = [plant.simulate(state, np.zeros(1000 * n), 1e-3 / n, 10 * n) for n in (1, 20)]
    force = runs[1][:, T["force"]]
    assert force.min() < 0.0 < force.max()
    assert np.abs(runs[0] - runs[1])[:, T["force"]].max() < 5e-3 * np.ptp(force)


@pytest.mark.parametrize("gradual_share", [0.0, 1.0])
def test_stiff_play_agrees_with_an_independent_solver(gradual_share: float) -> None:
    """An implicit method with its own choice of steps, upright from flank to flank.

    A degree of freedom that settles within 0.01 ms, in steps of 0.2 ms.
    """
    play = {"gap": 4e-3, "seating_force": 200.0, "crossing_time": 0.002}
    plant = _with(backlash=play | {"gradual_share": gradual_share})
    state = plant.initial(math.radians(90.0), 120e5)
    state[core.MODES + 5] = 5.0  # rate of the rigid mode
    run = plant.simulate(state, np.zeros(6000), 1e-3, 10)
    times = np.linspace(0.0, 6.0, 601)
    solution = solve_ivp(
        lambda _, x: plant.derivative(x, 0.0),
        (0.0, 6.0),
        state,
        method="LSODA",
        t_eval=times,
        rtol=1e-8,
        atol=1e-10,
    )
    expected = np.array([plant.outputs(x) for x in solution.y.T])
    for name in ("force", "stroke", "pressure_lifting", "pressure_lowering"):
        off = np.abs(run - expected)[:, T[name]].max()
        assert off < 2e-4 * np.ptp(expected[:, T[name]])
    crossed = run[:, T["stroke"]] - linkage.strokes(run[:, T["angle"]].copy(), plant.record[0])
    assert np.ptp(crossed) > 3.9e-3


# chambers


def test_leakage_flows_downhill_and_keeps_the_oil() -> None:
    plant = Plant(_switched_on("internal_leakage"))
    state = plant.initial(FORTY_FIVE, 20e5)
    rate = plant.derivative(state, 0.0)
    assert rate[core.P_H] < 0.0 < rate[core.P_S]
    c, h = plant.machine.cylinder, plant.outputs(state).stroke
    lost = rate[core.P_H] * (c.volume_lifting_0 + c.area_lifting * h)
    gained = rate[core.P_S] * (c.volume_lowering_0 - c.area_lowering * h)
    assert lost == pytest.approx(-gained, rel=1e-12)


def test_leakage_lets_the_boom_sink() -> None:
    plant = Plant(_switched_on("internal_leakage"))
    run = plant.simulate(plant.initial(FORTY_FIVE, 20e5), np.zeros(20000), 1e-3, 1000)
    assert run[-1, 2] < run[0, 2] - 1e-3


def test_external_leakage_empties_its_own_chamber_alone() -> None:
    plant = _with(external_leakage={"lowering": 2e-12})
    state = plant.initial(FORTY_FIVE, 50e5)
    rate = plant.derivative(state, 0.0)
    c, h = plant.machine.cylinder, plant.outputs(state).stroke
    flow = -rate[core.P_S] * (c.volume_lowering_0 - c.area_lowering * h) / c.beta
    assert flow == pytest.approx(2e-12 * (50e5 - plant.machine.supply.pT))
    assert rate[core.P_H] == pytest.approx(0.0, abs=1e-6)


def test_air_softens_at_low_pressure_and_is_gone_at_high() -> None:
    oil = Plant(_switched_on("entrained_air")).record[0]
    soft = [entrained_air.stiffness(p, oil) for p in np.geomspace(1e5, 1e9, 30)]
    assert all(a <= b for a, b in itertools.pairwise(soft))
    assert soft[-1] == pytest.approx(oil["beta"], rel=1e-3)
    # bubbles alone: p n / a at 1 bar, in series with the oil
    share, n = oil["entrained_air_share"], oil["entrained_air_exponent"]
    series = (1.0 + share) / (share / (n * 1e5) + 1.0 / oil["beta"])
    assert soft[0] == pytest.approx(series, rel=1e-9)


def test_a_hose_is_a_spring_in_series_with_the_oil() -> None:
    """1/K = 1/K_stated + V_h / (V K_hose), for 10 l of hose at 0.7e9 Pa."""
    compliance, volume = 0.010 / 0.7e9, 0.05
    p = _with(vessel_compliance={"lifting": compliance}).record[0]
    found = terms.stiffness(100e5, volume, compliance, p)
    assert 1.0 / found == pytest.approx(1.0 / p["beta"] + 0.010 / (volume * 0.7e9))
    assert terms.stiffness(10e5, volume, compliance, p) == found  # whatever the pressure
    assert vessel_compliance.lifting(volume, p) == compliance  # whatever the volume


@pytest.mark.parametrize("softer", [0.5, -0.25])
def test_a_chamber_of_another_stiffness_takes_up_more_the_larger_it_is(softer: float) -> None:
    """1/K = (1 + softer) / K_stated at any volume."""
    stated = MACHINE.cylinder
    compliance = softer * stated.volume_lowering_0 / stated.beta
    p = _with(vessel_compliance={"lowering": compliance, "wall_share": 1.0}).record[0]
    for volume in np.array([0.3, 1.0, 2.5]) * stated.volume_lowering_0:
        taken_up = vessel_compliance.lowering(volume, p)
        found = terms.stiffness(100e5, volume, taken_up, p)
        assert found == pytest.approx(stated.beta / (1.0 + softer))
        assert vessel_compliance.lifting(volume, p) == 0.0


def test_a_chamber_never_turns_rigid() -> None:
    p = _with(vessel_compliance={"lifting": -1e-9}).record[0]
    assert terms.stiffness(100e5, 0.02, -1e-9, p) == pytest.approx(5.0 * p["beta"])


# supply and valve


def test_supply_droops_by_r_q_once_the_lag_is_over() -> None:
    resistance = 1e9
    droop = {"supply.p0": 320e5, "effects.supply_pressure_droop.resistance": resistance}
    plant = Plant(with_values(joint1(), droop))
    state = plant.initial(math.radians(30.0), 20e5)
    for _ in range(200):
        state, truth = plant.step(state, 0.55, 1e-2)
    assert state[core.DROOP] == pytest.approx(resistance * truth.flow_lifting, rel=0.02)
    assert state[core.DROOP] == pytest.approx(resistance * 0.5 / 300.0, rel=0.05)
    assert PLAIN.step(PLAIN.initial(FORTY_FIVE), 0.55, 1.0)[0][core.DROOP] == 0.0


def test_a_turbulent_droop_goes_with_the_square_of_the_flow() -> None:
    """As much as a laminar one at the valve's own flow, a quarter of that at half of it."""
    droop = {"resistance": 1e9, "time_constant": 1.0, "turbulent_share": 1.0}
    p = _with(supply_pressure_droop=droop).record[0]
    laminar = _with(supply_pressure_droop=droop | {"turbulent_share": 0.0}).record[0]
    full = p["flow_nominal"]
    at_full = supply_pressure_droop.rate(0.0, full, laminar)
    for share in (0.5, 1.0):
        assert supply_pressure_droop.rate(0.0, share * full, p) == pytest.approx(share**2 * at_full)
    assert supply_pressure_droop.rate(1e5, 0.0, p) == pytest.approx(-1e5)


def test_a_drooping_supply_is_felt_only_where_pressure_is_short() -> None:
    def speed(plant: Plant) -> float:
        run = plant.simulate(plant.initial(math.radians(20.0), 20e5), np.full(3000, 0.9), 1e-3, 10)
        return float(run[-1, T["stroke"]] - run[0, T["stroke"]])

    def slowed(values: dict[str, float]) -> float:
        machine = with_values(joint1(), values)
        droops = with_values(machine, {"effects.supply_pressure_droop.resistance": 1e9})
        return speed(Plant(droops)) / speed(Plant(machine))

    assert slowed({"supply.p0": 320e5}) == pytest.approx(1.0, abs=1e-3)
    assert slowed({"supply.p0": 160e5}) < 0.95


def test_null_offset_and_dead_zone_move_where_the_valve_opens() -> None:
    offset = _with(valve_null_offset={"offset": 0.03}).record[0]
    assert valve.opening(0.07, offset) == pytest.approx(0.0, abs=1e-12)
    assert valve.opening(0.08, offset) > 0.0
    assert valve.opening(-0.13, offset) == pytest.approx(0.0, abs=1e-12)
    assert valve.opening(-0.14, offset) < 0.0
    wide = _with(valve_dead_zone_error={"error": 0.05}).record[0]
    assert valve.opening(0.15, wide) == pytest.approx(0.0, abs=1e-12)
    assert valve.opening(0.16, wide) == -valve.opening(-0.16, wide) > 0.0
    assert valve.opening(1.0, wide) == 1.0
    same = _with(valve_dead_zone_error={"error": 0.05, "rescaled": 0.0}).record[0]
    grown = valve.opening(0.5, same) - valve.opening(0.3, same)
    assert grown == pytest.approx(0.2 / 0.9)  # as stated
    none = _with(valve_dead_zone_error={"error": -0.5}).record[0]
    assert valve.opening(0.01, none) == pytest.approx(0.01)


@pytest.mark.parametrize("edge", [1.0, -1.0])
def test_one_edge_of_the_valve_may_be_off_alone(edge: float) -> None:
    """Where both open elsewhere by as much is a dead zone and a null offset of half of it."""
    alone = _with(valve_dead_zone_error={"error": 0.05, "edge": edge}).record[0]
    both = _with(valve_dead_zone_error={"error": 0.05}).record[0]
    shifted = _with(
        valve_dead_zone_error={"error": 0.025, "rescaled": 0.0},
        valve_null_offset={"offset": -edge * 0.025},
    ).record[0]
    begins = _with(valve_dead_zone_error={"error": 0.05, "edge": edge, "rescaled": 0.0}).record[0]
    for spool in (0.11, 0.14, 0.16, 0.5, 1.0):
        assert valve.opening(edge * spool, alone) == valve.opening(edge * spool, both)
        assert valve.opening(-edge * spool, alone) == valve.opening(-edge * spool, PLAIN.record[0])
        for side in (spool, -spool):
            assert valve.opening(side, begins) == pytest.approx(valve.opening(side, shifted))


def test_gain_asymmetry_scales_the_flow_of_one_direction() -> None:
    plant = _with(valve_gain_asymmetry={"lowering": 0.1})
    flows = []
    for machine, command in itertools.product((PLAIN, plant), (0.5, -0.5)):
        state = machine.initial(FORTY_FIVE, 20e5)
        state[core.SPOOL] = command
        truth = machine.outputs(state)
        flows.append(truth.flow_lifting if command > 0.0 else truth.flow_lowering)
    assert flows[2] == flows[0]
    assert flows[3] == pytest.approx(1.1 * flows[1])


def test_a_gain_may_change_at_the_inlet_alone() -> None:
    """By a tenth and a fifth: the pump's flow is the product, what returns is as it was."""
    asymmetry = {"lifting": 0.1, "lowering": 0.1, "inlet_share": 1.0}
    drift = {"change": 0.2, "time_constant": 60.0, "inlet_share": 1.0}
    plant = _with(valve_gain_asymmetry=asymmetry, flow_gain_drift=drift)
    for command in (0.5, -0.5):
        state = PLAIN.initial(FORTY_FIVE, 20e5)
        state[core.SPOOL], state[core.TIME] = command, 60.0
        before, after = PLAIN.outputs(state), plant.outputs(state)
        from_pump, back = "flow_lifting", "flow_lowering"
        if command < 0.0:
            from_pump, back = back, from_pump
        assert getattr(after, from_pump) == pytest.approx(1.1 * 1.2 * getattr(before, from_pump))
        assert getattr(after, back) == getattr(before, back)


def test_hysteresis_is_a_play_behind_an_overshooting_spool() -> None:
    """Against the spool's exact answer in steps of 0.01 ms, the edges pushed at half the width."""
    width, damping, held, fine = 0.04, 0.3, 300, 100
    values = {"effects.valve_hysteresis.width": width, "valve.damping": damping}
    plant = Plant(with_values(joint1(), values))
    commands = np.repeat([0.6, 0.2, 0.25, -0.5, -0.48, 0.0], held)
    state = plant.initial(FORTY_FIVE, 20e5)
    found = []
    for command in commands:
        state, _ = plant.step(state, command, integration.STEP)
        found.append(valve_hysteresis.edges(state[core.SPOOL], state[core.EDGES], plant.record[0]))

    w = plant.record["natural_frequency"][0]
    given = np.repeat(commands, fine)
    time = np.arange(given.size + 1) * integration.STEP / fine
    spool = signal.TransferFunction([w**2], [1.0, 2.0 * damping * w, w**2])
    _, swung, _ = signal.lsim(spool, np.append(given, 0.0), time, interp=False)
    edges, exact = 0.0, []
    for y in swung[1:]:
        edges = min(max(edges, y - 0.5 * width), y + 0.5 * width)
        exact.append(edges)
    error = np.abs(np.array(found) - exact[fine - 1 :: fine])
    overshoot = 0.7 * math.exp(-math.pi * damping / math.sqrt(1.0 - damping**2))
    assert error.max() < overshoot * (w * integration.STEP) ** 2 / 8.0  # turned back within a step
    assert abs(found[-1]) > 10.0 * error[-1]  # where the last command was 0


@pytest.mark.parametrize("command_share", [0.0, 0.4, 1.0])
def test_hysteresis_gives_two_speeds_for_one_command(command_share: float) -> None:
    """Reached from below, the opening is less by the width than from above."""
    width = 0.04
    values = {"effects.valve_hysteresis.width": width, "valve.damping": 1.0}  # no overshoot
    values["effects.valve_hysteresis.command_share"] = command_share
    plant = Plant(with_values(joint1(), values))

    def flow(commands: tuple[float, ...]) -> float:
        state = plant.initial(FORTY_FIVE, 20e5)
        for command in commands:
            state, truth = plant.step(state, command, 0.3)
        return truth.flow_lifting

    full = MACHINE.valve.flow_nominal
    difference = flow((0.8, 0.5)) - flow((0.2, 0.5))
    assert difference == pytest.approx(full * width / 0.9, rel=0.02)


def test_hysteresis_of_the_magnet_is_a_play_of_the_command() -> None:
    """Against the same machine without it, under the command with the play by hand."""
    width = 0.04
    plant = _with(valve_hysteresis={"width": width, "command_share": 1.0})
    start = plant.initial(FORTY_FIVE, 20e5)
    commands = np.repeat([0.6, 0.59, 0.2, 0.25, -0.5, -0.48, 0.0], 40)
    played, memory = [], 0.0
    for command in commands:
        memory = min(max(memory, command - 0.5 * width), command + 0.5 * width)
        played.append(memory)
    expected = PLAIN.simulate(start, np.array(played), integration.STEP)
    assert np.array_equal(plant.simulate(start, commands, integration.STEP), expected)


@pytest.mark.parametrize("delay", [0.0004, 0.02, 0.0313, 0.15])
def test_delay_shifts_the_whole_answer(delay: float) -> None:
    """Against the same machine without it, under the command shifted by hand."""
    plant = _with(command_delay={"delay": delay})
    start = plant.initial(FORTY_FIVE, 20e5)
    fine, held = 1e-4, 320  # 32 ms
    commands = np.repeat([0.0, 0.5, -0.4, 0.8, 0.8, 0.0, -0.6, 0.3, 0.2, 0.1] * 3, held)
    shifted = np.concatenate([np.zeros(round(delay / fine)), commands])[: commands.size]
    expected = PLAIN.simulate(start, shifted, fine, 10)
    found = plant.simulate(start, commands[::10], 10 * fine)
    error = np.abs(found - expected)[:, T["spool"]]
    # a switch inside an integration step acts as its mean: the spool is off by w^2 jump h^2/8
    jump, p = np.abs(np.diff(commands)).max(), PLAIN.record[0]
    assert error.max() < 1.01 * p["natural_frequency"] ** 2 * jump * integration.STEP**2 / 8.0
    assert plant.simulate(start, commands, fine, 10) == pytest.approx(expected, rel=1e-6, abs=1e-9)


def test_delay_line_keeps_a_command_that_changes_all_the_time() -> None:
    """A sine in steps of 1 ms, more changes than the line holds, arrives late by the delay."""
    delay, dt = 0.1, 1e-3
    p = _with(command_delay={"delay": delay}).record
    time = np.arange(3000) * dt
    arrived = command_delay.delayed(np.sin(2.0 * math.pi * time), dt, p)
    expected = np.where(time < delay, 0.0, np.sin(2.0 * math.pi * (time - delay)))
    assert np.abs(arrived - expected).max() < 0.03
    assert abs(np.mean(arrived - expected)) < 1e-3


@pytest.mark.parametrize("lag_share", [0.05, 0.5, 1.0])
def test_a_lagging_command_rises_as_a_filters_does(lag_share: float) -> None:
    """A step in closed form, as the mean over each period: late by T in all, whatever lags."""
    delay, dt, on = 0.04, 1e-3, 100
    p = _with(command_delay={"delay": delay, "lag_share": lag_share}).record
    arrived = command_delay.delayed(np.repeat([0.0, 0.5], [on, 1000]), dt, p)
    lag = lag_share * delay
    since = np.maximum((np.arange(arrived.size + 1) - on) * dt - (delay - lag), 0.0)
    reached = 0.5 * (since + lag * np.expm1(-since / lag))
    assert arrived == pytest.approx(np.diff(reached) / dt, abs=1e-12)
    assert np.sum(0.5 - arrived[on:]) * dt == pytest.approx(0.5 * delay)


@pytest.mark.parametrize("lag_share", [0.0, 0.6])
def test_delayed_commands_are_what_the_run_itself_delays(lag_share: float) -> None:
    plant = _with(command_delay={"delay": 0.0237, "lag_share": lag_share})
    start = plant.initial(FORTY_FIVE, 20e5)
    commands = np.repeat(np.random.default_rng(1).uniform(-0.8, 0.8, 40), 32)
    arrived = command_delay.delayed(commands, 1e-3, plant.record)
    by_hand = PLAIN.simulate(start, arrived, 1e-3)
    assert plant.simulate(start, commands, 1e-3) == pytest.approx(by_hand, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("dt", [1e-3, 8e-3, 2.5e-3])
@pytest.mark.parametrize(
    "name", ["command_delay", "valve_hysteresis", "supply_pressure_droop", "sensor_delay"]
)
def test_a_state_carries_all_memory(name: str, dt: float) -> None:
    """Step by step, from a state that was put away, and in one run: the same bits."""
    plant = Plant(_switched_on(name))
    state = plant.initial(FORTY_FIVE, 20e5)
    commands = np.array([0.4, 0.4, -0.2, 0.0, 0.7, 0.6, 0.5, -0.9] * 4)
    run = plant.simulate(state, commands, dt)
    for k, command in enumerate(commands):
        kept = state.copy()
        after, shown = plant.step(state, command, dt)
        assert np.array_equal(state, kept)
        assert np.array_equal(plant.step(kept, command, dt)[0], after)
        assert tuple(run[k + 1]) == shown
        state = after


def test_gain_has_drifted_by_its_change_after_a_minute_and_ends() -> None:
    p = _with(flow_gain_drift={"change": 0.2, "time_constant": 60.0}).record[0]
    assert flow_gain_drift.gain(0.0, p) == 1.0
    assert flow_gain_drift.gain(60.0, p) == pytest.approx(1.2)
    end = 0.2 / (1.0 - math.exp(-1.0))
    assert flow_gain_drift.gain(1e6, p) == pytest.approx(1.0 + end)
    assert terms.edges(-0.5, 1e6, 0.5, p) == pytest.approx([-0.5 * (1.0 + end)] * 2)


def test_gain_that_drifts_long_goes_straight_and_never_below_nothing() -> None:
    p = _with(flow_gain_drift={"change": -0.3, "time_constant": 1e5}).record[0]
    assert flow_gain_drift.gain(30.0, p) == pytest.approx(0.85, abs=1e-4)
    assert flow_gain_drift.gain(180.0, p) == pytest.approx(0.1, abs=1e-3)
    assert flow_gain_drift.gain(600.0, p) == 0.0


# logic block


def test_fault_of_the_logic_block_changes_threshold_closing_and_pilot() -> None:
    p = _with(logic_block_fault={"threshold": 10e5, "closing": 1.0, "pilot": 0.25}).record[0]
    stated = MACHINE.logic_block
    assert not logic_block.is_piloted(0.0, stated.threshold + 9e5, p)
    assert logic_block.is_piloted(0.0, stated.threshold + 11e5, p)
    assert logic_block_fault.time_constant_closing(p) == pytest.approx(2.0 * 0.3)
    assert logic_block.opening_rate(1.0, 0.0, p) == pytest.approx(-1.0 / 0.6)
    assert logic_block.pilot_pressure(100e5, 20e5, p) == pytest.approx(80e5)


def test_a_narrow_pilot_line_opens_the_logic_block_late() -> None:
    p = _with(logic_block_fault={"opening": 9.0}).record[0]
    slow = 10.0 * MACHINE.logic_block.time_constant_opening
    assert logic_block.opening_rate(0.0, 120e5, p) == pytest.approx(1.0 / slow)
    assert logic_block.opening_rate(1.0, 0.0, p) == pytest.approx(-1.0 / 0.3)  # shuts as stated


def test_a_poppet_that_the_pressure_holds_open_shuts_below_where_it_opens() -> None:
    """A pilot pressure that rises and falls slowly: between both thresholds all stays as it was."""
    p = _with(logic_block_fault={"threshold": 20e5, "hysteresis": 15e5}).record[0]
    opens = MACHINE.logic_block.threshold + 20e5
    rising = np.arange(opens - 30e5, opens + 10e5, 1e5) + 0.5e5
    opening, way = 0.0, []
    for pilot in (*rising, *rising[::-1]):
        for _ in range(2000):  # 2 s, some closing times
            opening += 1e-3 * logic_block.opening_rate(opening, pilot, p)
        way.append(opening > 0.5)
    up, down = np.split(np.array(way), 2)
    assert up.tolist() == (rising > opens).tolist()
    assert down[::-1].tolist() == (rising > opens - 15e5).tolist()
    assert logic_block.settled(opens - 5e5, p) == 0.0  # a machine at rest was shut before


def test_a_blocked_poppet_opens_as_far_as_it_can_and_throttles_what_leaves() -> None:
    """Over y4^2 its resistance is that of a block whose k is 1 / (1 - blocked)^2 times as large."""
    p = _with(logic_block_fault={"blocked": 0.6}).record[0]
    assert logic_block.opening_rate(0.4, 120e5, p) == 0.0
    assert logic_block.settled(120e5, p) == pytest.approx(0.4)
    assert logic_block.settled(1e5, p) == 0.0
    resting = Plant(with_values(joint1(), {"effects.logic_block_fault.blocked": 0.6}))
    assert resting.initial(FORTY_FIVE, 30e5)[core.LOGIC] == pytest.approx(0.4)
    narrow = with_values(MACHINE, {"resistances.k_block_out": 2.7e10 / 0.4**2})
    lowering = Edges(-0.6, -0.6)
    pressures = Pressures(200e5, 80e5, 20e5)
    throttled = flows(lowering, pressures, 0.4, p)
    assert throttled == pytest.approx(flows(lowering, pressures, 1.0, Plant(narrow).record[0]))


# sensors


@pytest.mark.parametrize("signal", REGISTRY["sensor_bias"].sizes)
def test_gain_and_bias_touch_one_sensor_and_what_is_computed_from_it(signal: str) -> None:
    bias, gain = REGISTRY["sensor_bias"].trial[signal], 0.1
    values = {f"effects.sensor_bias.{signal}": bias, f"effects.sensor_gain.{signal}": gain}
    plant = Plant(with_values(OWN_STROKE if signal == "stroke" else MACHINE, values))
    run = PLAIN.simulate(_moving_state(), np.zeros(300), 1e-3, 10)
    true, shown = readings(PLAIN, run, 1e-2), readings(plant, run, 1e-2)
    assert getattr(shown, signal) == pytest.approx(1.1 * getattr(true, signal) + bias, rel=1e-12)
    computed = {"angle": {"stroke"}, "deflection": set(), "stroke": set()}.get(signal, {"force"})
    for other in set(true._fields) - computed - {signal}:
        assert np.array_equal(getattr(shown, other), getattr(true, other))
    for other in computed:
        assert not np.allclose(getattr(shown, other), getattr(true, other), rtol=1e-6)
    c = plant.machine.cylinder
    force = shown.pressure_lifting * c.area_lifting - shown.pressure_lowering * c.area_lowering
    assert np.array_equal(shown.force, force)


@pytest.mark.parametrize("dead_share", [0.0, 0.5, 1.0])
def test_predicted_readings_are_those_measured_but_for_noise_and_quantisation(
    dead_share: float,
) -> None:
    """With bias, gain and delay at work, along a run in steps of the sensors' period.

    Dead time is exact in the ones and a first-order system in the others.
    """
    machine = with_values(
        MACHINE,
        {
            "effects.sensor_delay.pressure_lifting": 0.05,
            "effects.sensor_delay.angle": 0.2,
            "effects.sensor_delay.deflection": 0.03,
            "effects.sensor_delay.dead_share": dead_share,
            "effects.sensor_gain.pressure_lowering": 0.05,
            "effects.sensor_bias.deflection": 1e-3,
            "sensors.pressure_noise": 0.0,
            "sensors.deflection_noise": 0.0,
            "sensors.resolver_bits": 24,
        },
    )
    plant, dt = Plant(machine), 2e-3
    state = plant.initial(FORTY_FIVE, 20e5)
    commands = np.repeat([0.0, 0.5, 0.5, 0.0, -0.6, -0.6, 0.0, 0.2], 250)
    shown = [measure(plant, plant.outputs(state), 0, state)]
    for k, command in enumerate(commands):
        state, truth = plant.step(state, command, dt)
        shown.append(measure(plant, truth, k + 1, state))
    run = plant.simulate(plant.initial(FORTY_FIVE, 20e5), commands, dt)
    predicted = np.stack(readings(plant, run, dt), axis=1)
    span = np.ptp(predicted, axis=0)
    error = np.sqrt(np.mean((predicted - np.array(shown)) ** 2, axis=0))
    assert (error < (0.02 if dead_share else 1e-3) * span).all()


def test_a_stroke_of_its_own_is_the_pistons_and_late_alone() -> None:
    """Play and linkage error show in it; a bias of the resolver does not."""
    hidden = {
        "effects.backlash.gap": 2e-3,
        "effects.linkage_error.scale": 0.02,
        "effects.sensor_bias.angle": 0.01,
        "effects.sensor_delay.stroke": 0.1,
    }
    plant, dt = Plant(with_values(OWN_STROKE, hidden)), 1e-2
    state = plant.initial(FORTY_FIVE, 20e5)
    shown = [measure(plant, plant.outputs(state), 0, state).stroke]
    true = [plant.outputs(state).stroke]
    for k in range(300):
        state, truth = plant.step(state, 0.4, dt)
        shown.append(measure(plant, truth, k + 1, state).stroke)
        true.append(truth.stroke)
    assert shown[0] == true[0]
    assert shown[-1] < true[-1]
    late = np.interp(0.01 * np.arange(301) - 0.1, 0.01 * np.arange(301), true)
    assert shown[-1] == pytest.approx(late[-1], abs=2e-4)  # a ramp by now


def test_a_sensor_of_dead_time_shows_what_was() -> None:
    plant = _with(sensor_delay={"pressure_lifting": 0.05, "dead_share": 1.0})
    truth = np.zeros((500, len(Truth._fields)))
    time = np.arange(500) * 1e-2
    truth[:, T["pressure_lifting"]] = 1e7 + 1e6 * np.sin(5.0 * time) ** 2
    shown = readings(plant, truth, 1e-2).pressure_lifting
    expected = 1e7 + 1e6 * np.sin(5.0 * np.maximum(time - 0.05, 0.0)) ** 2
    assert shown == pytest.approx(expected, abs=1e-3 * BAR)


@pytest.mark.parametrize("dead_share", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("delay", [1e-4, 0.05])
def test_a_late_sensor_shows_a_ramp_late_by_its_time(delay: float, dead_share: float) -> None:
    """Along a whole run, and by the plant's state, also where no step resolves the time."""
    plant = _with(sensor_delay={"pressure_lifting": delay, "dead_share": dead_share})
    truth = np.zeros((500, len(Truth._fields)))
    truth[:, T["pressure_lifting"]] = ramp = np.arange(500) * 1e4
    shown = readings(plant, truth, 1e-2).pressure_lifting
    assert shown[0] == ramp[0]
    assert ramp[-1] - shown[-1] == pytest.approx(delay / 1e-2 * 1e4)
    behind = 1e6 / sensor_delay.rate(1.0, 0.0, delay, dead_share)  # where the state rises as fast
    by_state = sensor_delay.shown(ramp[-1], ramp[-1] - behind, delay, dead_share)
    assert ramp[-1] - by_state == pytest.approx(delay * 1e6)


@pytest.mark.parametrize("lost", [math.inf, math.nan])
@pytest.mark.parametrize("dead_share", [0.0, 0.3, 1.0])
def test_a_late_sensor_shows_a_run_out_of_all_bounds_up_to_there(
    dead_share: float, lost: float
) -> None:
    """As a fit may try one: what was before stays, and nothing is raised."""
    plant = _with(sensor_delay={"pressure_lifting": 0.05, "dead_share": dead_share})
    truth = np.zeros((500, len(Truth._fields)))
    truth[:, T["pressure_lifting"]] = np.arange(500) * 1e4
    truth[300:, T["pressure_lifting"]] = lost
    shown = readings(plant, truth, 1e-2).pressure_lifting
    assert shown[299] == pytest.approx((299 - 5) * 1e4, rel=1e-3)
    assert not np.any(np.isfinite(shown[310:]))


def test_measuring_with_a_lagging_sensor_needs_the_state() -> None:
    plant = _with(sensor_delay={"angle": 0.05})
    truth = plant.outputs(plant.initial(FORTY_FIVE, 20e5))
    with pytest.raises(ValueError, match=r"effects.sensor_delay.angle: the plant's state"):
        measure(plant, truth, 0)

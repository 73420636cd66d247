"""The blind test's actuator beside the project's: two formulations, two integrators."""

import ast
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from emir_analysis.blind.actuator import hidden
from emir_analysis.blind.actuator.hidden import Hidden
from emir_analysis.blind.actuator.machine import OIL, SPOOL, SWING_WAY, Actuator, Numbers
from emir_analysis.blind.actuator.puzzle import drawn, moves
from emir_analysis.blind.actuator.recording import NOISE
from emir_analysis.blind.machine import Array
from emir_analysis.blind.plan import foreign_effects
from emir_common.parameter_tree import with_values
from emir_plant import actuator as plant

STATED = Numbers(gain=-1.5, lag=2.0, frequency=0.3, friction=0.5)
SHEET = plant.parameters.Actuator(
    plant.parameters.Valve(gain=-1.5, time_constant=2.0),
    plant.parameters.Load(frequency=0.3, viscous_friction=0.5),
)
OPENING = moves(300, np.random.default_rng(3))
FINER = 10  # times shorter steps of the project's RK4: what is compared is the equations
SAME_LAW = 3e-3  # of what an effect makes; most differ by 1e-4, the check valve by 1.5e-3
SOURCES = [
    (Path(__file__).parent / name).read_text()
    for name in ("foreign_actuator.py", "foreign_actuator_more.py")
]
FOREIGN = [effect for source in SOURCES for effect in foreign_effects(source, Hidden)]

# sizes here, and the same in the registry
SAME: dict[type[Hidden], tuple[dict[str, float], dict[str, float]]] = {
    hidden.CommandDelay: ({"late": 2.3}, {"delay": 2.3}),
    hidden.ValveNullOffset: ({"null": 0.06}, {"offset": 0.06}),
    hidden.ValveDeadZoneError: (
        {"overlap_lifting": 0.1, "overlap_lowering": 0.2},
        {"lifting": 0.1, "lowering": 0.2},
    ),
    hidden.ValveGainAsymmetry: ({"excess": 0.6}, {"lowering": 0.6}),
    hidden.ValveHysteresis: ({"half_play": 0.06}, {"play": 0.06}),
    hidden.FlowLimit: (
        {"most_lifting": 0.4, "most_lowering": 0.6},
        {"lifting": 0.4, "lowering": 0.6},
    ),
    hidden.SupplyPressureDroop: (
        {"stall_lifting": 0.2, "stall_lowering": 0.3},
        {"lifting": 0.2, "lowering": 0.3},
    ),
    hidden.ReliefValve: ({"relieved_above": 0.7, "fed_below": 0.5}, {"high": 0.7, "low": 0.5}),
    hidden.LoadHoldingValve: ({"beyond": 0.4}, {"line": 0.4}),
    hidden.InternalLeakage: ({"leak": 0.08}, {"conductance": 0.08}),
    hidden.LineResistance: ({"line": 0.4}, {"coefficient": 0.4}),
    hidden.CoulombFriction: (
        {"dry_friction": 0.3},
        {"force": 0.3, "smoothing_speed": 0.02, "gradual_share": 1.0},
    ),
    hidden.StribeckFriction: (
        {"sticking": 0.5, "kept_sliding": 0.4, "stribeck_speed": 0.2},
        {
            "force": 0.2,
            "breakaway": 0.3,
            "velocity": 0.2,
            "smoothing_speed": 0.02,
            "gradual_share": 1.0,
        },
    ),
    hidden.PressureDependentFriction: (
        {"seal_coefficient": 0.2, "seal_rest": 1.5},
        {"coefficient": 0.2, "rest": 1.5, "smoothing_speed": 0.02, "gradual_share": 1.0},
    ),
    hidden.FlowGainDrift: ({"drift": 5e-4}, {"rate": 5e-4}),
    hidden.TurbulentResistance: ({"turbulent": 0.5}, {"coefficient": 0.5}),
    hidden.ExternalLoad: (
        {"weight": -0.3, "weight_per_way": 0.005},
        {"force": -0.3, "gradient": 0.005},
    ),
    hidden.ElasticBoom: (
        {"compliance": 1.2, "arm_damping": 0.1},
        {"compliance": 1.2, "damping": 0.1},
    ),
    hidden.SwingingLoad: (
        {"hanging_mass": 0.2, "swing_frequency": 0.2, "swing_damping": 0.01},
        {"mass_ratio": 0.2, "frequency": 0.2, "damping": 0.01},
    ),
}


def of_plant(effects: dict[str, float], finer: int = FINER) -> Array:
    """Return the pressure of the project's actuator under the same opening."""
    machine = with_values(SHEET, {f"effects.{path}": value for path, value in effects.items()})
    places = np.arange((OPENING.size - 1) * finer + 1) / finer
    opening = np.interp(places, np.arange(OPENING.size), OPENING)
    return plant.simulate(machine, opening, 1.0 / finer)[::finer]


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def test_a_healthy_actuator_moves_as_the_projects_own() -> None:
    here = Actuator(STATED).run(OPENING)
    assert here.std() > 1.0
    assert rms(here - of_plant({})) < 0.005 * NOISE * here.std()
    assert rms(here - of_plant({}, finer=1)) < 0.2 * NOISE * here.std()  # the steps of a diagnosis


@pytest.mark.parametrize("kind", SAME, ids=lambda kind: kind.name)
def test_an_effect_written_twice_does_the_same(kind: type[Hidden]) -> None:
    sizes, there = SAME[kind]
    here = kind(STATED, sizes).run(OPENING)
    made = rms(here - of_plant({}))
    assert made > 2.0 * NOISE * here.std()  # else nothing is compared
    error = rms(here - of_plant({f"{kind.name}.{k}": v for k, v in there.items()}))
    assert error < SAME_LAW * made


def test_two_effects_act_together() -> None:
    both: Any = type("Both", (hidden.ValveDeadZoneError, hidden.ElasticBoom), {})
    kinds = (hidden.ValveDeadZoneError, hidden.ElasticBoom)
    here = both(STATED, SAME[kinds[0]][0] | SAME[kinds[1]][0]).run(OPENING)
    names = {f"{kind.name}.{k}": v for kind in kinds for k, v in SAME[kind][1].items()}
    assert rms(here - of_plant(names)) < 0.005 * NOISE * here.std()


def test_the_catalogue_is_all_of_the_registry_and_nothing_foreign() -> None:
    names = {effect.name for effect in hidden.CATALOGUE}
    assert names == plant.REGISTRY.keys()
    assert set(hidden.CATALOGUE) == SAME.keys()
    assert not {effect.name for effect in FOREIGN} & names
    assert len({effect.name for effect in FOREIGN}) == len(FOREIGN)


def test_any_two_effects_go_together_in_either_order() -> None:
    """They have sizes of their own, and what both do does not depend on the order."""
    random = np.random.default_rng(1)
    state = random.uniform(-1.0, 1.0, SWING_WAY + 1)
    places = np.arange(OPENING.size, dtype=np.float64)
    for one, other in permutations(hidden.CATALOGUE, 2):
        drawn_sizes = one.draw(random), other.draw(random)
        assert not drawn_sizes[0].keys() & drawn_sizes[1].keys()
        rates = []
        for bases in ((one, other), (other, one)):
            machine: Any = type("Both", bases, {})(STATED, drawn_sizes[0] | drawn_sizes[1])
            flow = machine.flow(state[SPOOL], state[OIL], 3.0)
            shown = machine.shown(state[OIL], flow)
            rates.append([*machine.rates(3.0, state, places, OPENING), flow, shown])
        np.testing.assert_allclose(rates[0], rates[1], err_msg=f"{one.name}, {other.name}")


@pytest.mark.parametrize("effect", FOREIGN, ids=lambda effect: effect.name)
def test_foreign_effects_run_and_change_something(effect: type[Hidden]) -> None:
    """Not in every machine: one that lowers meets no cushion at the upper end."""
    apart = []
    for seed in range(4):
        random = np.random.default_rng(seed)
        numbers, opening = drawn(random), moves(200, random)
        plain = Actuator(numbers).run(opening)
        run = effect(numbers, effect.draw(random)).run(opening)
        assert np.isfinite(run).all()
        apart.append(rms(run - plain) / plain.std())
    assert max(apart) > 0.05


@pytest.mark.parametrize("source", SOURCES, ids=["first", "more"])
def test_foreign_effects_know_neither_the_plant_nor_the_diagnosis(source: str) -> None:
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom):
            assert not str(node.module).startswith(("emir_plant", "emir_analysis.diagnosis"))

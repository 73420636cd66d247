"""What every effect has to satisfy, whichever it is."""

import itertools
import math
from dataclasses import fields

import numpy as np
import pytest

from emir_common.parameter_tree import with_values
from emir_plant import core
from emir_plant.effects import REGISTRY, entrained_air, terms
from emir_plant.parameters import Machine
from emir_plant.plant import Plant
from emir_plant.sheet import joint1

FORTY_FIVE = math.radians(45.0)


def _switched_on(name: str, factor: float = 1.0) -> Machine:
    trial = REGISTRY[name].trial
    size = REGISTRY[name].size
    values = {f"effects.{name}.{key}": value for key, value in trial.items()}
    values[f"effects.{name}.{size}"] = factor * trial[size]
    return with_values(joint1(), values)


def _moving_state() -> np.ndarray:
    state = Plant(joint1()).initial(FORTY_FIVE, 30e5)
    state[core.MODES + 5] = 30.0  # rate of the rigid mode: the boom is being lifted
    return state


@pytest.mark.parametrize("name", REGISTRY)
def test_effect_is_off_by_default_and_vanishes_with_its_size(name: str) -> None:
    state, plain = _moving_state(), Plant(joint1())
    tiny = Plant(_switched_on(name, 1e-9))
    expected = plain.derivative(state, 0.3)
    assert getattr(getattr(plain.machine.effects, name), REGISTRY[name].size) == 0.0
    assert tiny.derivative(state, 0.3) == pytest.approx(expected, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("name", REGISTRY)
def test_effect_reaches_the_model(name: str) -> None:
    state = _moving_state()
    plain = Plant(joint1()).derivative(state, 0.3)
    assert not np.array_equal(Plant(_switched_on(name)).derivative(state, 0.3), plain)


@pytest.mark.parametrize("name", REGISTRY)
def test_effect_is_finite_at_rest_and_without_pressure(name: str) -> None:
    plant = Plant(_switched_on(name, 3.0))
    state = plant.initial(FORTY_FIVE, 0.0)
    state[core.P_H] = 0.0
    assert np.isfinite(plant.derivative(state, 0.0)).all()


@pytest.mark.parametrize("name", REGISTRY)
def test_effect_names_its_source_and_starts_a_search_inside_its_range(name: str) -> None:
    kind = REGISTRY[name]
    assert kind.source
    assert kind.size in kind.trial
    assert kind.trial.keys() <= {field.name for field in fields(kind)}
    _switched_on(name)  # checks the ranges


@pytest.mark.parametrize("name", ["coulomb_friction", "stribeck_friction"])
def test_friction_never_feeds_energy_in(name: str) -> None:
    p = Plant(_switched_on(name)).record[0]
    for velocity in np.linspace(-0.1, 0.1, 201):
        assert terms.friction(velocity, p) * velocity >= 0.0
    assert terms.friction(0.0, p) == 0.0


def test_sliding_friction_is_the_stated_force_and_breakaway_is_higher() -> None:
    coulomb = Plant(_switched_on("coulomb_friction")).record[0]
    assert terms.friction(0.1, coulomb) == pytest.approx(3e3)
    stribeck = Plant(_switched_on("stribeck_friction")).record[0]
    assert terms.friction(0.1, stribeck) == pytest.approx(3e3, rel=1e-3)
    assert max(terms.friction(v, stribeck) for v in np.linspace(0, 0.02, 100)) > 1.2 * 3e3


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


def test_air_softens_at_low_pressure_and_is_gone_at_high() -> None:
    oil = Plant(_switched_on("entrained_air")).record[0]
    soft = [entrained_air.stiffness(p, oil) for p in np.geomspace(1e5, 1e9, 30)]
    assert all(a <= b for a, b in itertools.pairwise(soft))
    assert soft[-1] == pytest.approx(oil["beta"], rel=1e-3)
    # bubbles alone: p n / a at 1 bar, in series with the oil
    share, n = oil["entrained_air_share"], oil["entrained_air_exponent"]
    series = (1.0 + share) / (share / (n * 1e5) + 1.0 / oil["beta"])
    assert soft[0] == pytest.approx(series, rel=1e-9)


def test_payload_is_felt_as_weight_and_inertia() -> None:
    plain, loaded = Plant(joint1()), Plant(_switched_on("payload"))
    extra = (
        loaded.outputs(loaded.initial(FORTY_FIVE)).force
        - plain.outputs(plain.initial(FORTY_FIVE)).force
    )
    from emir_plant import linkage

    moment = 100.0 * 9.81 * 22.5 * math.cos(FORTY_FIVE)
    assert extra * linkage.lever_arm(FORTY_FIVE, plain.record[0]) == pytest.approx(moment)

"""Many machines at a time give what each gives by itself."""

import math

import numpy as np
import pytest

from emir_common.parameter_tree import with_values
from emir_plant.core import Truth
from emir_plant.effects import REGISTRY
from emir_plant.lanes import LANES, simulate_many
from emir_plant.plant import Plant
from emir_plant.sheet import joint1

COMMANDS = np.repeat([0.0, 0.6, 1.0, -0.05, -0.6, 0.0, 0.3, -1.0], 25)  # lifting, lowering, shut
PERIOD, EVERY = 8e-3, 5  # s; samples
PRESSURE = Truth._fields.index("pressure_lifting")


def _machines(count: int) -> list[Plant]:
    """Return machines that switch, saturate and oscillate at instants of their own."""
    values = [
        {
            "geometry.payload": 90.0 * k,
            "geometry.modal_damping": 0.005 + 0.003 * k,
            "cylinder.beta": 0.9e9 + 2e7 * k,
            "cylinder.relief_pressure": 1e7 if k % 3 else 1e9,
            "valve.dead_zone": 0.02 * k,
            "logic_block.pilot": k % 2,
        }
        for k in range(count)
    ]
    return [Plant(with_values(joint1(), each)) for each in values]


def _together(plants: list[Plant]) -> tuple[np.ndarray, np.ndarray]:
    """Return their runs at the same time, and one after the other."""
    starts = np.array(
        [plant.initial(math.radians(30.0 + 1.5 * k), 2e6) for k, plant in enumerate(plants)]
    )
    records = np.concatenate([plant.record for plant in plants])
    each = [
        plant.simulate(start, COMMANDS, PERIOD, EVERY)
        for plant, start in zip(plants, starts, strict=True)
    ]
    return simulate_many(starts, COMMANDS, PERIOD, EVERY, records), np.array(each)


@pytest.mark.parametrize("count", [1, LANES, LANES + 3])
def test_every_bit_is_that_of_a_machine_by_itself(count: int) -> None:
    together, each = _together(_machines(count))
    assert np.isfinite(each).all()
    assert np.array_equal(together, each)


def test_one_machine_with_an_effect_keeps_it() -> None:
    plants = _machines(LANES)
    leaking = with_values(plants[5].machine, {"effects.internal_leakage.coefficient": 1e-12})
    together, each = _together([*plants[:5], Plant(leaking), *plants[6:]])
    assert np.array_equal(together, each)
    without, _ = _together(plants)
    assert np.abs(together[5] - without[5])[:, PRESSURE].max() > 1e4
    assert np.array_equal(np.delete(together, 5, axis=0), np.delete(without, 5, axis=0))


def test_machines_with_every_effect_run_beside_each_other() -> None:
    """One with each of the registry's at the sizes of a first trial, and two without."""
    trials = [
        {f"effects.{effect}.{name}": value for name, value in kind.trial.items()}
        for effect, kind in REGISTRY.items()
    ]
    healthy = _machines(LANES)
    plants = [
        Plant(with_values(healthy[k % LANES].machine, values))
        for k, values in enumerate([{}, *trials, {}])
    ]
    together, each = _together(plants)
    assert np.isfinite(each).all()
    assert np.array_equal(together, each)

"""Steady motion, as the simulated machine goes on from it under a held command."""

import math

import numpy as np
import pytest

from emir_common.parameter_tree import with_values
from emir_plant.core import Truth
from emir_plant.operating_point import at_velocity, under_command
from emir_plant.plant import Plant
from emir_plant.sheet import joint1

FORTY_FIVE = math.radians(45.0)
TRUTH = {name: i for i, name in enumerate(Truth._fields)}
EFFECTS = {
    "none": {},
    "friction": {"effects.coulomb_friction.force": 1e4},
    "viscous friction": {"effects.viscous_friction.coefficient": 1e5},
    "friction by the load": {"effects.pressure_dependent_friction.coefficient": 0.05},
    "friction of seals that give": {
        "effects.pressure_dependent_friction.coefficient": 0.02,
        "effects.pressure_dependent_friction.seal_share": 1.0,
        "effects.pressure_dependent_friction.presliding": 5e-4,
    },
    "blocked poppet": {"effects.logic_block_fault.blocked": 0.4},
    "another lever arm": {"effects.linkage_error.scale": 0.05},
    "leak": {"effects.internal_leakage.coefficient": 1e-12},
    "sagging supply": {"effects.supply_pressure_droop.resistance": 1.5e9},
}


@pytest.mark.parametrize("velocity", [0.05, -0.05])
@pytest.mark.parametrize("effect", EFFECTS)
def test_the_machine_goes_on_as_it_was_found(effect: str, velocity: float) -> None:
    plant = Plant(with_values(joint1(), EFFECTS[effect]))
    state, command = at_velocity(plant, FORTY_FIVE, velocity)
    truth = plant.simulate(state, np.full(300, command), 1e-3)
    # the linkage turns by a degree meanwhile, which is all that may change
    assert truth[:, TRUTH["velocity"]] == pytest.approx(np.full(301, velocity), rel=0.02)
    for pressure in ("pressure_lifting", "pressure_lowering"):
        assert np.ptp(truth[:, TRUTH[pressure]]) < 1.5e5
    assert np.ptp(truth[:, TRUTH["logic_block"]]) < 1e-12


@pytest.mark.parametrize("effect", EFFECTS)
def test_a_command_gives_the_velocity_that_needs_it(effect: str) -> None:
    plant = Plant(with_values(joint1(), EFFECTS[effect]))
    found, command = at_velocity(plant, FORTY_FIVE, -0.02)
    assert under_command(plant, FORTY_FIVE, command) == pytest.approx(found, rel=1e-6, abs=1e-9)

"""The sensors against their data."""

import math

import numpy as np
import pytest

from emir_plant.plant import Plant
from emir_plant.sensors import measure, resolver
from emir_plant.sheet import joint1

PLANT = Plant(joint1())
TRUTH = PLANT.outputs(PLANT.initial(math.radians(45.0), 20e5))


def test_resolver_has_4096_steps_a_turn() -> None:
    angles = np.linspace(0.0, 2.0 * math.pi, 100_000, endpoint=False)
    step = 2.0 * math.pi / 4096
    shown = np.array([resolver(a, PLANT.machine.sensors.resolver_step) for a in angles])
    assert np.unique(np.round(shown / step)).size == 4097  # both ends of the turn
    assert np.abs(shown - angles).max() <= step / 2 * (1 + 1e-9)
    # one step moves the TCP by 34.5 mm
    assert step * 22.5 == pytest.approx(0.0345, abs=1e-4)


def test_noise_has_the_stated_deviation_and_no_bias() -> None:
    readings = [measure(PLANT, TRUTH, k) for k in range(2000)]
    lifting = np.array([r.pressure_lifting for r in readings]) - TRUTH.pressure_lifting
    assert lifting.std() == pytest.approx(0.2e5, rel=0.1)
    assert abs(lifting.mean()) < 4 * 0.2e5 / math.sqrt(2000)
    lowering = np.array([r.pressure_lowering for r in readings]) - TRUTH.pressure_lowering
    assert abs(np.corrcoef(lifting, lowering)[0, 1]) < 0.1


def test_a_reading_can_be_repeated() -> None:
    assert measure(PLANT, TRUTH, 7) == measure(PLANT, TRUTH, 7)
    assert measure(PLANT, TRUTH, 7) != measure(PLANT, TRUTH, 8)


def test_force_is_computed_from_the_pressures() -> None:
    r, c = measure(PLANT, TRUTH, 0), joint1().cylinder
    force = r.pressure_lifting * c.area_lifting - r.pressure_lowering * c.area_lowering
    assert r.force == force

"""Loads over time are found from what they change: a force itself, or a system that swings."""

import math

import numpy as np
import pytest
from scipy.signal import lsim, lti

from emir_analysis.diagnosis.loads import (
    FOR_EVER,
    mean_while_it_acts,
    of_force,
    of_steps,
    slow,
    steady,
    swings,
)
from emir_analysis.signals import Array
from emir_common.parameter_tree import with_values
from emir_plant.effects import external_load
from emir_plant.plant import Plant
from emir_plant.sheet import joint1

TIME = np.arange(0.5, 59.5, 0.25)  # s
OSCILLATOR = lti([1.0], [1.0, 2.0 * 0.02 * 4.4, 4.4**2])  # 0.7 Hz, hardly damped, as the boom
SAMPLES = np.arange(0.0, 40.0, 0.02)  # s


def swinging(size: float, frequency: float, phase: float, begin: float, mean: float = 0.0) -> Array:
    """Return a load that swings about a mean from its begin on."""
    wave = np.cos(2.0 * math.pi * frequency * (TIME - begin) + phase)
    return np.where(begin <= TIME, mean + size * wave, 0.0)


@pytest.mark.parametrize("mean", [0.0, 40e3])
def test_a_load_that_starts_to_swing_is_seen_beside_a_constant_and_noise(mean: float) -> None:
    noise = 500.0 * np.random.default_rng(0).standard_normal(TIME.size)
    _, late = swings(of_force(TIME, swinging(20e3, 0.21, -1.2, 12.0, mean) + 30e3 + noise))
    assert late.force == pytest.approx(20e3, rel=0.05)
    assert late.mean == pytest.approx(mean, abs=2e3)
    assert late.frequency == pytest.approx(0.21, abs=1.0 / (4.0 * TIME[-1]))
    assert late.begin == pytest.approx(12.0, abs=0.5)
    off = 2.0 * math.pi * late.frequency * (12.0 - late.begin) + late.phase + 1.2
    assert abs(math.remainder(off, 2.0 * math.pi)) < 0.3


def test_a_load_that_swings_all_the_time_is_seen() -> None:
    always, _ = swings(of_force(TIME, swinging(20e3, 0.21, -1.2, 0.0)))
    assert always.frequency == pytest.approx(0.21, abs=1.0 / (4.0 * TIME[-1]))
    assert always.begin == 0.0


def gust(size: float, begin: float, end: float, time: Array) -> Array:
    """Return a load that is constant for a while."""
    return np.where((begin <= time) & (time < end), size, 0.0)


def test_a_gust_is_seen_beside_a_constant_and_noise() -> None:
    noise = 500.0 * np.random.default_rng(0).standard_normal(TIME.size)
    found, _ = steady(of_force(TIME, gust(-3e3, 11.8, 25.6, TIME) + 30e3 + noise))
    assert found.force == pytest.approx(-3e3, rel=0.1)
    assert found.begin == pytest.approx(11.8, abs=0.25)
    assert found.begin + found.duration == pytest.approx(25.6, abs=0.25)


def test_a_load_that_stays_lasts_for_ever() -> None:
    _, found = steady(of_force(TIME, gust(3e3, 31.0, 1e3, TIME)))
    assert found.begin == pytest.approx(31.0, abs=0.25)
    assert found.duration == FOR_EVER


def test_a_load_that_comes_slowly_is_seen_beside_a_constant_and_noise() -> None:
    noise = 500.0 * np.random.default_rng(0).standard_normal(TIME.size)
    ramp = -20e3 * np.clip((TIME - 18.3) / 8.5, 0.0, 1.0)
    found = slow(of_force(TIME, ramp + 30e3 + noise))
    assert found.force == pytest.approx(-20e3, rel=0.1)
    assert found.rise == 8.0  # of those that are tried
    assert found.begin + 0.5 * found.rise == pytest.approx(18.3 + 0.5 * 8.5, abs=0.5)


def moved(load: Array) -> Array:
    """Return how the oscillator moves under a load, by scipy."""
    return np.asarray(lsim(OSCILLATOR, load, SAMPLES)[1])


def test_a_gust_is_seen_through_what_swings_after_it() -> None:
    """Each edge leaves swings that a window half a period off would have the other way round."""
    begins = np.arange(0.0, 40.0, 0.25)
    changed = np.array([moved(gust(1.0, begin, 1e3, SAMPLES)) for begin in begins])
    found, _ = steady(of_steps(begins, changed, moved(gust(-300.0, 11.77, 25.56, SAMPLES))))
    assert found.force == pytest.approx(-300.0, rel=0.05)
    assert found.begin == pytest.approx(11.77, abs=0.15)
    assert found.begin + found.duration == pytest.approx(25.56, abs=0.15)


def test_a_swinging_load_is_seen_through_what_swings_itself() -> None:
    begins = np.arange(0.0, 40.0, 0.25)
    changed = np.array([moved(gust(1.0, begin, 1e3, SAMPLES)) for begin in begins])
    wave = 300.0 * np.cos(2.0 * math.pi * 0.3 * (SAMPLES - 9.0) + 0.5)
    always, _ = swings(of_steps(begins, changed, moved(wave)))
    _, late = swings(of_steps(begins, changed, moved(np.where(SAMPLES < 9.0, 0.0, wave))))
    assert always.frequency == pytest.approx(0.3, abs=1.0 / (4.0 * 40.0))
    assert late.frequency == pytest.approx(0.3, abs=1.0 / (4.0 * 40.0))
    assert late.begin == pytest.approx(9.0, abs=0.5)
    assert late.force == pytest.approx(300.0, rel=0.1)


@pytest.mark.parametrize(
    ("start", "duration", "acts"),
    [(25.0, 37.0, (25.0, 62.0)), (-5.0, 1e5, (0.0, 90.0)), (40.0, 1e5, (40.0, 90.0))],
)
def test_a_load_s_mean_is_that_of_the_machine_s_while_it_acts(
    start: float, duration: float, acts: tuple[float, float]
) -> None:
    """Of a slow swing that decays, in a recording of 90 s."""
    values = {"force": 350.0, "mean": -750.0, "frequency": 0.006, "phase": -1.4, "decay": 0.003}
    values |= {"start": start, "duration": duration}
    path = "effects.external_load."
    machine = with_values(joint1(), {path + name: value for name, value in values.items()})
    p = Plant(machine).record[0]
    forces = [external_load.force(float(t), p) for t in np.arange(acts[0] + 0.005, acts[1], 0.01)]
    found = mean_while_it_acts(machine.effects.external_load, 90.0)
    assert found == pytest.approx(np.mean(forces), abs=1.0)
    assert abs(found) > 100.0

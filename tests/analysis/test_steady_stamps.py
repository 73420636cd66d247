"""Stamps put on steady readings late, each by another time, and readings that were unsteady."""

from collections.abc import Callable

import numpy as np
import pytest
from recorded import Array

from emir_analysis.diagnosis.steady_stamps import steadied, steadied_told
from emir_analysis.signals import Signal

Delays = Callable[[np.random.Generator, int], Array]
PERIOD = 0.01  # s


def swinging(time: Array, seed: int) -> Array:
    """Return a boom's swing of 0.7 Hz and its bending of 9 Hz, with noise."""
    noise = np.random.default_rng(seed).standard_normal(time.size)
    return np.asarray(np.sin(4.4 * time) + 0.02 * np.sin(56.0 * time) + 1e-3 * noise)


def stamped(delays: Delays, lost: float = 0.0, seed: int = 0) -> tuple[Signal, Array]:
    """Return a signal read every 10 ms and stamped late by delays, s, and when it was read."""
    random = np.random.default_rng(seed)
    time = 7.0 + PERIOD * np.arange(6000)
    given = np.sort(time + delays(random, time.size))
    kept = random.random(time.size) >= lost
    return Signal("p", given[kept], swinging(time, seed)[kept], "Pa"), time[kept]


def one_sided(deviation: float) -> Delays:
    return lambda random, n: np.abs(random.normal(0.0, deviation, n))


@pytest.mark.parametrize("lost", [0.0, 0.05])
@pytest.mark.parametrize(
    "delays",
    [
        one_sided(0.001),
        one_sided(0.004),
        lambda random, n: random.exponential(0.002, n),
        lambda random, n: random.normal(0.0, 0.001, n),  # a clock read early or late
    ],
)
def test_late_stamps_of_steady_readings_are_put_back(delays: Delays, lost: float) -> None:
    signal, read = stamped(delays, lost)
    steady = steadied({"p": signal})["p"]
    off = steady.time - read
    assert np.quantile(np.abs(off), 0.99) < 5e-4
    assert np.all(np.diff(steady.time) > 0.0)
    np.testing.assert_array_equal(steady.value, signal.value)


@pytest.mark.parametrize("deviation", [0.001, 0.003])
def test_readings_that_were_unsteady_keep_their_stamps(deviation: float) -> None:
    random = np.random.default_rng(3)
    time = np.sort(PERIOD * np.arange(6000) + random.normal(0.0, deviation, 6000))
    assert steadied({"p": Signal("p", time, swinging(time, 1), "Pa")}) == {}


@pytest.mark.parametrize("deviation", [0.0, 1.0])
def test_what_tells_nothing_keeps_its_stamps(deviation: float) -> None:
    """Of a sensor that shows noise alone, or stands still, no time is smoother than another."""
    signal, _ = stamped(one_sided(0.004))
    noise = deviation * np.random.default_rng(5).standard_normal(signal.time.size)
    assert steadied({"p": Signal("p", signal.time, noise, "Pa")}) == {}


def test_sensors_tell_it_together() -> None:
    """The noisy one alone could not, and would then lag behind the other."""
    clear, _ = stamped(one_sided(0.004))
    noisy, read = stamped(one_sided(0.004), seed=1)
    noisy.value[:] += np.random.default_rng(6).standard_normal(read.size)
    assert steadied({"q": noisy}) == {}
    assert set(steadied({"p": clear, "q": noisy})) == {"p", "q"}


def test_no_steady_period_is_found_where_none_is() -> None:
    time = np.cumsum(np.random.default_rng(4).exponential(PERIOD, 6000))
    assert steadied({"p": Signal("p", time, swinging(time, 1), "Pa")}) == {}


def test_steady_stamps_stay_as_they_are_and_nothing_is_told() -> None:
    signal, _ = stamped(lambda _, n: np.zeros(n))
    steady = steadied({"p": signal})
    assert steady == {}
    assert steadied_told("run", {"p": signal}, steady) == []


def test_it_is_told_of_which_and_by_how_much() -> None:
    sensors = {"p": stamped(one_sided(0.004))[0]}
    (line,) = steadied_told("run", sensors, steadied(sensors))
    assert line.startswith("run: stamps of p scatter by 2.")

"""Noise that stays from sample to sample, made by a recursion of its own, and what it leaves."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import recorded
from operated import operated

from emir_analysis.diagnosis.balances import BALANCES
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.experiment import OUTPUTS, Experiment
from emir_analysis.diagnosis.free_run import COMPARED, free_runs
from emir_analysis.diagnosis.noise_colour import coloured, colours
from emir_common.parameter_tree import with_values
from emir_plant.sheet import joint1

MACHINE = joint1()
TOLD = [list(BALANCES).index(name) for name in ("lifting_chamber", "lowering_chamber", "bending")]
NOISE = [0.0, 0.2e5, 0.2e5, 2e-5]  # Pa, Pa, rad


def recursive(samples: int, share: float, seed: int) -> recorded.Array:
    """Return noise of variance 1, each sample with a share of the one before."""
    random = np.random.default_rng(seed)
    found = [random.standard_normal()]
    for fresh in random.standard_normal(samples - 1):
        found.append(share * found[-1] + np.sqrt(1.0 - share**2) * fresh)
    return np.array(found)


def read(noise: Callable[[int, int], recorded.Array]) -> Experiment:
    """Return a recording whose sensors add that noise, of so many samples and a seed, to truth."""
    rest = np.zeros(round(3.0 / recorded.COMMAND_PERIOD))
    seen = operated(MACHINE, np.concatenate([rest, recorded.moves(30.0, seed=5)]))
    (ideal,) = free_runs([MACHINE], seen, [(0.8, 20e5)])
    added = np.column_stack([noise(len(ideal), k) for k in range(len(OUTPUTS))])
    outputs = ideal[:, COMPARED] + NOISE * added
    return replace(seen, outputs=outputs)


@pytest.mark.parametrize("share", [0.5, 0.8, 0.9])
def test_the_colour_of_noise_is_told_from_the_time_at_rest(share: float) -> None:
    told = colours(read(lambda n, k: recursive(n, share, seed=k)), MACHINE)
    assert told[0] == 0.0  # a resolver's steps
    assert told[1:] == pytest.approx(3 * [share], abs=0.13)


@pytest.mark.parametrize(
    "noise",
    [
        lambda n, k: recursive(n, 0.0, seed=k),
        lambda n, k: 0.3 * recursive(n, 0.0, seed=k),  # stated too large
        lambda n, k: recursive(n, 0.0, seed=k) + 3.0 * np.sin(0.02 * np.arange(n)),  # a load swings
        lambda n, k: np.floor(recursive(n, 0.0, seed=k) + 0.002 * np.arange(n)),  # coarse steps
    ],
)
def test_what_is_no_colour_of_noise_is_not_told_as_one(
    noise: Callable[[int, int], recorded.Array],
) -> None:
    assert not np.any(colours(read(noise), MACHINE))


def test_a_sensor_without_noise_has_no_colour() -> None:
    exact = with_values(MACHINE, {"sensors.pressure_noise": 0.0})
    told = colours(read(lambda n, k: recursive(n, 0.8, seed=k)), exact)
    assert told[:3].tolist() == [0.0, 0.0, 0.0]
    assert told[3] > 0.0


def test_the_balances_floor_knows_of_it() -> None:
    """By as much more than of white noise as the true machine leaves of such a recording."""
    floors, left = [], []
    for share in (0.0, 0.85):
        evidence = Evidence([read(lambda n, k, s=share: recursive(n, s, seed=k))], MACHINE)
        floors.append(evidence.floor(MACHINE)[TOLD])
        (lacking,) = evidence.residuals([MACHINE])
        left.append(np.sqrt(np.mean(np.square(lacking[:, TOLD]), axis=0)))
    assert left[1][-1] > 2.0 * left[0][-1]
    assert floors[1] / floors[0] == pytest.approx(left[1] / left[0], rel=0.15)


def test_coloured_noise_is_as_large_as_white_noise() -> None:
    white = np.random.default_rng(3).standard_normal((20000, 2))
    noise = coloured(white, np.array([0.9, 0.0]))
    assert np.std(noise, axis=0) == pytest.approx([1.0, 1.0], abs=0.05)
    assert np.mean(noise[1:, 0] * noise[:-1, 0]) == pytest.approx(0.9, abs=0.05)
    assert np.array_equal(noise[:, 1], white[:, 1])

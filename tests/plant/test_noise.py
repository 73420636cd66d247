"""The noise against numpy's own generators."""

import numpy as np
import pytest

from emir_plant.noise import generator

SEEDS = (0, 1, 12, 2**31 - 1)
SAMPLES = (0, 1, 255, 65_536, 123_456_789, 2**32 - 1)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("sample", SAMPLES)
def test_numbers_are_those_of_numpys_generator_begun_with_both(seed: int, sample: int) -> None:
    expected = np.random.default_rng((seed, sample)).standard_normal((2, 6))
    assert np.array_equal(generator(seed, sample).standard_normal((2, 6)), expected)

"""Intervals and tests of errors, on errors whose properties are known."""

import numpy as np
import pytest

from emir_analysis.diagnosis.free_run import block_medians
from emir_analysis.diagnosis.statistics import input_correlation, rms_intervals, whiteness

PERIOD, SLOW = 0.05, 1.4  # s


def test_the_interval_of_white_noise_is_as_wide_as_theory_says() -> None:
    noise = np.random.default_rng(0).standard_normal((6000, 1))
    (found,) = rms_intervals([noise], [PERIOD])
    half = 1.96 / np.sqrt(2.0 * len(noise))  # of the standard deviation, chi squared
    assert found.low == pytest.approx(1.0 - half, abs=half)
    assert found.high == pytest.approx(1.0 + half, abs=half)


def test_white_noise_passes_and_the_same_noise_filtered_does_not() -> None:
    passed = 0
    for seed in range(40):
        noise = np.random.default_rng(seed).standard_normal(2000)
        passed += whiteness(noise, PERIOD, SLOW) < 1.0
        filtered = noise[1:] + 0.5 * noise[:-1]
        assert whiteness(filtered, PERIOD, SLOW) > 1.5
    assert 34 <= passed <= 40  # 38 expected at 95 %


def test_what_the_input_explains_is_seen_at_its_delay() -> None:
    random = np.random.default_rng(1)
    command = np.repeat(random.standard_normal(400), 10)
    noise = random.standard_normal(command.size)
    late = np.concatenate([np.zeros(20), command[:-20]])
    assert input_correlation(noise, command, PERIOD, SLOW) < 0.2
    assert input_correlation(late + noise, command, PERIOD, SLOW) == pytest.approx(0.7, abs=0.1)


def test_recordings_of_different_sampling_count_by_their_time() -> None:
    """60 s of error 1 at 100 Hz beside 75 s of error 3 at 10 Hz: four blocks beside five."""
    errors, periods = [np.full((6000, 1), 1.0), np.full((750, 1), 3.0)], [0.01, 0.1]
    assert block_medians(errors, periods) == 3.0
    (found,) = rms_intervals(errors, periods)
    middle = np.sqrt((12 * 1.0 + 15 * 9.0) / 27)  # of blocks of 5 s
    assert found.low < middle < found.high
    assert found.high < 2.8

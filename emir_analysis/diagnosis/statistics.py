"""How sure an error is, and what it still knows of its own past and of the input."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import correlate
from scipy.stats import chi2

from emir_analysis.signals import Array

BOOTSTRAP_BLOCK = (
    5.0  # s of a bootstrap's blocks: some periods of the slow mode, so that they are independent
)
DRAWS = 1000
CONFIDENCE = 0.95
LAG_STEP = 0.05  # s, between the lags of the tests: 14 and more in a period of the slow mode
PERIODS = 2.0  # of the slow mode, over which the tests look back


@dataclass(frozen=True)
class Interval:
    """Bounds between which a figure lies in 95 of 100 repetitions."""

    low: float
    high: float


def rms_intervals(
    errors: Sequence[Array], periods: Sequence[float], block: float = BOOTSTRAP_BLOCK
) -> list[Interval]:
    """Return the interval of each column's RMS by bootstrap of blocks, s.

    errors: (n, c) of each recording, sampled every period, s.
    """
    parts: list[Array] = []
    for error, period in zip(errors, periods, strict=True):
        parts += np.array_split(error, max(1, len(error) // max(1, round(block / period))))
    blocks = np.array([np.mean(part**2, axis=0) for part in parts])
    drawn = np.random.default_rng(0).integers(0, len(parts), (DRAWS, len(parts)))
    found = np.sqrt(blocks[drawn].mean(axis=1))
    tail = 0.5 * (1.0 - CONFIDENCE)
    low, high = np.quantile(found, [tail, 1.0 - tail], axis=0)
    return [Interval(float(a), float(b)) for a, b in zip(low, high, strict=True)]


def whiteness(error: Array, period: float, slow_period: float) -> float:
    """Return the Ljung-Box statistic of an error, (n,), over its value at 95 % confidence.

    Below 1: white noise is not rejected. Lags up to two periods of the slow mode, s (Ljung and
    Box 1978).
    """
    every = max(1, round(LAG_STEP / period))
    e = error[::every] - error[::every].mean()
    n, lags = e.size, max(1, min(e.size // 4, round(PERIODS * slow_period / (every * period))))
    power = float(e @ e)
    if power == 0.0:
        return 0.0
    correlations = np.array([float(e[k:] @ e[:-k]) / power for k in range(1, lags + 1)])
    statistic = n * (n + 2.0) * np.sum(correlations**2 / (n - np.arange(1, lags + 1)))
    return float(statistic / chi2.ppf(CONFIDENCE, lags))


def input_correlation(error: Array, command: Array, period: float, slow_period: float) -> float:
    """Return the largest correlation of an error, (n,), with the command, (n,), at any lag.

    Lags from 0 to two periods of the slow mode, s: what the input still explains of the error.
    """
    every = max(1, round(LAG_STEP / period))
    e, u = error[::every] - error[::every].mean(), command[::every] - command[::every].mean()
    norm = float(np.sqrt((e @ e) * (u @ u)))
    if norm == 0.0:
        return 0.0
    lags = max(1, round(PERIODS * slow_period / (every * period)))
    found = correlate(e, u, mode="full")[e.size - 1 : e.size + lags]
    return float(np.max(np.abs(found)) / norm)

"""Where most of a residual lies: told where it does, and not where it does not."""

import numpy as np
import pytest

from emir_analysis.diagnosis.where import where
from emir_analysis.signals import Array

TIME = np.arange(0.5, 60.0, 0.25)  # s, as the balances' windows
COMMAND = 0.5 * np.sin(0.7 * TIME) + 0.4 * np.exp(-(((TIME - 30.0) / 3.0) ** 2))
SIGNALS = {
    "pressure_lifting": ("Pa", 1e7 + 2e6 * np.cos(0.9 * TIME)),
    "valve_command": ("1", COMMAND),
}
NOISE = 0.1


def noisy(residual: Array) -> Array:
    return residual + NOISE * np.random.default_rng(2).standard_normal(TIME.size)


@pytest.mark.parametrize(("sign", "side"), [(1.0, "above"), (-1.0, "below")])
def test_what_sets_in_beyond_a_level_is_told_with_it(sign: float, side: str) -> None:
    """Passed once in the whole recording: no other part foretells it."""
    signals = SIGNALS | {"valve_command": ("1", sign * COMMAND)}
    missing = 5.0 * np.maximum(COMMAND - 0.55, 0.0)
    lies = where(noisy(missing), NOISE, TIME, signals)
    assert (lies.signal, lies.unit, lies.side) == ("valve_command", "1", side)
    assert lies.level is not None
    beyond = sign * lies.level <= COMMAND
    assert np.sum(missing[beyond] ** 2) > 0.85 * np.sum(missing**2)
    assert np.all(missing[beyond] > 0.0)
    above = TIME[COMMAND > 0.55]
    assert above[0] - 0.5 <= lies.begin < lies.end <= above[-1] + 0.5


def test_what_lies_everywhere_lies_beyond_no_level() -> None:
    lies = where(noisy(np.sin(2.2 * TIME)), NOISE, TIME, SIGNALS)
    assert lies.signal is None
    assert lies.level is None
    assert lies.end - lies.begin > 0.8 * (TIME[-1] - TIME[0])


def test_one_gust_lies_in_a_stretch_of_time() -> None:
    gust = 3.0 * np.exp(-(((TIME - 41.0) / 1.5) ** 2))
    lies = where(noisy(gust), NOISE, TIME, SIGNALS)
    inside = (lies.begin <= TIME) & (lies.end >= TIME)
    assert np.sum(gust[inside] ** 2) > 0.8 * np.sum(gust**2)
    assert lies.end - lies.begin < 4.0

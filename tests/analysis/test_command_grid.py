"""A command sampled with the sensors against when it was given."""

import numpy as np
import pytest

from emir_analysis.diagnosis.command_grid import as_given
from emir_analysis.errors import InputError
from emir_analysis.signals import Array, Signal

PERIOD, ROW = 0.032, 0.01  # s
TIME = np.arange(0.0, 30.0, ROW)
SENSORS = [Signal("joint_angle", TIME, np.zeros_like(TIME), "rad")]


def given(phase: float) -> tuple[Array, Array]:
    """Return the times and values of commands: at rest for a second, then ever another one."""
    time = np.arange(phase, 30.0, PERIOD)
    value = np.random.default_rng(1).uniform(-1.0, 1.0, time.size)
    return time, np.where(time < 1.0, 0.0, value)


def held(time: Array, value: Array, at: Array) -> Array:
    return value[np.maximum(np.searchsorted(time, at + 1e-9, side="right") - 1, 0)]


def signal(time: Array, value: Array) -> Signal:
    return Signal("valve_command", time, value, "1")


@pytest.mark.parametrize("phase", [0.0, 0.0031, 0.0173, 0.0318])
def test_a_command_held_over_rows_is_put_back_to_when_it_was_given(phase: float) -> None:
    """32 ms and 10 ms have 2 ms in common: to within half of these the rows tell when."""
    time, value = given(phase)
    found = as_given("run", signal(TIME, held(time, value, TIME)), SENSORS, PERIOD)
    fine = np.arange(0.5, 29.0, 1e-4)
    restored, true = (held(*pair, fine) for pair in ((found.time, found.value), (time, value)))
    sampled = held(TIME, held(time, value, TIME), fine)
    assert np.mean(restored != true) <= 1e-3 / PERIOD + 1e-3
    assert np.mean(sampled != true) > 0.08  # 3.6 ms in 32 and more


def test_a_command_that_was_interpolated_is_told() -> None:
    time, value = given(0.0)
    with pytest.raises(InputError, match="it was interpolated; record it as it was given"):
        as_given("run", signal(TIME, np.interp(TIME, time, value)), SENSORS, PERIOD)


def test_another_command_stays_as_it_is() -> None:
    """Of its own stamps, of no stated period, of another one, ever changing, hardly changing."""
    time, value = given(0.0)
    ramp = np.clip(0.1 * (TIME - 1.0), 0.0, 0.6)
    random = np.random.default_rng(2).uniform(-1.0, 1.0, TIME.size)
    for command, period in (
        (signal(time, value), PERIOD),
        (signal(TIME + 1e-3, held(time, value, TIME)), PERIOD),
        (signal(TIME, held(time, value, TIME)), 0.0),
        (signal(TIME, held(time, value, TIME)), 0.05),
        (signal(TIME, random), PERIOD),
        (signal(TIME, ramp), PERIOD),
        (signal(TIME, np.where(TIME < 5.0, 0.0, 0.5)), PERIOD),
    ):
        assert as_given("run", command, SENSORS, period) is command

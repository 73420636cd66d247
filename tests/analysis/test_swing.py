"""What swings with time is told from what any signal predicts, and from neither."""

import tracemalloc

import numpy as np
import pytest
from scipy.signal import lombscargle

from emir_analysis.diagnosis.shape import best_shape
from emir_analysis.diagnosis.swing import HIGHEST, STEPS, Swing, best_swing, by_swing, swing
from emir_analysis.signals import Array

TIME = np.arange(0.5, 60.0, 0.25)  # s, as the balances' windows
NOISE = 0.1


def signals() -> dict[str, tuple[str, Array]]:
    """Return a command that goes up and down, and a stroke that follows it."""
    command = np.sign(np.sin(0.9 * TIME)) * (np.sin(0.31 * TIME) > -0.5)
    return {
        "valve_command": ("1", command),
        "piston_stroke": ("m", 0.5 + 0.25 * np.cumsum(command) / 20.0),
    }


def found(residual: Array) -> Swing | None:
    predictors = signals()
    noise = NOISE * np.random.default_rng(1).standard_normal(TIME.size)
    shape = best_shape(residual + noise, predictors["valve_command"][1], predictors)
    return swing(residual + noise, TIME, predictors, shape)


@pytest.mark.parametrize("period", [0.8, 1.7, 9.0, 45.0])
def test_a_swing_whatever_the_signals_is_told_with_its_period(period: float) -> None:
    told = found(np.sin(2.0 * np.pi * TIME / period))
    assert told is not None
    assert told.predictor == ""
    assert told.period == pytest.approx(period, rel=0.05)
    ((_, steady, amplitude),) = told.table
    assert (steady, amplitude) == pytest.approx((0.0, 1.0), abs=0.1)


def test_a_swing_of_the_flow_is_told_with_the_command_that_asks_for_it() -> None:
    command = signals()["valve_command"][1]
    lifting = np.where(command > 0.0, 1.0 + np.sin(2.0 * np.pi * TIME / 1.53), 0.0)
    told = found(lifting)
    assert told is not None
    assert told.predictor == "valve_command"
    assert told.period == pytest.approx(1.53, rel=0.01)
    sizes = {round(at): (steady, amplitude) for at, steady, amplitude in told.table}
    assert sizes[1] == pytest.approx((1.0, 1.0), abs=0.1)
    assert sizes[-1] == pytest.approx((0.0, 0.0), abs=0.1)
    again = by_swing(told, lifting, TIME, command)
    assert np.sqrt(np.mean((again - lifting) ** 2)) < NOISE


def test_the_period_is_where_the_largest_line_of_a_periodogram_stands() -> None:
    residual = np.sin(2.0 * np.pi * TIME / 3.3 + 1.0)
    frequencies = np.linspace(0.02, 1.5, 3000)
    line = frequencies[np.argmax(lombscargle(TIME, residual, 2.0 * np.pi * frequencies))]
    assert best_swing(residual, TIME, signals()).period == pytest.approx(1.0 / line, rel=0.01)


def test_memory_grows_with_the_length_of_a_recording_and_not_its_square() -> None:
    time = np.arange(0.5, 300.0, 0.25)
    residual = np.sin(2.0 * np.pi * time / 3.3)
    tracemalloc.start()
    assert best_swing(residual, time, {}).period == pytest.approx(3.3, rel=0.01)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 0.2 * 9 * 8 * time.size * HIGHEST * STEPS * time[-1]  # all at once


@pytest.mark.parametrize("seed", range(5))
def test_noise_and_wandering_without_a_period_are_no_swing(seed: int) -> None:
    noise = np.random.default_rng(seed).standard_normal(TIME.size)
    assert found(noise) is None
    assert found(np.convolve(noise, np.exp(-np.arange(20) / 4.0))[: TIME.size]) is None


def test_what_a_signal_predicts_is_no_swing() -> None:
    stroke = signals()["piston_stroke"][1]
    assert found(np.exp(-(((stroke - stroke.mean()) / 0.1) ** 2)) - 0.5) is None


def test_what_is_always_the_same_is_a_constant_and_no_swing() -> None:
    """As a bias of a pressure transducer is in the balance of forces."""
    predictors = signals()
    steady = 100.0 + NOISE * np.random.default_rng(1).standard_normal(TIME.size)
    shape = best_shape(steady, predictors["valve_command"][1], predictors)
    assert (shape.predictor, shape.by_direction) == ("", False)
    assert shape.share == pytest.approx(1.0, abs=1e-4)
    assert found(np.full_like(TIME, 100.0)) is None

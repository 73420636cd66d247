"""Readings that jump away and back: a few are left out and told."""

import numpy as np
import pytest
from operated import moved

from emir_analysis.diagnosis.experiment import ANGLE, COMMAND, OUTPUTS, Experiment, experiment
from emir_analysis.diagnosis.wild_readings import tamed
from emir_analysis.errors import InputError
from emir_analysis.signals import Array, Recording, Signal
from emir_plant.sheet import joint1

MACHINE = joint1()
NOISE = MACHINE.sensors.pressure_noise


def pressure(wild: dict[int, float], samples: int = 3000) -> Signal:
    """Return a pressure that swings, at 100 Hz, with wild readings at some samples."""
    time = np.arange(samples) * 0.01
    value = 8e6 + 2e6 * np.sin(time) + NOISE * np.random.default_rng(2).standard_normal(samples)
    for k, reading in wild.items():
        value[k] = reading
    return Signal("pressure_lifting", time, value, "Pa")


def times_lost(signal: Signal, kept: Signal) -> list[float]:
    """Return the times of a signal that another has not."""
    return sorted(set(signal.time.tolist()) - set(kept.time.tolist()))


@pytest.mark.parametrize(
    "wild",
    [
        {},
        {700: 0.0},
        {700: 0.0, 701: 2.4e7, 702: 0.0},
        {700: 8.7e6 + 2e6 * np.sin(7.0), 800: 8e6 + 2e6 * np.sin(8.0) - 7e5},  # 35 times the noise
        {700: 2e7, 780: 2e7, 2500: 0.0},  # of the first two the good ones in between stay
        dict.fromkeys(range(700, 708), -999.0),
    ],
)
def test_a_few_are_left_out_and_nothing_else(wild: dict[int, float]) -> None:
    signal = pressure(wild)
    kept, told = tamed("run", signal, MACHINE)
    assert times_lost(signal, kept) == pytest.approx([k * 0.01 for k in wild])
    assert bool(told) == bool(wild)
    assert "\n" not in told


def test_it_is_told_which_and_how_many() -> None:
    _, told = tamed("run", pressure({700: 0.0, 900: 0.0}), MACHINE)
    assert told.startswith(
        "run: 2 of 3000 readings wild and left out: pressure_lifting shows 0 at 7.0"
    )


@pytest.mark.parametrize(
    "wild", [dict.fromkeys(range(700, 750), -999.0), dict.fromkeys(range(50, 3000, 70), 0.0)]
)
def test_long_or_many_ones_are_refused(wild: dict[int, float]) -> None:
    with pytest.raises(InputError, match="check the sensor's wiring and record again"):
        tamed("run", pressure(wild), MACHINE)


def test_a_step_is_not_wild() -> None:
    signal = pressure({})
    stepped = Signal(signal.name, signal.time, signal.value + 1e7 * (signal.time > 9.0), "Pa")
    assert tamed("run", stepped, MACHINE).signal is stepped


@pytest.mark.parametrize("period", [0.01, 0.04])
def test_a_shock_that_swings_on_is_not_wild(period: float) -> None:
    """Of 10 Hz, a single reading wide where those are 40 ms apart."""
    time = np.arange(0.0, 30.0, period)
    since = np.maximum(time - 9.01, 0.0)
    shock = 1e6 * np.exp(-since / 0.15) * np.sin(20.0 * np.pi * since)
    noise = NOISE * np.random.default_rng(2).standard_normal(time.size)
    signal = Signal("pressure_lifting", time, 8e6 + 2e6 * np.sin(time) + shock + noise, "Pa")
    assert tamed("run", signal, MACHINE).signal is signal


def as_recorded(run: Experiment, lifting: Array) -> Experiment:
    """Return a run as it is opened from its signals, with another p_H."""
    shown = dict(zip(OUTPUTS, run.outputs.T, strict=True)) | {"pressure_lifting": lifting}
    signals = {name: Signal(name, run.time, value, "") for name, value in shown.items()}
    signals[ANGLE] = Signal(ANGLE, run.time, run.angle, "rad")
    signals[COMMAND] = Signal(COMMAND, run.time[:-1], run.commands[:: run.every], "1")
    return experiment("run", Recording(signals, 0), MACHINE)


def test_the_recording_is_nearly_what_it_would_have_been() -> None:
    run = moved(MACHINE)
    lifting = run.outputs[:, 1]
    places = [400, 800, 1203]
    spoilt = lifting.copy()
    spoilt[places] = [0.0, 3e7, 0.0]
    right, spared = as_recorded(run, lifting), as_recorded(run, spoilt)
    assert right.mended == ()
    assert len(spared.mended) == 1
    apart = np.abs(spared.outputs - right.outputs)
    assert np.flatnonzero(np.any(apart > 0.0, axis=1)).tolist() == places
    assert np.max(apart[:, 1]) < 6.0 * NOISE

"""Sensors read at instants of their own, of a machine that scipy integrates, and its free run."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import recorded
from recorded import COMMAND_PERIOD, Array

from emir_analysis.diagnosis.experiment import (
    ANGLE,
    COMMAND,
    COMMAND_STEP,
    OUTPUTS,
    Experiment,
    experiment,
)
from emir_analysis.diagnosis.free_run import COMPARED, free_runs
from emir_analysis.diagnosis.sampling import Sampling
from emir_analysis.root_mean_square import column_rms
from emir_analysis.signals import Recording, Signal
from emir_plant import linkage
from emir_plant.plant import Plant
from emir_plant.sheet import joint1

MACHINE = joint1()
ARM = linkage.lever_arm(np.pi / 4.0, Plant(MACHINE).record[0])  # m
NOISE = [ARM * recorded.STEP / np.sqrt(12.0), 0.2e5, 0.2e5, 2e-5]  # m, Pa, Pa, rad
TOPICS = dict(
    zip(
        (ANGLE, *OUTPUTS),
        ("joint_states", "cylinder", "pressure_lifting", "pressure_lowering", "boom_deflection"),
        strict=True,
    )
)


@cache
def truth() -> tuple[Array, Array]:
    commands = recorded.moves(14.0, seed=3)
    return commands, recorded.simulate(MACHINE, commands)


def read(kept: dict[str, Array], late: float = 0.0) -> Experiment:
    """Return a recording of which each sensor has the samples kept, all of them when not named.

    late: standard deviation, s, of the normal distribution whose half the stamps' delays are.
    """
    random = np.random.default_rng(8)
    shown = recorded.measured(MACHINE, truth()[1], seed=1)
    signals = {}
    for name, topic in TOPICS.items():
        time, value = shown[topic]
        samples = kept.get(name, np.arange(time.size))
        delays = np.abs(random.normal(0.0, late, samples.size))
        signals[name] = Signal(name, np.sort(time[samples] + delays), value[samples], "")
    return seen_by(signals)


def seen_by(sensors: dict[str, Signal]) -> Experiment:
    commands, _ = truth()
    time = np.arange(commands.size) * COMMAND_PERIOD
    command = Signal(COMMAND, time, commands, "1")
    return experiment("run", Recording(sensors | {COMMAND: command}, 0), MACHINE)


def off(seen: Experiment) -> Array:
    """Return the free run's errors, (n, 4), times the noise."""
    (run,) = free_runs([MACHINE], seen, [(np.pi / 4.0, 25e5)])
    return np.asarray((run[:, COMPARED] - seen.outputs) / NOISE)


def every(count: int, first: int = 0) -> Array:
    return np.arange(first, len(truth()[1]), count)


def lost(share: float, seed: int) -> Array:
    left = np.random.default_rng(seed).random(len(truth()[1])) > share
    left[:90] = True  # of the time at rest
    return np.flatnonzero(left)


@pytest.mark.parametrize(
    "kept",
    [
        {},
        {"tip_deflection_angle": every(8)},
        {"tip_deflection_angle": every(9, first=4)},
        {name: every(2) for name in TOPICS} | {"tip_deflection_angle": every(15, first=1)},
        {name: every(2) for name in TOPICS} | {"pressure_lifting": every(5)},
        {name: lost(0.3, seed) for seed, name in enumerate(TOPICS)},
    ],
)
def test_a_free_run_shows_its_own_machine_to_the_noise(kept: dict[str, Array]) -> None:
    assert np.max(column_rms(off(read(kept)))) < 1.05


def test_a_free_run_shows_its_own_machine_though_stamps_came_late() -> None:
    """By 3 ms on average, each by another time."""
    seen = read({}, late=4e-3)
    assert seen.mended
    assert np.max(column_rms(off(seen))) < 1.05


@pytest.mark.parametrize("period", [1.0 / 80.0, 1.0 / 60.0, 1.0 / 30.0, 0.01002])
def test_readings_of_any_steady_period_keep_all_of_their_noise(period: float) -> None:
    """Along lines between two readings a part of it is lost; on a grid of their own none is."""
    true = recorded.simulate(MACHINE, truth()[0], period=period)
    shown = recorded.measured(MACHINE, true, seed=2, period=period)
    seen = seen_by({name: Signal(name, *shown[topic], "") for name, topic in TOPICS.items()})
    assert seen.period == pytest.approx(period, rel=1e-9)
    error = column_rms(off(seen))
    assert np.max(error) < 1.05
    assert np.min(error[1:]) > 0.9  # the stroke's goes by the lever arm


def test_else_the_lines_between_slow_readings_would_stand_as_errors() -> None:
    """What the test above can tell: of the same readings, as if they stood on the grid."""
    seen = read({"tip_deflection_angle": every(15)})
    assert column_rms(off(replace(seen, sampling=Sampling())))[3] > 2.0


def test_the_first_seconds_alone_are_as_in_the_whole() -> None:
    """A reading behind the last sample belongs to the line on which that lies."""
    seen = read({"tip_deflection_angle": every(15), "pressure_lifting": every(7)})
    whole = off(seen)
    for time in (2.0, 3.33, 7.07):
        part = off(seen.until(time))
        np.testing.assert_allclose(part, whole[: len(part)], atol=1e-9)


def test_a_command_between_two_steps_acts_when_it_was_given() -> None:
    """Up to any time, what has been given of a command that comes 0.4 ms later lags by that."""
    commands, _ = truth()
    seen = read({})
    signals = {
        name: Signal(name, seen.time, column, "")
        for name, column in zip(OUTPUTS, seen.outputs.T, strict=True)
    }
    signals[ANGLE] = Signal(ANGLE, seen.time, seen.angle, "rad")
    time = np.arange(commands.size) * COMMAND_PERIOD
    signals[COMMAND] = Signal(COMMAND, time + 4e-4, commands, "1")
    late = experiment("run", Recording(signals, 0), MACHINE)
    given, held = (COMMAND_STEP * np.cumsum(each.commands) for each in (seen, late))
    np.testing.assert_allclose(given - held, 4e-4 * seen.commands, atol=1e-5)

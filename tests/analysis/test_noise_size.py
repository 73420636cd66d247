"""A sensor noisier than its data sheet says is told by what it shows at rest, and no other one."""

from dataclasses import replace

import numpy as np
import pytest
import recorded
from operated import operated

from emir_analysis.diagnosis.experiment import OUTPUTS, Experiment, noise
from emir_analysis.diagnosis.free_run import COMPARED, free_runs
from emir_analysis.diagnosis.noise_size import as_measured
from emir_plant.sheet import Sheet, joint1

MACHINE = joint1()
SHEET = Sheet(MACHINE, {}, {}, ())
STATED = np.array([0.0, 0.2e5, 0.2e5, 2e-5])  # Pa, Pa, rad
SLOW = 5.4  # Hz, a boom that sways at rest


def _read(
    times: tuple[float, float, float], sway: float = 0.0, stands: tuple[float, float] = (3.0, 0.0)
) -> Experiment:
    """Return a recording whose sensors of p_H, p_S and bending have so many times their noise.

    sway: of both pressures, Pa. stands: s, before it moves and after.
    """
    before, after = (np.zeros(round(t / recorded.COMMAND_PERIOD)) for t in stands)
    moves = recorded.moves(30.0, seed=5)
    seen = operated(MACHINE, np.concatenate([before, moves, after]))
    (ideal,) = free_runs([MACHINE], seen, [(0.8, 20e5)])
    outputs = ideal[:, COMPARED].copy()
    white = np.random.default_rng(8).standard_normal((len(outputs), 3))
    outputs[:, 1:] += white * STATED[1:] * times
    outputs[:, 1:3] += sway * np.sin(2.0 * np.pi * SLOW * seen.time)[:, np.newaxis]
    return replace(seen, outputs=outputs)


@pytest.mark.parametrize(
    "times", [(2.0, 2.0, 1.0), (5.0, 5.0, 1.0), (1.0, 1.0, 3.0), (1.7, 1.0, 1.0), (1.0, 3.0, 2.0)]
)
def test_noise_beyond_the_stated_is_taken_as_measured(times: tuple[float, float, float]) -> None:
    sheet, lines = as_measured(SHEET, [_read(times)])
    assert noise(sheet.machine)[1:] == pytest.approx(times * STATED[1:], rel=0.1)
    names = list(OUTPUTS)[1:]
    noisier = [name for name, factor in zip(names, times, strict=True) if factor > 1.0]
    assert [line.split()[0] for line in lines] == noisier
    quiet = [noise(sheet.machine)[1 + k] for k, factor in enumerate(times) if factor == 1.0]
    assert set(quiet) <= set(STATED)


def test_a_boom_that_stands_later_tells_it_as_well() -> None:
    """Half as much again is not for sure within a second before the first move."""
    times = (1.5, 1.0, 1.0)
    sheet, _ = as_measured(SHEET, [_read(times, stands=(0.5, 0.0))])
    assert sheet is SHEET
    sheet, (line,) = as_measured(SHEET, [_read(times, stands=(0.5, 12.0))])
    assert sheet.machine.sensors.pressure_noise == pytest.approx(1.5 * 0.2e5, rel=0.1)
    assert line.startswith("pressure_lifting scatters by")


@pytest.mark.parametrize(
    ("times", "sway"),
    [
        ((1.0, 1.0, 1.0), 0.0),
        ((0.3, 0.3, 0.3), 0.0),
        ((1.0, 1.0, 1.0), 2e5),
    ],
    ids=["as stated", "less", "a boom that sways"],
)
def test_else_it_stays_as_stated(times: tuple[float, float, float], sway: float) -> None:
    sheet, lines = as_measured(SHEET, [_read(times, sway)])
    assert sheet is SHEET
    assert not lines

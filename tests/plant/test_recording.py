"""The machine against the project's own recording of an earlier version of it."""

import math
from pathlib import Path

import numpy as np
import pytest

from emir_analysis.run_signals import load_run
from emir_msgs_py.topics import PLANT_PERIOD, TRUTH
from emir_plant.plant import Plant
from emir_plant.sheet import joint1

LIFT = Path(__file__).parents[2] / "bags" / "lift"  # 45 deg, 20 bar, defaults of the plant node


def test_the_recorded_lift_is_repeated_from_its_valve_commands() -> None:
    run = load_run(LIFT)
    recorded = np.stack([run[signal].value for signal in TRUTH.fields], axis=1)
    time, command = run["true_stroke"].time, run["valve_command"]
    held = np.searchsorted(command.time, time[:-1] + 1e-6, side="right") - 1
    plant = Plant(joint1())
    start = plant.initial(math.pi / 4.0, 20e5)
    repeated = plant.simulate(start, command.value[held], PLANT_PERIOD)
    scale = np.abs(recorded).max(axis=0) + 1e-12
    assert np.ptp(recorded[:, 2]) > 1e-3  # it moves
    assert repeated / scale == pytest.approx(recorded / scale, abs=1e-9)

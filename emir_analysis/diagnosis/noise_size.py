"""Sensors noisier than their data sheet says, by what they show while the valve is shut.

Taken as stated, their noise would be something that the machine does.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from emir_analysis.diagnosis.experiment import OUTPUTS, Experiment, noise
from emir_analysis.root_mean_square import rms
from emir_common.parameter_tree import with_values
from emir_plant.parameters import Machine
from emir_plant.sheet import Sheet

SHUT = 2.0  # s that the valve has been: the boom's fast modes have died away, slow ones do not show
FEWEST = 50  # samples then, by which a size is told
DIFFERENCES = 3  # of which a machine that sways has next to nothing
WHITE = 20.0  # times the variance of white noise has its third difference
MORE = 1.2  # times what is stated: less is left as it is
SURE = 4.0  # standard deviations of the size found
SENSORS = {  # and the parameter of each
    "pressure_lifting": "sensors.pressure_noise",
    "pressure_lowering": "sensors.pressure_noise_lowering",
    "tip_deflection_angle": "sensors.deflection_noise",
}


def as_measured(sheet: Sheet, experiments: Sequence[Experiment]) -> tuple[Sheet, list[str]]:
    """Return the sheet with the noise that recordings show where that is more, and a line for each.

    Of each sensor by itself: one of two transducers may be worn.
    """
    lines, values = [], {}
    stated = dict(zip(OUTPUTS, noise(sheet.machine), strict=True))
    for name, path in SENSORS.items():
        values[path] = float(stated[name])
        size, surely = _size(experiments, sheet.machine, name)
        if surely > MORE * stated[name] > 0.0:
            values[path] = size
            lines.append(
                f"{name} scatters by {size:.2g} {OUTPUTS[name]}, where the data sheet has"
                f" {stated[name]:.2g}: taken as measured"
            )
    return replace(sheet, machine=with_values(sheet.machine, values)) if lines else sheet, lines


def _size(experiments: Sequence[Experiment], machine: Machine, name: str) -> tuple[float, float]:
    """Return the noise of a signal, and how much it is for sure; NaN where nothing tells it."""
    column = list(OUTPUTS).index(name)
    changes = np.concatenate(
        [
            np.diff(each.outputs[:, column], DIFFERENCES)[_stands(each, machine)[DIFFERENCES:]]
            for each in experiments
        ]
    )
    if changes.size < FEWEST or np.isnan(changes).any():
        return float("nan"), float("nan")
    size = rms(changes) / float(np.sqrt(WHITE))
    return size, size / (1.0 + SURE / float(np.sqrt(changes.size)))


def _stands(experiment: Experiment, machine: Machine) -> NDArray[np.bool_]:
    """Tell at which samples, (n,), the valve has been shut for SHUT, or since the start."""
    opened = np.abs(np.append(experiment.commands, 0.0)) > machine.valve.dead_zone
    steps = np.arange(opened.size)
    latest = np.maximum.accumulate(np.where(opened, steps, -opened.size))
    shut = (steps - latest) * experiment.step > SHUT
    return shut[:: experiment.every]

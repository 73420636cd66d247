"""Sensors noisier than their data sheet says, by what they show at rest.

Taken as stated, their noise would be something that the machine does.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from emir_analysis.diagnosis.experiment import OUTPUTS, Experiment, at_rest
from emir_analysis.root_mean_square import rms
from emir_common.parameter_tree import declared, with_values
from emir_plant.parameters import Machine
from emir_plant.sheet import Sheet

FEWEST = 50  # samples at rest, by which a size is told
DIFFERENCES = 3  # of which a machine that sways at rest has next to nothing
WHITE = 20.0  # times the variance of white noise has its third difference
MORE = 1.2  # times what is stated: less is left as it is
SURE = 4.0  # standard deviations of the size found
SENSORS = {  # parameter of the sheet -> the signals that have it
    "sensors.pressure_noise": ("pressure_lifting", "pressure_lowering"),
    "sensors.deflection_noise": ("tip_deflection_angle",),
}


def as_measured(sheet: Sheet, experiments: Sequence[Experiment]) -> tuple[Sheet, list[str]]:
    """Return the sheet with the noise that recordings show where that is more, and a line for each.

    Where a parameter is that of several sensors, all have to be noisier.
    """
    lines = []
    for path, names in SENSORS.items():
        about, stated = declared(sheet.machine)[path]
        shown = [_size(experiments, sheet.machine, name) for name in names]
        told = [(size, surely) for size, surely in shown if not np.isnan(size)]
        if told and all(surely > MORE * stated > 0.0 for _, surely in told):
            size = rms(np.array([size for size, _ in told]))
            sheet = replace(sheet, machine=with_values(sheet.machine, {path: size}))
            lines.append(
                f"{', '.join(names)}: scatter at rest by {size:.2g} {about.unit}, where the data"
                f" sheet's {path} is {stated:.2g}: taken as measured"
            )
    return sheet, lines


def _size(experiments: Sequence[Experiment], machine: Machine, name: str) -> tuple[float, float]:
    """Return the noise of a signal at rest, and how much it is for sure; NaN where none tells."""
    column = list(OUTPUTS).index(name)
    readings = [each.outputs[: at_rest(each, machine), column] for each in experiments]
    told = [each for each in readings if each.size >= FEWEST and not np.isnan(each).any()]
    if not told:
        return float("nan"), float("nan")
    changes = np.concatenate([np.diff(each, DIFFERENCES) for each in told])
    size = rms(changes) / float(np.sqrt(WHITE))
    return size, size / (1.0 + SURE / float(np.sqrt(changes.size)))

"""A pressure noisier than its data sheet says, by what a fit leaves.

Taken as stated, the noise would be something that the machine does.
"""

import math
from dataclasses import replace

from emir_analysis.diagnosis.actuator.fitting import Fitted, free_run_error
from emir_analysis.diagnosis.actuator.record import ActuatorRecord, noise_of
from emir_analysis.diagnosis.select import AT_NOISE
from emir_analysis.diagnosis.statistics import whiteness
from emir_analysis.root_mean_square import rms
from emir_common.parameter_tree import with_values
from emir_plant.actuator import ActuatorSheet

NOISE = "sensor.pressure_noise"


def as_left(
    sheet: ActuatorSheet, fitted: Fitted, record: ActuatorRecord
) -> tuple[ActuatorSheet, str]:
    """Return the sheet with the noise that a fit leaves, if it leaves nothing else, and a line.

    That is where the error is white and no more than the recording scatters from one sample to
    the next. Else the sheet as it is, and no line.
    """
    stated = sheet.machine.sensor.pressure_noise
    error = free_run_error(fitted.machine, record)
    left, slow = rms(error), 2.0 * math.pi / fitted.machine.load.frequency
    only_noise = left <= AT_NOISE * noise_of(record.pressure)
    if not stated or not only_noise or whiteness(error, record.period, slow) >= 1.0:
        return sheet, ""
    line = (
        f"oil_pressure: scatters by {left:.2g}, where the data sheet's {NOISE} is {stated:.2g}:"
        " taken as measured"
    )
    return replace(sheet, machine=with_values(sheet.machine, {NOISE: left})), line

"""Sensors that are all equally late: in a recording the same as a command that comes late."""

import numpy as np

from emir_analysis.diagnosis.trial import Trial, moved, trial
from emir_plant.effects.base import SENSORS
from emir_plant.sheet import Sheet

COMMAND, SENSOR = "command_delay", "sensor_delay"
ALIKE = 0.2  # relative: more apart, and the sensors' delays are their own


def late_command(known: Trial, sheet: Sheet) -> Trial | None:
    """Return a trial with a late command in place of sensors that are all equally late.

    None where they are not, or the command is late as well. It is begun, not fitted.
    """
    if SENSOR not in known.effects or COMMAND in known.effects:
        return None
    fitted = known.unknowns.values(known.x)
    of_each = [f"effects.{SENSOR}.{name}" for name in SENSORS]
    delays = np.array([fitted[path] for path in of_each if path in fitted])
    if np.ptp(delays) > ALIKE * np.max(delays):
        return None
    others = known.without(SENSOR)
    begun = trial(sheet, (*others.effects, COMMAND), others)
    delay = begun.unknowns.members[-1].at(float(np.mean(delays)))
    return begun.at(moved(begun.x, [begun.x.size - 1], [delay]))

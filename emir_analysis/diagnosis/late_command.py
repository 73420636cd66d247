"""Sensors that are all equally late: in a recording the same as a command that comes late."""

import numpy as np

from emir_analysis.diagnosis.trial import Trial, moved, trial
from emir_plant.effects.base import SENSORS
from emir_plant.sheet import Sheet

COMMAND, SENSOR = "command_delay", "sensor_delay"
ALIKE = 0.2  # relative: more apart, and the sensors' delays are their own


def late_command(known: Trial, sheet: Sheet) -> Trial | None:
    """Return a trial with a late command in place of sensors that are all equally late.

    None where they are not, or the command is late as well. It is begun, not fitted: by no more
    than a command can be late.
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
    dead_share = known.machine.effects.sensor_delay.dead_share
    values = {"delay": float(np.mean(delays)), "lag_share": 1.0 - dead_share}
    places = {unknown.path: k for k, unknown in enumerate(begun.unknowns.members)}
    where = [places[f"effects.{COMMAND}.{name}"] for name in values]
    at = [begun.unknowns.members[k].at(v) for k, v in zip(where, values.values(), strict=True)]
    return begun.at(np.clip(moved(begun.x, where, at), *begun.unknowns.bounds))

"""Values of an actuator's data sheet that are not the machine's: whether one alone explains it.

No effect of the registry: a gain, a frequency or a friction that the sheet states as exact, or
whose range does not hold the machine's. Each is fitted with the parameters, far beyond its range.
"""

from dataclasses import replace

from emir_analysis.diagnosis.actuator.fitting import Begin, Fitted, Fitting
from emir_analysis.diagnosis.actuator.search import RANDOM_STARTS_ALONE, Misstated
from emir_analysis.diagnosis.select import AT_NOISE
from emir_analysis.diagnosis.side_by_side import side_by_side
from emir_common.parameter_tree import declared
from emir_plant.actuator import ActuatorSheet

FARTHEST = 10.0  # times the stated value, or less by as much
GROUPS = ("valve", "load")


def misstated(fitting: Fitting, plain: Fitted) -> Misstated | None:
    """Return the value that alone brings parameters to the noise, the most probable, if one does.

    plain: the fit of the parameters inside their ranges.
    """
    sheet = fitting.sheet
    paths = [path for path in declared(sheet.machine) if path.partition(".")[0] in GROUPS]
    begin = Begin([plain.machine, sheet.machine], drawn=RANDOM_STARTS_ALONE)

    def fitted(path: str) -> Fitted:
        return replace(fitting, sheet=_freed(sheet, path)).fit((), begin)

    fits = [Misstated(*pair) for pair in zip(paths, side_by_side(fitted, paths), strict=True)]
    enough = [found for found in fits if found.fitted.rms <= AT_NOISE * fitting.noise]
    return max(enough, key=lambda found: found.fitted.evidence, default=None)


def _freed(sheet: ActuatorSheet, path: str) -> ActuatorSheet:
    """Return a sheet with one value free to be FARTHEST off, or anything if it is stated as 0."""
    about, value = declared(sheet.machine)[path]
    ends = [value / FARTHEST, value * FARTHEST] if value else [about.low, about.high]
    low, high = (min(max(end, about.low), about.high) for end in sorted(ends))
    return replace(sheet, ranges=sheet.ranges | {path: (low, high)})

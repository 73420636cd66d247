"""Values of the data sheet that are not the machine's: whether one alone explains recordings.

No effect of the registry: an area, a length or a damping that the sheet states as exact, or one
that is further off than its tolerance. Each is tried to first order, beside the parameters, on the
balances and on the free run for as long as that stays near; what promises most is fitted.
"""

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from emir_analysis.diagnosis.candidate import SOFT_NOISE, soft
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.experiment import SHORTEST
from emir_analysis.diagnosis.fit import DIFFERENCE_STEP
from emir_analysis.diagnosis.fitting import FREE_RUN_STEP, fit_balances, fit_free_run, with_spread
from emir_analysis.diagnosis.missing import Missing, in_balances, in_free_run
from emir_analysis.diagnosis.select import STRONG, astray, at_noise, free_run_score, leaves_quiet
from emir_analysis.diagnosis.straight import Straight, least
from emir_analysis.diagnosis.trial import Trial
from emir_analysis.diagnosis.unknowns import ROUNDING, Unknown
from emir_analysis.diagnosis.whole import Progress
from emir_analysis.signals import Array
from emir_common.parameter_tree import declared

STATED = ("geometry", "cylinder", "supply", "valve", "resistances", "logic_block")  # groups
LARGEST = math.log(10.0)  # of a value over the stated one, either way
MOST_FITTED = 2  # of those that promise most on the balances, and on the free run ...
PROMISING = 0.8  # of what parameters alone leave above the noise: the most, to first order


class Misstated:
    """Parameters with one value of the sheet replaced, the last unknown, where that suffices.

    balanced: without effects, fitted to the balances. floor: (5,) of the balances.
    """

    def __init__(
        self, balanced: Trial, evidence: Evidence, floor: Array, progress: Progress
    ) -> None:
        self._balanced, self._evidence, self._floor = balanced, evidence, floor
        self._progress = progress

    def better_than(self, rival: Trial) -> list[Trial]:
        """Return them, if one is clearly better than a rival: the best first, and as good ones."""
        scores = [free_run_score(each, self._evidence, seen=0.0) for each in self._enough]
        limit = free_run_score(rival, self._evidence, seen=0.0) - STRONG
        best = min(scores, default=math.inf)
        if best >= limit:
            return []
        return [self._enough[k] for k in np.argsort(scores) if scores[k] < best + STRONG]

    @cached_property
    def _enough(self) -> list[Trial]:
        self._progress("asking whether one value of the data sheet is another")
        balanced, evidence, floor = self._balanced, self._evidence, self._floor
        starts = [_replaced(balanced, unknown) for unknown in _values(balanced)]
        near = evidence.until(astray(balanced, evidence) + SHORTEST)
        found = _promising(balanced, starts, in_free_run(balanced, near), FREE_RUN_STEP)
        if np.any(evidence.fitted):
            found |= _promising(balanced, starts, in_balances(evidence, floor), DIFFERENCE_STEP)
        fitted = [_fitted(start, evidence, floor) for start in found.values()]
        return [each for each in fitted if each is not None]


def _values(known: Trial) -> list[Unknown]:
    """Return the sheet's values that are no whole numbers and not zero, as their logarithms.

    A search starts where a trial has them.
    """
    found, fitted = [], declared(known.machine)
    for path, (about, value) in declared(known.unknowns.machine).items():
        if path.partition(".")[0] in STATED and isinstance(value, float) and value > 0.0:
            low = max(math.log(about.low / value), -LARGEST) if about.low > 0.0 else -LARGEST
            high = min(math.log(about.high / value), LARGEST)
            start = math.log(fitted[path][1] / value)
            if low < start < high:
                ends = low + ROUNDING, high - ROUNDING
                found.append(Unknown(path, about.unit, value, 1.0, *ends, start, False, True))
    return found


def _replaced(known: Trial, value: Unknown) -> Trial:
    """Return a trial with a value to be fitted, freed of its tolerance if it has one."""
    return known.fixed(value.path, value.value(value.start)).also(value)


def _promising(
    known: Trial, starts: Sequence[Trial], missing: Missing, step: float
) -> dict[str, Trial]:
    """Return those trials, by the value's path, that leave least to first order, if clearly less.

    starts: with one unknown more than the known one or in place of one of its own.
    """
    members, straight = known.unknowns.members, Straight(known, missing, step)
    noise = SOFT_NOISE * straight.left.size
    above = soft(straight.least()[1]) - noise
    if above <= 0.0:
        return {}  # nothing is left to explain
    further = [start.at(np.append(start.x[:-1], start.x[-1] + step)) for start in starts]
    slopes = np.nan_to_num((missing(further) - straight.left) / step)
    costs = []
    for start, slope in zip(starts, slopes, strict=True):
        kept = [k for k, u in enumerate(members) if u in start.unknowns.members]
        with_it = np.column_stack([straight.slopes[:, kept], slope])
        _, rest = least(start.unknowns, start.x, straight.left, with_it)
        costs.append(soft(rest))
    best = [k for k in np.argsort(costs)[:MOST_FITTED] if costs[k] <= noise + PROMISING * above]
    return {starts[k].unknowns.members[-1].path: starts[k] for k in best}


def _fitted(start: Trial, evidence: Evidence, floor: Array) -> Trial | None:
    """Return a trial fitted, if no balance speaks then and the free run is at the noise."""
    if np.any(evidence.fitted):
        start = fit_balances(start, evidence, floor)
    fitted = fit_free_run(start, evidence)
    enough = at_noise(fitted, evidence) and leaves_quiet(fitted, evidence)
    return with_spread(fitted, evidence) if enough else None

"""What changes along a recording: an effect whose size is another at its end than at its begin.

Oil that warms, a gauge that drifts, a seal that goes: effects of the registry are constant, and
none of them explains that. The balances of each window know of its own time alone, and are linear
in a size near the machine that is known: one that goes linearly from begin to end has two numbers.
"""

from dataclasses import dataclass

import numpy as np

from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.fit import DIFFERENCE_STEP
from emir_analysis.diagnosis.loads import LOAD
from emir_analysis.diagnosis.missing import in_balances
from emir_analysis.diagnosis.straight import Straight
from emir_analysis.diagnosis.trial import Trial
from emir_analysis.diagnosis.unknowns import Unknown, unknowns
from emir_analysis.signals import Array
from emir_plant.effects import REGISTRY
from emir_plant.parameters import Machine
from emir_plant.sheet import Sheet

MADE = 0.9  # of the balances' squares above the noise: the least that a size that drifts makes
STEADY = 0.5  # of what any steady one leaves of them: the most that one that drifts may


@dataclass(frozen=True)
class Drift:
    """A size of an effect that goes from one value to another along the first recording.

    path: of the size, dotted. begin, end: SI unit. share: of the squares, above those of the noise,
    that the balances lack with parameters alone.
    """

    path: str
    unit: str
    begin: float
    end: float
    share: float


def drift(balanced: Trial, evidence: Evidence, floor: Array) -> Drift | None:
    """Return the size whose drift makes most of what the balances lack, if one does.

    balanced: without effects, fitted to the balances. floor: (5,) of the balances. None where a
    steady size, of any effect, says nearly as much: beside that another effect may be missing.
    """
    balances = _Balances(balanced, evidence, floor)
    plain = balances.least([])[1]
    slopes = [(size, balances.slope(size)) for size in _sizes(balanced.unknowns.machine)]
    steady = min((balances.least([each])[1] for each in slopes), default=plain)
    best: Drift | None = None
    for size, slope in slopes:
        along, before = balances.along * slope, (1.0 - balances.along) * slope
        ends, drifting = balances.least([(size, before), (size, along)])
        share = 1.0 - drifting / plain
        if share >= max(MADE, best.share if best else 0.0) and drifting <= STEADY * steady:
            begin, end = (size.value(float(x)) for x in ends)
            best = Drift(size.path, size.unit, begin, end, share)
    return best


def _sizes(machine: Machine) -> list[Unknown]:
    """Return the sizes of effects that act in proportion to them, off where they begin."""
    plain = Sheet(machine, {}, {}, ())
    names = [name for name, kind in REGISTRY.items() if name != LOAD and not kind.is_series]
    members = [u for name in names for u in unknowns(plain, (name,)).members]
    return [u for u in members if not (u.shapes or u.is_stepwise or u.logarithmic)]


class _Balances:
    """What the balances of the first recording lack, linear in the parameters about a trial.

    along: (n,) how much of the recording is over where each value is.
    """

    def __init__(self, known: Trial, evidence: Evidence, floor: Array) -> None:
        first = Evidence(evidence.experiments[:1], evidence.stated)
        self._known, self._missing = known, in_balances(first, floor)
        self._straight = Straight(known, self._missing, DIFFERENCE_STEP)
        passed = (first.time - first.time[0]) / np.ptp(first.time)
        self.along = np.repeat(passed, np.count_nonzero(first.fitted))

    def slope(self, size: Unknown) -> Array:
        """Return the slope, (n,), of what is missing by a size."""
        with_it = self._missing([self._known.also(size)])[0]
        return np.asarray(np.nan_to_num(with_it - self._straight.left) / size.start)

    def least(self, further: list[tuple[Unknown, Array]]) -> tuple[Array, float]:
        """Return the best of unknowns more, (j,), with their slopes, (n,) each.

        And the sum of squares that are then left above those of the noise.
        """
        x, left = self._straight.least(further)
        return x[self._known.x.size :], max(float(np.sum(left**2 - 1.0)), 1.0)

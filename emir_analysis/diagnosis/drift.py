"""What changes along a recording: an effect whose size is another at its end than at its begin.

Oil that warms, a gauge that drifts, a seal that goes: effects of the registry are constant, and
none of them explains that. The balances of each window know of its own time alone, and are linear
in a size near the machine that is known: one that goes linearly from begin to end has two numbers.
"""

from dataclasses import dataclass

import numpy as np

from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.fit import DIFFERENCE_STEP, steps_inside
from emir_analysis.diagnosis.loads import LOAD
from emir_analysis.diagnosis.straight import least
from emir_analysis.diagnosis.trial import Trial
from emir_analysis.diagnosis.unknowns import Unknown, Unknowns, unknowns
from emir_analysis.signals import Array
from emir_common.parameter_tree import with_values
from emir_plant.effects import REGISTRY
from emir_plant.parameters import Machine
from emir_plant.sheet import Sheet

MADE = 0.9  # of the balances' squares above the noise: the least that a size that drifts makes
STEADY = 0.5  # of what a steady one leaves of them: the most that one that drifts may


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
    steady size says nearly as much.
    """
    balances = _Balances(balanced, evidence, floor)
    plain = balances.left([])[1]
    best: Drift | None = None
    for size in _sizes(balanced.unknowns.machine):
        slope = balances.slope(size)
        _, steady = balances.left([(size, slope)])
        along, before = balances.along * slope, (1.0 - balances.along) * slope
        ends, drifting = balances.left([(size, before), (size, along)])
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
        self._known, self._evidence, self._floor = known, evidence, floor
        steps = steps_inside(known.x, DIFFERENCE_STEP, known.unknowns.bounds[1])
        moved = map(known.unknowns.at, known.x + np.diag(steps))
        values = self._missing([known.machine, *moved])
        self._left = values[0]
        self._slopes = np.nan_to_num((values[1:] - values[0]) / steps[:, None]).T
        time = evidence.time[: evidence.windows_of_first]
        self.along = np.repeat((time - time[0]) / np.ptp(time), np.count_nonzero(evidence.fitted))

    def _missing(self, machines: list[Machine]) -> Array:
        left = self._evidence.residuals(machines)[:, : self._evidence.windows_of_first]
        return self._evidence.in_noise(left, self._floor)

    def slope(self, size: Unknown) -> Array:
        """Return the slope, (n,), of what is missing by a size."""
        moved = with_values(self._known.machine, {size.path: size.value(size.start)})
        return np.asarray(np.nan_to_num(self._missing([moved])[0] - self._left) / size.start)

    def left(self, further: list[tuple[Unknown, Array]]) -> tuple[Array, float]:
        """Return the best of unknowns more, (j,), with their slopes, (n,) each.

        And the sum of squares that are then left above those of the noise.
        """
        known, members = self._known, tuple(unknown for unknown, _ in further)
        both = Unknowns(known.unknowns.machine, (*known.unknowns.members, *members))
        slopes = np.column_stack([self._slopes, *(slope for _, slope in further)])
        x, left = least(both, np.append(known.x, np.zeros(len(members))), self._left, slopes)
        return x[known.x.size :], max(float(np.sum(left**2 - 1.0)), 1.0)

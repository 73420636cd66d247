"""What is missing beside a fitted trial, which goes with its parameters along straight lines."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from emir_analysis.diagnosis.fit import TOLERANCE_SPREAD, steps_inside
from emir_analysis.diagnosis.missing import Missing
from emir_analysis.diagnosis.trial import Trial
from emir_analysis.diagnosis.unknowns import ROUNDING, Unknown, Unknowns
from emir_analysis.signals import Array


class Straight:
    """What a trial leaves, linear in its unknowns about it.

    missing: trials -> (m, n), what they leave. step: of the slopes, in units of the unknowns. free:
    (k,) which unknowns are moved, all by default. left: (n,) what the known trial leaves. slopes:
    (n, f) by the free unknowns; 0 by one whose neighbour cannot be simulated.
    """

    def __init__(
        self, known: Trial, missing: Missing, step: float, free: NDArray[np.bool_] | None = None
    ) -> None:
        self._known = known
        steps = steps_inside(known.x, step, known.unknowns.bounds[1])
        moves = np.diag(steps)
        if free is not None:
            steps, moves = steps[free], moves[free]
        values = missing([known, *map(known.at, known.x + moves)])
        self.left = values[0]
        self.slopes = np.nan_to_num((values[1:] - values[0]).T / steps)

    def least(
        self, further: Sequence[tuple[Unknown, Array]] = (), expected: Array | None = None
    ) -> tuple[Array, Array]:
        """Return the unknowns, (k + j,), that leave least squares, and what is left, (n,).

        All of the trial, and j further ones, begun at 0, each with its slope, (n,). expected: as
        for the function of that name.
        """
        known = self._known
        members = (*known.unknowns.members, *(unknown for unknown, _ in further))
        both = Unknowns(known.unknowns.machine, members)
        slopes = np.column_stack([self.slopes, *(slope for _, slope in further)])
        begin = np.append(known.x, np.zeros(len(further)))
        return least(both, begin, self.left, slopes, expected)


def least(
    unknowns: Unknowns, x: Array, missing: Array, slopes: Array, expected: Array | None = None
) -> tuple[Array, Array]:
    """Return the vector of unknowns, (k,), that leaves least squares, and what is left, (n,).

    x: (k,) where the straight lines begin. missing: (n,) there, in units of the noise; slopes:
    (n, k). Toleranced parameters are expected as stated. expected: (r, k), of which it is
    expected of the change from x to make little.
    """
    if not x.size:
        return x, missing
    stated = np.where(unknowns.toleranced, 1.0 / TOLERANCE_SPREAD, 0.0)
    further = np.zeros((0, x.size)) if expected is None else expected
    rows = np.vstack([slopes, np.diag(stated), further])
    wanted = np.concatenate([-missing, -stated * x, np.zeros(len(further))])
    low, high = unknowns.bounds
    room = low - x - ROUNDING, high - x + ROUNDING  # the solver wants some
    best = np.clip(x + lsq_linear(rows, wanted, room).x, low, high)
    return best, missing + slopes @ (best - x)

"""The best parameters where what is missing goes with them along straight lines."""

import numpy as np
from scipy.optimize import lsq_linear

from emir_analysis.diagnosis.fit import TOLERANCE_SPREAD
from emir_analysis.diagnosis.unknowns import ROUNDING, Unknowns
from emir_analysis.signals import Array


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

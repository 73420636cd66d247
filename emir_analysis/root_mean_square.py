"""The root mean square, of all values or of each column."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def rms(values: Array) -> float:
    """Return the root mean square of all values, of any shape; their unit."""
    return float(np.sqrt(np.mean(np.square(values))))


def column_rms(values: Array) -> Array:
    """Return the root mean square of each column, (k,), of values, (n, k)."""
    return np.asarray(np.sqrt(np.mean(np.square(values), axis=0)))

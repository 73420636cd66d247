"""The best linear model of an actuator, to hold the physical one against."""

from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.signal import lfilter

from emir_analysis.diagnosis.actuator.record import ActuatorRecord
from emir_analysis.signals import Array

ORDERS, DELAYS = (2, 3), (0, 1, 2, 4)
EVALUATIONS = 40


def linear_model(record: ActuatorRecord) -> Array:
    """Return numerator and denominator, (2, n), of a transfer function fitted to the free run.

    The order and the delay are those of the best fit on the recording.
    """
    fits = [_output_error(record, order, delay) for order, delay in product(ORDERS, DELAYS)]
    return min(fits, key=lambda found: found[0])[1]


def linear_run(model: Array, opening: Array) -> Array:
    """Return the linear model's pressure (n,) from rest."""
    return np.asarray(lfilter(model[0], model[1], opening - opening[0]))


def one_step_error(record: ActuatorRecord, judged: ActuatorRecord) -> Array:
    """Return the errors (n,) one sample ahead of the linear model that predicts best.

    Its order and delay are those of the best fit on `record`; zero for the first few samples.
    """
    _, order, delay = min(
        (float(np.mean(_ahead(record, o, d, _equation_error(record, o, d)) ** 2)), o, d)
        for o, d in product(ORDERS, DELAYS)
    )
    return _ahead(judged, order, delay, _equation_error(record, order, delay))


def _output_error(record: ActuatorRecord, order: int, delay: int) -> tuple[float, Array]:
    size = 1 + max(order, order + delay - 1)

    def model(x: Array) -> Array:
        found = np.zeros((2, size))
        found[0, delay : delay + order] = x[:order]
        found[1, 0] = 1.0
        found[1, 1 : order + 1] = x[order:]
        return found

    def error(x: Array) -> Array:
        with np.errstate(over="ignore", invalid="ignore"):
            run = linear_run(model(x), record.opening) - record.pressure
        return np.asarray(np.clip(np.nan_to_num(run, nan=1e3), -1e3, 1e3))

    result = least_squares(error, _equation_error(record, order, delay), max_nfev=EVALUATIONS)
    return float(result.cost), model(np.asarray(result.x))


def _equation_error(record: ActuatorRecord, order: int, delay: int) -> Array:
    """Return the coefficients that predict one step best."""
    rows = np.arange(order + delay, record.pressure.size)
    past = _past(record, order, delay, rows)
    return np.asarray(np.linalg.lstsq(past, record.pressure[rows], rcond=None)[0])


def _past(record: ActuatorRecord, order: int, delay: int, rows: NDArray[np.int64]) -> Array:
    u, p = record.opening - record.opening[0], record.pressure
    past = [u[rows - delay - k] for k in range(order)]
    past += [-p[rows - k] for k in range(1, order + 1)]
    return np.stack(past, 1)


def _ahead(record: ActuatorRecord, order: int, delay: int, coefficients: Array) -> Array:
    rows = np.arange(order + delay, record.pressure.size)
    error = np.zeros(record.pressure.size)
    error[rows] = _past(record, order, delay, rows) @ coefficients - record.pressure[rows]
    return error

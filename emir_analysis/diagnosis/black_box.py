"""A model that knows no physics, trained on the same recordings: what the physics is worth.

ARX: the next outputs as a linear function of the last ones, of the last commands behind the
dead zone and of a constant; least squares, every signal in units of its spread. Trained on the
signals sampled slowly enough that noise does not rule, its order chosen by the free-run error on
the last third of the training recordings.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.experiment import Experiment
from emir_analysis.root_mean_square import rms
from emir_analysis.signals import Array

ORDERS = (1, 2, 3, 4, 6)
PERIODS = (0.05, 0.1, 0.2)  # s, 7 to 28 samples in a period of the slow mode
SHARE = 2.0 / 3.0  # of a recording, on which the orders are trained before one is chosen
FAR = 10.0  # spreads beyond which a free run has left the machine's range


@dataclass(frozen=True)
class BlackBox:
    """y(k) = [y(k-1) ... y(k-n), u(k-1) ... u(k-n), 1] weights, all scaled; period: s."""

    order: int
    period: float
    weights: Array
    mean: Array
    spread: Array
    dead_zone: float

    def free_run(self, experiment: Experiment) -> Array:
        """Return the outputs, (n, c), under the recorded command alone from the first samples."""
        outputs, inputs, time = _sampled(experiment, self)
        y = np.tile(outputs[0], (len(outputs), 1))
        for k in range(self.order, len(outputs)):
            y[k] = np.clip(_row(y, inputs, k, self.order) @ self.weights, -FAR, FAR)
        columns = [np.interp(experiment.time, time, column) for column in y.T]
        return np.asarray(np.column_stack(columns) * self.spread + self.mean)

    def one_step(self, experiment: Experiment) -> Array:
        """Return the errors, (n, c), of predicting each sample from the measured ones before."""
        outputs, inputs, _ = _sampled(experiment, self)
        predicted = _rows(outputs, inputs, self.order) @ self.weights
        return np.asarray((predicted - outputs[self.order :]) * self.spread)


def train(evidence: Evidence) -> BlackBox:
    """Train on the recordings that the fit had, with the order that runs free best."""
    heads = [e.head(SHARE) for e in evidence.experiments]
    best, least = (PERIODS[0], ORDERS[0]), np.inf
    for period in PERIODS:
        for order in ORDERS:
            model = _fitted(heads, evidence, order, period)
            error = np.concatenate(
                [
                    ((model.free_run(e) - _shown(e, evidence)) / model.spread)[
                        int(SHARE * len(e.angle)) :
                    ]
                    for e in evidence.experiments
                ]
            )
            size = rms(error)
            if size < least:
                best, least = (period, order), size
    return _fitted(list(evidence.experiments), evidence, best[1], best[0])


def train_one_step(evidence: Evidence) -> BlackBox:
    """Train the same at the sensors' own rate, the slowest, for predicting one sample ahead."""
    period = max(experiment.period for experiment in evidence.experiments)
    return _fitted(list(evidence.experiments), evidence, max(ORDERS), period)


def _fitted(
    experiments: Sequence[Experiment], evidence: Evidence, order: int, period: float
) -> BlackBox:
    all_outputs = np.concatenate([_shown(e, evidence) for e in experiments])
    mean = all_outputs.mean(axis=0)
    # a signal that stays where it is has no spread of its own
    spread = np.maximum(all_outputs.std(axis=0), evidence.sensors[evidence.shown])
    dead_zone = evidence.stated.valve.dead_zone
    empty = BlackBox(order, period, np.zeros((0, 0)), mean, spread, dead_zone)
    rows, targets = [], []
    for experiment in experiments:
        outputs, inputs, _ = _sampled(experiment, empty)
        rows.append(_rows(outputs, inputs, order))
        targets.append(outputs[order:])
    weights = np.linalg.lstsq(np.concatenate(rows), np.concatenate(targets), rcond=1e-8)[0]
    return BlackBox(order, period, weights, mean, spread, dead_zone)


def _shown(experiment: Experiment, evidence: Evidence) -> Array:
    return experiment.outputs[:, evidence.shown]


def _sampled(experiment: Experiment, model: BlackBox) -> tuple[Array, Array, Array]:
    """Return scaled outputs (k, c) and inputs (k, 1) on the model's period, and its times (k,)."""
    time = np.arange(0.0, experiment.time[-1] + 1e-9, model.period)
    shown = experiment.outputs[:, ~np.all(np.isnan(experiment.outputs), axis=0)]
    columns = [np.interp(time, experiment.time, column) for column in shown.T]
    outputs = (np.column_stack(columns) - model.mean) / model.spread
    beyond = np.sign(experiment.commands) * np.maximum(
        np.abs(experiment.commands) - model.dead_zone, 0.0
    )
    total = np.concatenate([[0.0], np.cumsum(beyond)])
    steps = round(model.period / experiment.step)
    ends = np.minimum(np.arange(len(outputs) + 1) * steps, beyond.size)
    length = np.maximum(np.diff(ends), 1)
    return outputs, (np.diff(total[ends]) / length)[:, None], time


def _row(outputs: Array, inputs: Array, k: int, order: int) -> Array:
    return np.concatenate([outputs[k - order : k].ravel(), inputs[k - order : k].ravel(), [1.0]])


def _rows(outputs: Array, inputs: Array, order: int) -> Array:
    return np.array([_row(outputs, inputs, k, order) for k in range(order, len(outputs))])

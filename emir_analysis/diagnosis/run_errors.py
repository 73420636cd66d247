"""The errors of free runs, from the state at rest that a machine has where a recording starts."""

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.experiment import Experiment
from emir_analysis.diagnosis.fit import Problem, fit
from emir_analysis.diagnosis.free_run import COMPARED, free_runs
from emir_analysis.diagnosis.starts import Starts
from emir_analysis.diagnosis.trial import Trial
from emir_analysis.signals import Array
from emir_plant.parameters import Machine

FREE_RUN_ACCURACY = 1e-3  # relative, of the free run's squared error: 0.05 % of the error
SETTLING = 5.0  # s from the start in which the state at rest is found
RESTS = 21  # pressures at rest, from the least to the most, that are tried where none is shown


def free_run(machine: Machine, experiment: Experiment, evidence: Evidence) -> Array:
    """Return the free run's outputs, (n, 4), SI units, from the state `at_rest`."""
    start = at_rest(machine, experiment, evidence)
    return free_runs([machine], experiment, [start])[0, :, COMPARED]


@lru_cache(maxsize=16)  # several criteria ask for those of one machine
def free_run_errors(machine: Machine, evidence: Evidence) -> list[Array]:
    """Return simulated minus measured in units of the noise, (n, outputs), for each recording."""
    found = []
    for experiment in evidence.experiments:
        error = (free_run(machine, experiment, evidence) - experiment.outputs) / evidence.sensors
        found.append(error[:, evidence.shown])
    return found


def mean_square(tried: Trial, evidence: Evidence) -> float:
    """Return the mean square of all signals' free-run errors in units of the noise."""
    errors = np.concatenate(free_run_errors(tried.machine, evidence))
    with np.errstate(over="ignore"):  # of a run out of all bounds
        return float(np.mean(errors**2))


def coarse_errors(
    machines: Sequence[Machine],
    evidence: Evidence,
    rest: Sequence[Array] | None = None,
) -> Array:
    """Return weighted errors in units of the noise, (m, n), of coarse free runs of all recordings.

    rest: the two numbers of `Starts` in each recording; as the sensors show when not given.
    """
    count = len(machines)
    rest = [np.zeros(2)] * len(evidence.experiments) if rest is None else rest
    errors = []
    for experiment, point in zip(evidence.experiments, rest, strict=True):
        at = Starts(experiment, evidence).at(np.tile(point, (count, 1)), machines)
        errors.append(weighted_errors(machines, experiment, evidence, at, coarse=True))
    return np.concatenate(errors, axis=1)


def at_rest(machine: Machine, experiment: Experiment, evidence: Evidence) -> tuple[float, float]:
    """Return the angle, rad, and p_S, Pa, from which a machine's free run starts.

    Inside what the sensors leave open at rest, those with the least error over the first seconds;
    the machine is left as it is.
    """
    point = settled(machine, experiment, evidence)
    return Starts(experiment, evidence).at(point[None], [machine])[0]


def settled(machine: Machine, experiment: Experiment, evidence: Evidence) -> Array:
    """Return the state `at_rest` as the two numbers of `Starts`.

    Where no sensor tells p_S it may be anywhere, so the fit begins at the best of several.
    The runs are coarse.
    """
    early, starts = experiment.until(SETTLING), Starts(experiment, evidence)

    def model(points: Array) -> Array:
        machines = [machine] * len(points)
        at = starts.at(points, machines)
        return weighted_errors(machines, early, evidence, at, coarse=True)

    start = np.zeros(2)
    if not starts.is_told:
        points = np.column_stack([np.zeros(RESTS), np.linspace(-1.0, 1.0, RESTS)])
        with np.errstate(over="ignore"):  # of a run out of all bounds
            cost = np.nan_to_num(np.sum(np.square(model(points)), axis=1), nan=np.inf)
        start = points[int(np.argmin(cost))]
    none = np.zeros(2, dtype=bool)
    return fit(Problem(model, start, -np.ones(2), np.ones(2), none), FREE_RUN_ACCURACY).x


def readings(evidence: Evidence) -> float:
    """Return how many readings of all sensors there are, those that stay the same counted once."""
    return float(sum(np.sum(e.weights[:, evidence.shown] ** 2) for e in evidence.experiments))


def weight_of_noise(evidence: Evidence) -> float:
    """Return the RMS weighted error, in units of the noise, of a run that lacks nothing."""
    samples = sum(e.time.size for e in evidence.experiments) * np.count_nonzero(evidence.shown)
    return math.sqrt(readings(evidence) / samples)


def weighted_errors(
    machines: Sequence[Machine],
    experiment: Experiment,
    evidence: Evidence,
    starts: Sequence[tuple[float, float]],
    *,
    coarse: bool = False,
) -> Array:
    """Return weighted errors in units of the noise, one row for each machine.

    Raises OutOfTimeError where the evidence's time is over.
    """
    evidence.limit.check()
    runs = free_runs(machines, experiment, starts, coarse=coarse)[:, :, COMPARED]
    error = (runs - experiment.outputs) * experiment.weights / evidence.sensors
    return np.asarray(error[:, :, evidence.shown].reshape(len(machines), -1))

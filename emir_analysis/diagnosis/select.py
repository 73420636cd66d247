"""Choosing among trials by their error on a part of the recording that no fit has seen."""

import numpy as np

from emir_analysis.diagnosis.balances import BALANCES, FORCE_WINDOW, Balances
from emir_analysis.diagnosis.candidates import LINKAGE, Trial
from emir_analysis.diagnosis.experiment import Experiment
from emir_analysis.diagnosis.free_run import errors
from emir_analysis.signals import Array

SEEN = 2.0 / 3.0  # share of the recording, from its start, that the fits see before the choice
STRONG = 10.0  # difference of two scores that counts as strong evidence (Kass and Raftery 1995)
SPEAKS = np.sqrt(2.0)  # times the floor: what is systematic is then larger than the noise
NAMED = 0.1  # share of what speaks that may be left after an effect that is named
EXPLAINED = 2.0  # times the sensor noise: free-run error up to which a model explains a signal
BLOCK = 1.0  # s: errors closer than this are not counted as independent


def score(mean_squares: Array, independent: float, unknowns: int) -> float:
    """Return a Bayesian information criterion; smaller is better.

    mean_squares: (c,) of each channel's error in units of its noise. independent: number of
    independent errors in a channel.
    """
    misfit = independent * float(np.sum(np.log(mean_squares)))
    return misfit + unknowns * float(np.log(independent * mean_squares.size))


def balance_score(trial: Trial, balances: Balances, floor: Array) -> float:
    """Score a trial on the windows of a recording behind the part that the fit has seen."""
    speaking = np.arange(len(BALANCES)) != LINKAGE
    time = balances.time
    unseen = time > SEEN * time[-1] + FORCE_WINDOW
    missing = (balances.residuals([trial.machine])[0] / floor)[unseen][:, speaking]
    independent = float(np.ptp(time[unseen])) / BLOCK
    return score(np.mean(missing**2, axis=0), independent, trial.x.size)


def free_run_score(trial: Trial, experiment: Experiment, noise: Array) -> float:
    """Score a trial on the free run's continuation behind the part that the fit has seen."""
    time = experiment.time
    unseen = time > SEEN * time[-1]
    error = (errors(trial.machine, experiment) / noise)[unseen]
    if not np.all(np.isfinite(error)):
        return float("inf")
    independent = float(np.ptp(time[unseen])) / BLOCK
    return score(np.mean(error**2, axis=0), independent, trial.x.size)


def rivals(trials: list[Trial], scores: list[float]) -> list[Trial]:
    """Return the trials that the evidence cannot tell from the best, the best first.

    One that needs more parameters for no less error is no rival.
    """
    best = int(np.argmin(scores))
    size = trials[best].x.size
    close = [
        other
        for other, value in zip(trials, scores, strict=True)
        if other is not trials[best] and value < scores[best] + STRONG and other.x.size <= size
    ]
    return [trials[best], *close]


def quiet(rms: Array, floor: Array) -> bool:
    """Tell whether no balance holds more than its noise; rms, floor: (b,)."""
    return bool(np.all(rms <= SPEAKS * floor))


def named(before: Array, after: Array, floor: Array) -> bool:
    """Tell whether what speaks in the balances is down to the noise or to a tenth; (b,) each."""

    def systematic(rms: Array) -> Array:
        return np.asarray(np.sqrt(np.maximum(rms**2 - floor**2, 0.0)))

    return bool(np.all(systematic(after) <= np.maximum(floor, NAMED * systematic(before))))

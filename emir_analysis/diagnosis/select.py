"""Choosing among trials: by the balances, then by a free run that no fit has seen."""

import numpy as np
from scipy.stats import chi2, norm

from emir_analysis.diagnosis.balances import FORCE_WINDOW, level
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.run_errors import free_run_errors, mean_square
from emir_analysis.diagnosis.trial import Trial
from emir_analysis.signals import Array
from emir_plant.parameters import Machine

SEEN = 2.0 / 3.0  # share of each recording, from its start, that the fits see before the choice
STRONG = 10.0  # difference of two scores that counts as strong evidence (Kass and Raftery 1995)
SPEAKS = np.sqrt(2.0)  # times the floor: what is systematic is then larger than the noise
CHANCE = 1e-3  # with which noise alone may make a balance of a short recording speak
LEFT = 1.03  # times the sensor noise, all signals together: more, and a fit is gone on with
AT_NOISE = 1.1  # times the sensor noise: free-run error of a model that lacks nothing
EXPLAINED = 2.0  # times the sensor noise: free-run error up to which a model explains a signal
HOPELESS = 5.0  # times the sensor noise, beyond which a model is not near the truth
PROMISING = 0.3  # share of the rest; a quarter of the step to where all is gone takes 0.44 away
MOST = 0.5  # share of the rest that is most of it
HELPS = 0.9  # of what parameters alone leave: what leaves more does not come close
FEWEST_DRAWN = 8  # draws of the noise, from which on they tell how much a balance varies by chance
CORRELATION_TIME = 1.0  # s: errors closer than this are not counted as independent


def score(mean_squares: Array, independent: float, unknowns: float) -> float:
    """Return a Bayesian information criterion; smaller is better.

    mean_squares: (c,) of each channel's error in units of its noise. independent: number of
    independent errors in a channel.
    """
    misfit = independent * float(np.sum(np.log(mean_squares)))
    return misfit + unknowns * float(np.log(independent * mean_squares.size))


def balance_score(trial: Trial, evidence: Evidence, floor: Array) -> float:
    """Score a trial on the balances of whole recordings. Zero where the signals allow none.

    Each window knows of its own time alone: what acted on the seen part is not in the others.
    """
    if not np.any(evidence.fitted):
        return 0.0
    missing = (evidence.residuals([trial.machine])[0] / floor)[:, evidence.fitted]
    if not np.all(np.isfinite(missing)):
        return float("inf")
    covered = evidence.duration(1.0) - len(evidence.experiments) * FORCE_WINDOW
    independent = covered / CORRELATION_TIME
    # as the fit counts them: far above the noise by their size, so that no window decides alone
    misfit = independent * float(np.sum(np.mean(2.0 * (np.sqrt(1.0 + missing**2) - 1.0), axis=0)))
    return misfit + trial.numbers * float(np.log(independent * missing.shape[1]))


def free_run_score(trial: Trial, evidence: Evidence, seen: float = SEEN) -> float:
    """Score a trial on the free run's continuation behind the share that the fit has seen.

    Less error than the noise is no merit: a boom at rest shows one reading of the resolver, and
    which model is nearest to that is chance. seen: 0 for trials that were all fitted to the whole.
    """
    errors = free_run_errors(trial.machine, evidence)
    unseen = np.concatenate([error[int(seen * len(error)) :] for error in errors])
    if not np.all(np.isfinite(unseen)):
        return float("inf")
    channels = np.maximum(np.mean(unseen**2, axis=0), 1.0)
    return score(channels, evidence.duration(1.0 - seen) / CORRELATION_TIME, trial.numbers)


def rivals(trials: list[Trial], scores: list[float]) -> list[Trial]:
    """Return the trials that the evidence cannot tell from the best, the best first.

    One that needs more parameters for no less error is no rival.
    """
    best = int(np.argmin(scores))
    size = trials[best].numbers
    close = [
        other
        for other, value in zip(trials, scores, strict=True)
        if other is not trials[best] and value < scores[best] + STRONG and other.numbers <= size
    ]
    return [trials[best], *close]


def speaks(evidence: Evidence) -> float:
    """Return the level in units of the floor from which on a balance speaks.

    SPEAKS, but in a few windows noise alone may make more: chi-square of independent ones.
    """
    windows = evidence.duration(1.0) / FORCE_WINDOW
    return max(float(SPEAKS), float(np.sqrt(chi2.isf(CHANCE, windows) / windows)))


def limits(machine: Machine, evidence: Evidence) -> Array:
    """Return the levels, (b,), from which on each balance of a machine speaks; NaN: never.

    Of a short recording at times more than `speaks` says: windows are not all alike where a
    coarse resolver stays in one step or a piston sticks. How much more the draws of noise tell.
    """
    levels = evidence.drawn_levels(machine)
    factor = np.full(levels.shape[1], speaks(evidence))
    if len(levels) >= FEWEST_DRAWN:
        spread = np.std(np.log(levels), axis=0, ddof=1)
        factor = np.fmax(factor, np.exp(norm.isf(CHANCE) * spread))
    return np.asarray(factor * evidence.floor(machine))


def quiet(left: Array, limit: Array) -> bool:
    """Tell whether no balance speaks: levels, (b,), and from where on they do.

    NaN, a balance that the signals do not allow, is quiet.
    """
    return not np.any(left > limit)


def leaves_quiet(tried: Trial, evidence: Evidence) -> bool:
    """Tell whether no balance speaks with a trial's machine."""
    left = level(evidence.residuals([tried.machine])[0])
    return quiet(left, limits(tried.machine, evidence))


def excess(tried: Trial, evidence: Evidence) -> float:
    """Return the mean square of all signals' free-run errors beyond the noise, in its units.

    Of all together: the stroke alone is uncertain, at rest the resolver stays in one step.
    """
    return mean_square(tried, evidence) - 1.0


def beyond(times: float) -> float:
    """Return the excess of errors so many times as large as the noise."""
    return times**2 - 1.0


def at_noise(tried: Trial, evidence: Evidence) -> bool:
    """Tell whether all signals together are down to the noise."""
    return excess(tried, evidence) <= beyond(AT_NOISE)


def astray(tried: Trial, evidence: Evidence) -> float:
    """Return until when, s, the free run of any recording stays near the machine."""
    near = []
    for experiment, errors in zip(
        evidence.experiments, free_run_errors(tried.machine, evidence), strict=True
    ):
        so_far = np.cumsum(np.mean(errors**2, axis=1)) / np.arange(1, len(errors) + 1)
        near.append(experiment.period * np.count_nonzero(so_far <= HOPELESS**2))
    return float(max(near))

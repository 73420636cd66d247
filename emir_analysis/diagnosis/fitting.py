"""How a trial is fitted, twice: on the balances, then on the free run.

The balances are quick and find their way from anywhere; the free run goes on from there.
"""

import math
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from emir_analysis.diagnosis.effect_shapes import shaped
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.fit import (
    DIFFERENCE_STEP,
    STRAIGHT_STEP,
    Problem,
    covariance,
    fit,
    mean_squares,
)
from emir_analysis.diagnosis.friction_laws import DRY
from emir_analysis.diagnosis.run_errors import (
    FREE_RUN_ACCURACY,
    mean_square,
    settled,
    weighted_errors,
)
from emir_analysis.diagnosis.select import HOPELESS
from emir_analysis.diagnosis.starts import Starts
from emir_analysis.diagnosis.statistics import BOOTSTRAP_BLOCK
from emir_analysis.diagnosis.trial import Trial
from emir_analysis.signals import Array
from emir_plant import integration

SCREENING_ACCURACY = 1e-3  # relative; the free run continues from there
FINE_ACCURACY = 1e-5  # the same of the last fit: flat directions still matter on another recording
BEGINNING_ACCURACY = 3e-2  # the same where only the way to the optimum is wanted
POLISHED = 2.0  # RMS error in units of the noise beyond which flat directions do not matter yet
HOPELESS_ACCURACY = 0.1  # relative
BEHIND = 1.5  # times the error of what a trial has to beat: further off, a fine fit changes nothing
GLIMPSE = 8  # evaluations of a fit that may lead nowhere
GROWING = (0.08, 0.25)  # shares of a recording to which the free run is fitted before the whole
FREE_RUN_STEP = 3e-2  # as fit.DIFFERENCE_STEP, of a free run: sticking makes it rough
SHORTEST_FOLLOWED, FOLLOWED_GROWTH = 5.0, 1.5  # s, and times, of a beginning that grows
BEGINNING_EXPLAINED = 1.15  # RMS error in units of the noise, the most
STOPPING = {*DRY, "backlash"}  # under which the piston stops or seats: coarse steps do not follow


def fit_balances(start: Trial, evidence: Evidence, floor: Array) -> Trial:
    """Fit a trial to the balances of recordings. floor: (5,) what the sensors leave in each.

    Nothing is fitted of a machine without tolerances and effects.
    """
    if not start.x.size:
        return start

    def model(points: Array) -> Array:
        missing = evidence.residuals([start.unknowns.at(x) for x in points])
        return evidence.in_noise(missing, floor)

    low, high = start.unknowns.bounds
    problem = Problem(model, start.x, low, high, start.unknowns.toleranced)
    return start.continued(fit(problem, SCREENING_ACCURACY, robust=True))


def fit_free_run(start: Trial, evidence: Evidence) -> Trial:
    """Fit a trial to the free run of recordings.

    First to their beginning, then further: over a short run parameters that are still off drift
    less, a piston that sticks at another instant does not decide, and it costs less. What shapes
    an effect near standstill, between two windows of the balances, they tell badly: the best of a
    few such shapes is where the fit begins. A trial that cannot follow the beginning is not
    polished. The state at rest at each recording's start (see `Starts`) is fitted along and then
    forgotten: it belongs to the recording, not to the machine.
    """
    x = np.append(shaped(start, evidence).x, np.zeros(2 * len(evidence.experiments)))
    begins = [x]
    for share in GROWING:
        begun = fit(free_run_problem(start, evidence, begins[-1], share), BEGINNING_ACCURACY)
        begins.append(begun.x)
    accuracy = FREE_RUN_ACCURACY if begun.misfit < HOPELESS else HOPELESS_ACCURACY
    # what acts late is not told by the beginning, and may have been led astray there
    whole = free_run_problem(start, evidence, x)
    best = begins[int(np.argmin(mean_squares(whole.model(np.array(begins)))))]
    return start.continued(fit(replace(whole, start=best), accuracy))


def refine_free_run(known: Trial, evidence: Evidence, rival: Trial | None = None) -> Trial:
    """Fit a trial that was fitted to a part of the recordings' free run to the whole.

    In the end with slopes over short steps: near the optimum those of the way there point a little
    beside it. A hopeless trial is not polished, nor one far behind its rival.
    """
    problem = _whole_problem(known, evidence)
    near = fit(problem, FREE_RUN_ACCURACY)
    behind = math.inf if rival is None else BEHIND * math.sqrt(mean_square(rival, evidence))
    if near.misfit > min(HOPELESS, behind):
        return known.continued(near)
    fine = replace(problem, start=near.x, step=DIFFERENCE_STEP)
    if STOPPING.intersection(known.effects):
        fine = replace(fine, coarse=None)
    accuracy = FINE_ACCURACY if near.misfit <= POLISHED else FREE_RUN_ACCURACY
    return known.continued(fit(fine, accuracy))


def with_spread(known: Trial, evidence: Evidence) -> Trial:
    """Return a trial fitted to the whole with the covariance that short steps and blocks tell.

    Over a shorter time than an integration step a load that sets in at once does not change.
    """
    problem = _whole_problem(known, evidence)
    k = known.x.size
    steps = np.full(problem.start.size, STRAIGHT_STEP)
    for i, unknown in enumerate(known.unknowns.members):
        if unknown.shapes and unknown.unit == "s":
            steps[i] = unknown.at(unknown.value(known.x[i]) + integration.STEP) - known.x[i]
    return replace(known, covariance=covariance(problem, steps, _blocks(evidence))[:k, :k])


def _blocks(evidence: Evidence) -> NDArray[np.int_]:
    """Return which block each of the free run's weighted errors belongs to, (n,)."""
    found: list[NDArray[np.int_]] = []
    for e in evidence.experiments:
        first = found[-1][-1] + 1 if found else 0
        block = first + (e.time - e.time[0]) // BOOTSTRAP_BLOCK
        found.append(np.repeat(block.astype(np.int_), np.count_nonzero(evidence.shown)))
    return np.concatenate(found)


def following(known: Trial, evidence: Evidence) -> Trial:
    """Fit a trial to the longest beginning of the free run that it explains; as it was, if none."""
    end = max(float(e.time[-1]) for e in evidence.experiments)
    time = SHORTEST_FOLLOWED
    while time < end:
        begin = evidence.until(time)
        longer = refine_free_run(known, begin)
        if mean_square(longer, begin) > BEGINNING_EXPLAINED**2:
            break
        known, time = longer, FOLLOWED_GROWTH * time
    return known


def glimpsed(known: Trial, evidence: Evidence) -> Trial:
    """Fit a trial to the free run of the whole for so long as tells whether that leads anywhere."""
    problem = _whole_problem(known, evidence)
    return known.continued(fit(problem, FREE_RUN_ACCURACY, evaluations=GLIMPSE))


def _whole_problem(known: Trial, evidence: Evidence) -> Problem:
    """Return the free run of whole recordings as a problem, begun where a trial is at rest.

    That is where its errors are told from. Begun elsewhere inside a step of the resolver, a fit may
    stay there where something switches, and make up for it by parameters.
    """
    rest = [settled(known.machine, e, evidence) for e in evidence.experiments]
    return free_run_problem(known, evidence, np.concatenate([known.x, *rest]))


def with_fewer_terms(full: Trial, effect: str, evidence: Evidence) -> list[Trial]:
    """Return a trial with fewer and fewer terms of a series, each fitted to the free run."""
    found, fewer = [], full.with_a_term_less(effect)
    while fewer is not None:
        found.append(refine_free_run(fewer, evidence, full))
        fewer = found[-1].with_a_term_less(effect)
    return found


def free_run_problem(start: Trial, evidence: Evidence, x: Array, share: float = 1.0) -> Problem:
    """Return the free run of the first part of recordings as a problem.

    x: start, (k + 2 r,), the trial's and two numbers for the state at rest in each recording.
    """
    own, states = start.x.size, x.size - start.x.size
    experiments = [e.head(share) for e in evidence.experiments]
    starts = [Starts(e, evidence) for e in experiments]

    def model(points: Array, *, coarse: bool = False) -> Array:
        machines = [start.unknowns.at(x[:own]) for x in points]
        parts = []
        for k, (experiment, begin) in enumerate(zip(experiments, starts, strict=True)):
            at = begin.at(points[:, own + 2 * k : own + 2 * k + 2], machines)
            parts.append(weighted_errors(machines, experiment, evidence, at, coarse=coarse))
        return np.concatenate(parts, axis=1)

    low, high = start.unknowns.bounds
    return Problem(
        model,
        x,
        np.append(low, -np.ones(states)),
        np.append(high, np.ones(states)),
        np.append(start.unknowns.toleranced, np.zeros(states, dtype=bool)),
        partial(model, coarse=True),
        FREE_RUN_STEP,
    )

"""Machines that stick and slip: which friction it is, told by a beginning that grows.

Over a long run each instant of sticking shifts the next, and the error is a rough function of all
parameters: a fit ends close to where it began. Over a few seconds it is smooth with a handful of
minima: there the fit is begun from many shapes of the friction, and the best is led along. How
friction falls behind the break-away and rises with speed lies between two windows of the balances,
so the fullest law is fitted, and what is not needed is left out.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from emir_analysis.diagnosis.balances import FORCE
from emir_analysis.diagnosis.effect_shapes import shapes
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.fit import Problem, Solution, descended, fit
from emir_analysis.diagnosis.fitting import free_run_problem
from emir_analysis.diagnosis.friction_laws import (
    STRIBECK,
    VISCOUS,
    is_along_the_way,
    is_gradual,
    other_laws,
    simpler,
    viscous_is_heard,
)
from emir_analysis.diagnosis.friction_starts import friction_starts
from emir_analysis.diagnosis.run_errors import FREE_RUN_ACCURACY
from emir_analysis.diagnosis.select import AT_NOISE, CORRELATION_TIME, LEFT, STRONG, score
from emir_analysis.diagnosis.trial import Trial
from emir_analysis.signals import Array
from emir_plant.sheet import Sheet

FIRST = 3.0  # s, of the first beginning
STARTS = 12  # from which the first beginning is fitted, and as many again where none comes to noise
NEARLY = 1.01  # times what the best fit leaves: with half of them there, others end there, too
SMOOTH = 3  # the same where friction comes along the way: they lead to one minimum
LED = (6, 3)  # of the best, along the next beginnings
SAME_MINIMUM = 1.001  # ratio of the errors of two fits up to which they are the same minimum
GROWTH = 1.5  # of a beginning from one to the next while several fits are led
GROWTHS = (3.0, 1.5, 1.2)  # then: the most over which the free run follows the machine
NEAR_END = 1.1  # times a beginning
FOLLOWS = 1.02  # times the error so far: the most over a longer beginning that it follows
DRAWN = 1500.0  # s, simulated of machines drawn from what a beginning leaves open ...
DRAWN_OF_EACH = 500.0  # s, the same of each while several are led, or where the law is off
DRAWS = 3  # times that they are drawn, until a fit from the best leaves no more than ...
AS_BEFORE = 1.01  # times what was left before
EARLY = 20.0  # s, a beginning whose fit knows least of what it leaves open ...
DRAWS_EARLY = 6  # and which is drawn on more often, each time in less time
WIDER = 2.0  # times, every second time: over rough errors slopes promise too little spread
DECIDED = 10.0  # s, of the beginning that chooses among laws
OFF = 1.5  # times the noise over that, from which on more is missing: right laws leave 0.98 at most
CLEARLY = 1.02  # times: what a law has to leave less than one that is not at the noise
WORSE = 1.1  # times what a rival leaves over a beginning: none that leaves more can replace it
STICKING_STEP = 3e-3  # as fit.DIFFERENCE_STEP: over longer ones the piston sticks at other instants
ROUGH_ACCURACY = 1e-2  # to go on from, or where only whether half of the rest is gone is asked

Method = Callable[[Problem, float], Solution]
Limit = Callable[[Evidence], float]


def _anything(_: Evidence) -> float:
    """Return the most that may be left over a beginning where nothing is given up."""
    return math.inf


def begun(start: Trial, evidence: Evidence, floor: Array, most: float = OFF) -> Trial | None:
    """Fit a trial to the free run of a beginning that grows to DECIDED.

    Over the first beginning it is fitted from those shapes of the friction near standstill whose
    free run is best there. The best fits are led on, fewer each time: it takes some sticks to
    tell two minima apart. Where that leaves more than LEFT, it is begun with friction that comes
    gradually, too, if no more than OFF is left (fitted by tanh, that has led to another minimum),
    and with friction that comes along the way. None where more than `most` is left: that is no
    matter of how friction begins. floor: (5,) what the sensors leave in each balance.
    """
    first = _begun(start, evidence, floor)
    law, found = start, first.fitted
    for other in other_laws(start):
        if found.misfit > LEFT and not (found.misfit > OFF and is_gradual(other)):
            fitted = _begun(other, evidence, floor, first.left).fitted
            law, found = min((law, found), (other, fitted), key=lambda each: each[1].misfit)
    return law.continued(found) if found.misfit <= most else None


class Begun(NamedTuple):
    """A law fitted to a beginning, and what it left over each shorter one before.

    A law that was given up leaves an infinite misfit.
    """

    fitted: Solution
    left: list[float]


def _begun(start: Trial, evidence: Evidence, floor: Array, rival: Sequence[float] = ()) -> Begun:
    """Return the fit of one law to the free run of a beginning that grows to DECIDED.

    It is given up over a beginning where it leaves more than OFF, or, of what a rival law leaves
    over that one, not clearly less.
    """
    fits, time = _over_the_first(start, evidence, floor), FIRST
    left = [fits[0].misfit]
    for count in LED:
        if _given_up(left, rival):
            return Begun(replace(fits[0], misfit=math.inf), left)
        longer = GROWTH * time
        points = [_begin(start, evidence, each, time, longer) for each in fits[:count]]
        part = evidence.until(longer)
        fits = _distinct([_fitted(start, part, x, ROUGH_ACCURACY) for x in points])
        time = longer
        left.append(fits[0].misfit)
    return Begun(_led(start, evidence, fits[0].x, time, DECIDED, fit), left)


def _over_the_first(start: Trial, evidence: Evidence, floor: Array) -> list[Solution]:
    """Return fits of one law to the first beginning, the best first.

    From as many starts again where none comes to the noise, unless half of them end in the same
    minimum.
    """
    if evidence.told[FORCE]:
        starts = friction_starts(start, evidence, floor, FIRST)
    else:
        starts = shapes(start, STRIBECK, evidence.until(FIRST))
    first = evidence.until(FIRST)
    points = [_at_rest(each, evidence) for each in starts]
    fits: list[Solution] = []
    together = SMOOTH if is_along_the_way(start) else STARTS
    for k in (0, together):
        fits += [_fitted(start, first, x, ROUGH_ACCURACY) for x in points[k : k + together]]
        left = np.array([each.misfit for each in fits])
        least = np.min(left)
        half_there = np.median(left) <= NEARLY * least
        if least <= 1.0 or least > OFF or half_there:
            break
    return _distinct(fits)


def _given_up(left: list[float], rival: Sequence[float]) -> bool:
    """Tell whether a law is, by what it leaves over beginnings that grow, and a rival."""
    other = rival[len(left) - 1] if len(left) <= len(rival) else 0.0
    most = min(OFF, other / CLEARLY) if other > AT_NOISE else OFF
    return left[-1] > most


def _distinct(fits: list[Solution]) -> list[Solution]:
    """Return the solutions, the best first, each minimum once."""
    found: list[Solution] = []
    for solution in sorted(fits, key=lambda each: each.misfit):
        if not found or solution.misfit > SAME_MINIMUM * found[-1].misfit:
            found.append(solution)
    return found


def with_less_friction(known: Trial, evidence: Evidence, sheet: Sheet, floor: Array) -> list[Trial]:
    """Return trials with as much friction as a beginning up to DECIDED needs, and more behind.

    More has to take half of the rest away: a law that is a little off is mimicked by another.
    And it has to be more than the force balance could tell from noise. What is left out is held
    against all friction together: without the part before, a fit may not have found its way.
    floor: as for `begun`.
    """
    begin = evidence.until(DECIDED)
    _, misfit = _further(known, begin)
    limit = _score(misfit, known, begin) + STRONG
    unheard = not viscous_is_heard(known, evidence, floor)
    laws, fewer = [known], simpler(known, sheet)
    while fewer:
        fitted, left = _further(fewer.pop(0), begin)
        no_worse = _score(left, fitted, begin) < limit
        no_worse |= unheard and VISCOUS in laws[0].effects and VISCOUS not in fitted.effects
        if no_worse or 0.5 * (left**2 - 1.0) < misfit**2 - 1.0:
            laws, fewer = [fitted, *laws], simpler(fitted, sheet)
    return laws


def _score(misfit: float, fitted: Trial, evidence: Evidence) -> float:
    """Return the criterion of `select` for a fit whose state at rest was fitted along."""
    channels = np.full(np.count_nonzero(evidence.shown), misfit**2)
    return score(channels, evidence.duration(1.0) / CORRELATION_TIME, fitted.x.size)


class Grown(NamedTuple):
    """A trial fitted to a beginning that grew, and the RMS error that was left, in the noise.

    With the state at rest that was fitted along: where it sticks, a sixtieth of half a resolver
    step may part two runs.
    """

    trial: Trial
    left: float


def grown(known: Trial, evidence: Evidence, rival: Trial | None = None) -> Grown:
    """Fit a trial that was fitted to the first DECIDED to a beginning that grows to the whole.

    It is given up where it falls behind a rival that was fitted to more than that beginning.
    """
    if rival is None:
        return _grown(known, evidence, _anything)
    return _grown(known, evidence, lambda part: WORSE * _misfit(rival, part))


def grown_at_noise(known: Trial, evidence: Evidence) -> Grown | None:
    """Return the same if it is at the noise; given up where it clearly no longer is."""
    found = _grown(known, evidence, lambda _: OFF)
    return found if found.left <= AT_NOISE else None


def _grown(known: Trial, evidence: Evidence, limit: Limit) -> Grown:
    end = max(float(e.time[-1]) for e in evidence.experiments)
    x = _at_rest(known, evidence)
    fitted = _led(known, evidence, x, DECIDED, end, descended, limit)
    return Grown(known.continued(fitted), fitted.misfit)


def follows_the_beginning(known: Trial, evidence: Evidence) -> bool:
    """Tell whether a trial's friction is near enough for the first DECIDED to be explained."""
    _, misfit = _further(known, evidence.until(DECIDED))
    return misfit <= LEFT


def _further(known: Trial, evidence: Evidence) -> tuple[Trial, float]:
    """Fit a trial that is near the optimum; return it and its RMS error in units of the noise."""
    fitted = _fitted(known, evidence, _at_rest(known, evidence), ROUGH_ACCURACY)
    return known.continued(fitted), fitted.misfit


def _at_rest(known: Trial, evidence: Evidence) -> Array:
    """Return a trial's x and the states at rest, in the middle of what the sensors leave open."""
    return np.append(known.x, np.zeros(2 * len(evidence.experiments)))


def _led(  # noqa: PLR0913, PLR0917 (of one growth everything is needed)
    known: Trial,
    evidence: Evidence,
    x: Array,
    time: float,
    end: float,
    method: Method,
    limit: Limit = _anything,
) -> Solution:
    """Fit to beginnings that grow from a time to another, s.

    Where the machine sticks at other instants than the free run, a fit would not find back to
    them: of machines drawn from what the beginning before leaves open one goes on whose instants
    are the machine's (a particle filter's step, Gordon et al. 1993). Where even that leaves more
    than before, the law is off, not one stick, and less is spent on it from there on. Friction that
    comes along the way lets a fit find back by itself. Given up where it leaves more over a
    beginning than the limit allows.
    """
    smooth = is_along_the_way(known)
    fitted, holds = _fitted(known, evidence.until(time), x, FREE_RUN_ACCURACY, method), True
    while time < end:
        holds = holds and fitted.misfit <= AT_NOISE
        growths = GROWTHS if holds else GROWTHS[:-1]
        longer, before = _followed(known, evidence, fitted, time, end, growths), fitted.misfit
        followed = longer > time
        if not followed:
            longer = _longer((GROWTH if smooth else growths[-1]) * time, end)
        part = evidence.until(longer)
        if followed or smooth:
            accuracy = FREE_RUN_ACCURACY if longer == end else ROUGH_ACCURACY
            fitted = _fitted(known, part, fitted.x, accuracy, method, fitted.curvature)
        else:
            draws = DRAWS_EARLY if longer <= EARLY else DRAWS
            fitted = _found_again(known, part, fitted, method, draws if holds else 1)
            holds = holds and fitted.misfit <= AS_BEFORE * before
        if not followed and fitted.misfit > limit(part):
            break
        time = longer
    return fitted


def _followed(  # noqa: PLR0913, PLR0917 (as _led)
    known: Trial,
    evidence: Evidence,
    fitted: Solution,
    time: float,
    end: float,
    growths: tuple[float, ...],
) -> float:
    """Return until when, s, the free run follows the machine as it does up to a time, s."""
    limit = FOLLOWS * _errors(known, evidence.until(time), fitted.x[None])[0]
    for growth in growths:
        longer = _longer(growth * time, end)
        if _errors(known, evidence.until(longer), fitted.x[None])[0] < limit:
            return longer
    return time


def _longer(time: float, end: float) -> float:
    """Return a time, s, or the end, where that is near: it is not worth a fit of its own."""
    return time if NEAR_END * time < end else end


def _found_again(
    known: Trial, evidence: Evidence, fitted: Solution, method: Method, draws: int
) -> Solution:
    """Return the best fit from the best of some draws of machines, one of which may be enough."""
    found: list[Solution] = []
    for draw in range(draws):
        x = _drawn(known, evidence, fitted, DRAWN if draws > 1 else DRAWN_OF_EACH, draw)
        if found and np.array_equal(x, fitted.x):
            continue  # none of them is better than where it was
        found.append(_fitted(known, evidence, x, FREE_RUN_ACCURACY, method, fitted.curvature))
        if found[-1].misfit <= AS_BEFORE * fitted.misfit:
            break
    return min(found, key=lambda each: each.misfit)


def _begin(known: Trial, evidence: Evidence, fitted: Solution, time: float, longer: float) -> Array:
    """Return from where a fit to a longer beginning, s, begins, (k,)."""
    if is_along_the_way(known):
        return fitted.x
    if _followed(known, evidence, fitted, time, longer, (GROWTH,)) > time:
        return fitted.x
    return _drawn(known, evidence.until(longer), fitted, DRAWN_OF_EACH)


def _drawn(
    known: Trial, evidence: Evidence, fitted: Solution, seconds: float, draw: int = 0
) -> Array:
    """Return the best of machines drawn from what a fit leaves open, (k,), or the fitted one.

    seconds: simulated in all. draw: how often others were drawn before.
    """
    count = int(seconds / evidence.duration(1.0))
    others = fitted.drawn((draw + 1) * count)[draw * count :]
    if draw % 2:
        others = fitted.x + WIDER * (others - fitted.x)
    points = np.vstack([fitted.x, others])
    return np.asarray(points[int(np.argmin(_errors(known, evidence, points)))])


def _misfit(known: Trial, evidence: Evidence) -> float:
    return float(_errors(known, evidence, _at_rest(known, evidence)[None])[0])


def _errors(known: Trial, evidence: Evidence, points: Array) -> Array:
    """Return the RMS errors, (m,), of free runs in units of the noise; inf for one that fails."""
    problem = free_run_problem(known, evidence, points[0])
    left = problem.model(np.clip(points, problem.low, problem.high))
    return np.asarray(np.nan_to_num(np.sqrt(np.mean(np.square(left), axis=1)), nan=np.inf))


def _fitted(  # noqa: PLR0913, PLR0917 (as _led)
    known: Trial,
    evidence: Evidence,
    x: Array,
    accuracy: float,
    method: Method = fit,
    curvature: Array | None = None,
) -> Solution:
    problem = free_run_problem(known, evidence, x)
    problem = replace(problem, coarse=None, step=STICKING_STEP, curvature=curvature)
    return method(problem, accuracy)

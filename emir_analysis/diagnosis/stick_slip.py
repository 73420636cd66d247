"""Machines that stick and slip: a law of friction led to the whole by a beginning that grows.

Over a long run each instant of sticking shifts the next, and the error is a rough function of all
parameters: a fit ends close to where it began.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.fit import Problem, Solution, descended, fit
from emir_analysis.diagnosis.fitting import free_run_problem, refine_free_run
from emir_analysis.diagnosis.friction_laws import is_along_the_way, is_elastic, is_gradual
from emir_analysis.diagnosis.run_errors import FREE_RUN_ACCURACY, weight_of_noise
from emir_analysis.diagnosis.select import AT_NOISE, LEFT
from emir_analysis.diagnosis.trial import Trial
from emir_analysis.signals import Array

GROWTH = 1.5  # of a beginning from one to the next while several fits are led
GROWTHS = (3.0, 1.5, 1.2)  # then: the most over which the free run follows the machine
NEAR_END = 1.1  # times a beginning
FOLLOWS = 1.02  # times the error so far: the most over a longer beginning that it follows
DRAWN = 1500.0  # s, simulated of machines drawn from what a beginning leaves open ...
DRAWN_OF_EACH = 500.0  # s, the same of each while several are led, or where the law is off
DRAWS = 3  # times that they are drawn, until a fit from the best leaves no more than ...
AS_BEFORE = 1.01  # times what was left before
ALIKE = 1.003  # times, of what two fits leave that end in one minimum
EARLY = 20.0  # s, a beginning whose fit knows least of what it leaves open ...
DRAWS_EARLY = 6  # and which is drawn on more often, each time in less time
WIDER = 2.0  # times, every second time: over rough errors slopes promise too little spread
DECIDED = 10.0  # s, of the beginning that chooses among laws
OFF = 1.5  # times the noise over that, from which on more is missing: right laws leave 1.05 at most
CLEARLY = 1.02  # times: what a law has to leave less than one that is not at the noise
WORSE = 1.1  # times what a rival leaves over a beginning: none that leaves more can replace it
STICKING_STEP = 3e-3  # as fit.DIFFERENCE_STEP: over longer ones the piston sticks at other instants
ROUGH_ACCURACY = 1e-2  # to go on from, or where only whether half of the rest is gone is asked

Method = Callable[[Problem, float], Solution]
Limit = Callable[[Evidence], float]
Law = tuple[tuple[str, ...], bool, bool, bool]  # effects, gradual, along the way, elastic


def _anything(_: Evidence) -> float:
    """Return the most that may be left over a beginning where nothing is given up."""
    return math.inf


class Led(NamedTuple):
    """A fit to a beginning, s, that grew, and the one before, to a shorter beginning, s."""

    fitted: Solution
    time: float
    before: Solution
    time_before: float


class Grown(NamedTuple):
    """A trial fitted to a beginning that grew, and the RMS error that was left, in the noise.

    With the state at rest that was fitted along: where it sticks, a sixtieth of half a resolver
    step may part two runs. time: s, up to which it is fitted. given_up: that is not the whole.
    before, time_before: as it was fitted to the beginning before, s.
    """

    trial: Trial
    left: float
    time: float
    given_up: bool
    before: Trial
    time_before: float

    @property
    def left_of_whole(self) -> float:
        """Return the RMS error over the whole, infinite where it was given up."""
        return math.inf if self.given_up else self.left


class Growths:
    """Trials fitted to the first DECIDED, and led to the whole by a beginning that grows.

    A law that over the first DECIDED leaves as much as when it was led before would end there
    again: it is led once.
    """

    def __init__(self, evidence: Evidence) -> None:
        self._evidence = evidence
        self._end = max(float(e.time[-1]) for e in evidence.experiments)
        self._before: dict[Law, tuple[Solution, Led, Grown]] = {}  # over the first, and then

    def grown(self, known: Trial, rival: Trial | None = None) -> Grown:
        """Return a trial fitted to the whole.

        It is given up where it falls behind a rival that was fitted to more than that beginning.
        """
        if rival is None:
            return self._grown(known, _anything)
        return self._grown(known, lambda part: WORSE * _misfit(rival, part))

    def at_noise(self, known: Trial) -> Grown | None:
        """Return the same if it is at the noise; given up where it clearly no longer is."""
        found = self.followed(known)
        return found if found.left_of_whole <= AT_NOISE else None

    def followed(self, known: Trial) -> Grown:
        """Return a trial fitted to as much as it follows: given up where it is off the noise."""
        return self._grown(known, lambda _: AT_NOISE, again=False)

    def _grown(self, known: Trial, limit: Limit, *, again: bool = True) -> Grown:
        """Return a trial led until it leaves more than a limit.

        again: also where it was given up when it was led before, from there on.
        """
        x, part = from_rest(known, self._evidence), self._evidence.until(DECIDED)
        first = fitted_to(known, part, x, FREE_RUN_ACCURACY, descended)
        led = Led(first, DECIDED, first, DECIDED)
        law = known.effects, is_gradual(known), is_along_the_way(known), is_elastic(known)
        if law in self._before:
            before, ended, grown = self._before[law]
            if first.misfit * CLEARLY > before.misfit:
                if not (grown.given_up and again):
                    return grown
                first, led = before, ended
        if led.fitted.misfit > limit(self._evidence.until(led.time)):
            return self._as_grown(known, led)
        led = led_on(known, self._evidence, led.fitted, led.time, self._end, descended, limit)
        grown = self._as_grown(known, led)
        self._before[law] = first, led, grown
        return grown

    def _as_grown(self, known: Trial, led: Led) -> Grown:
        fitted, before = known.continued(led.fitted), known.continued(led.before)
        given_up = led.time < self._end
        if not given_up:
            fitted = self._from_the_middle(fitted, led.fitted.misfit)
        return Grown(fitted, led.fitted.misfit, led.time, given_up, before, led.time_before)

    def _from_the_middle(self, fitted: Trial, left: float) -> Trial:
        """Return a trial that leaves little from the middle of what the state at rest may be, too.

        From there it may stick at other instants than from the state that was fitted along, with
        which it left so much: then it is fitted once more, if that is better.
        """
        from_there = _misfit(fitted, self._evidence)
        if from_there <= FOLLOWS * left:
            return fitted
        again = refine_free_run(fitted, self._evidence)
        return again if _misfit(again, self._evidence) < from_there else fitted


def from_rest(known: Trial, evidence: Evidence) -> Array:
    """Return a trial's x and the states at rest, in the middle of what the sensors leave open."""
    return np.append(known.x, np.zeros(2 * len(evidence.experiments)))


def led(known: Trial, evidence: Evidence, x: Array, time: float, end: float) -> Solution:
    """Fit to beginnings that grow from a time to another, s, from x, (k + 2 r,)."""
    first = fitted_to(known, evidence.until(time), x, FREE_RUN_ACCURACY)
    return led_on(known, evidence, first, time, end, fit).fitted


def led_on(  # noqa: PLR0913, PLR0917 (of one growth everything is needed)
    known: Trial,
    evidence: Evidence,
    fitted: Solution,
    time: float,
    end: float,
    method: Method,
    limit: Limit = _anything,
) -> Led:
    """Fit to beginnings that grow from a fit to one, s, to another, s.

    Where the machine sticks at other instants than the free run, a fit mostly finds back to them.
    Where it does not, of machines drawn from what the beginning before leaves open one goes on
    whose instants are the machine's (a particle filter's step, Gordon et al. 1993). Where even that
    leaves more than before, the law is off, not one stick, and less is spent on it from there on.
    Given up where it leaves more over a beginning than the limit allows.
    """
    smooth, holds = is_along_the_way(known), True
    led = Led(fitted, time, fitted, time)
    while time < end:
        holds = holds and fitted.misfit <= AT_NOISE
        growths = GROWTHS if holds else GROWTHS[:-1]
        longer, before = followed(known, fitted, evidence, time, end, growths), fitted.misfit
        follows = longer > time
        if not follows:
            longer = _longer((GROWTH if smooth else growths[-1]) * time, end)
        part = evidence.until(longer)
        if follows or smooth:
            accuracy = FREE_RUN_ACCURACY if longer == end else ROUGH_ACCURACY
            fitted = fitted_to(known, part, fitted.x, accuracy, method, fitted.curvature)
        else:
            accuracy = FREE_RUN_ACCURACY if holds or longer == end else ROUGH_ACCURACY
            draws = (DRAWS_EARLY if longer <= EARLY else DRAWS) if holds else 1
            fitted = _found_again(known, part, fitted, method, accuracy, draws)
            holds = holds and fitted.misfit <= AS_BEFORE * before
        led = Led(fitted, longer, led.fitted, time)
        time = longer
        if not follows and fitted.misfit > limit(part):
            break
    return led


def followed(  # noqa: PLR0913, PLR0917 (as led_on)
    known: Trial,
    fitted: Solution,
    evidence: Evidence,
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


def _found_again(  # noqa: PLR0913, PLR0917 (as led_on)
    known: Trial,
    evidence: Evidence,
    fitted: Solution,
    method: Method,
    accuracy: float,
    draws: int,
) -> Solution:
    """Return the best fit from where it was, or from the best of some draws of machines.

    One of them may be enough. Where two leave much and as much, the law is off, not the draw.
    """
    found: list[Solution] = []
    for draw in range(-1, draws):
        x = fitted.x
        if draw >= 0:
            x = drawn(known, evidence, fitted, DRAWN if draws > 1 else DRAWN_OF_EACH, draw)
            if np.array_equal(x, fitted.x):
                continue  # none of them is better than where it was
        found.append(fitted_to(known, evidence, x, accuracy, method, fitted.curvature))
        left = sorted(each.misfit for each in found)
        if left[0] <= AS_BEFORE * fitted.misfit:
            break
        if len(found) > 1 and left[0] > LEFT and left[1] <= ALIKE * left[0]:
            break
    return min(found, key=lambda each: each.misfit)


def drawn(
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
    return float(_errors(known, evidence, from_rest(known, evidence)[None])[0])


def _errors(known: Trial, evidence: Evidence, points: Array) -> Array:
    """Return the RMS errors, (m,), of free runs in units of the noise; inf for one that fails."""
    problem = free_run_problem(known, evidence, points[0])
    left = problem.model(np.clip(points, problem.low, problem.high)) / weight_of_noise(evidence)
    return np.asarray(np.nan_to_num(np.sqrt(np.mean(np.square(left), axis=1)), nan=np.inf))


def fitted_to(  # noqa: PLR0913, PLR0917 (as led_on)
    known: Trial,
    evidence: Evidence,
    x: Array,
    accuracy: float,
    method: Method = fit,
    curvature: Array | None = None,
) -> Solution:
    """Fit a trial and states at rest from x, (k + 2 r,), to a beginning; misfit in the noise."""
    problem = free_run_problem(known, evidence, x)
    problem = replace(problem, coarse=None, step=STICKING_STEP, curvature=curvature)
    solution = method(problem, accuracy)
    return replace(solution, misfit=solution.misfit / weight_of_noise(evidence))

"""Which law of friction a machine has, by the first ten seconds that it sticks and slips.

Over a few seconds the error is smooth with a handful of minima: there the fit is begun from many
shapes of the friction, and the best is led along. How friction falls behind the break-away and
rises with speed lies between two windows of the balances, so the fullest law is fitted, and what is
not needed is left out.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from emir_analysis.diagnosis.balances import FORCE
from emir_analysis.diagnosis.effect_shapes import shapes
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.fit import Solution
from emir_analysis.diagnosis.friction_laws import (
    STRIBECK,
    VISCOUS,
    along_the_way,
    gradual,
    is_along_the_way,
    is_gradual,
    simpler,
    uneven,
    viscous_is_heard,
    with_sharper_friction,
)
from emir_analysis.diagnosis.friction_starts import friction_starts
from emir_analysis.diagnosis.run_errors import readings
from emir_analysis.diagnosis.select import AT_NOISE, CORRELATION_TIME, STRONG, score
from emir_analysis.diagnosis.side_by_side import side_by_side
from emir_analysis.diagnosis.stick_slip import (
    CLEARLY,
    DECIDED,
    DRAWN_OF_EACH,
    GROWTH,
    OFF,
    ROUGH_ACCURACY,
    drawn,
    fitted_to,
    followed,
    from_rest,
    led,
)
from emir_analysis.diagnosis.trial import Trial
from emir_analysis.signals import Array
from emir_plant.sheet import Sheet

FIRST = 3.0  # s, of the first beginning
STARTS = 12  # from which the first beginning is fitted, and as many again where none comes to noise
NEARLY = 1.01  # times what the best fit leaves: with half of them there, others end there, too
SMOOTH = 3  # the same where friction comes along the way: they lead to one minimum
LED = (8, 4)  # of the best, along the next beginnings
SAME_MINIMUM = 1.001  # ratio of the errors of two fits up to which they are the same minimum
LEFT_EARLY = 1.08  # times the noise: as LEFT, over a beginning, where chance makes more
SHARPER = 0.5  # times tanh's smoothing speed, where friction that comes gradually begins


def begun(start: Trial, evidence: Evidence, floor: Array, most: float = OFF) -> Trial | None:
    """Fit a trial to the free run of a beginning that grows to DECIDED.

    Over the first beginning it is fitted from those shapes of the friction near standstill whose
    free run is best there, and from each minimum with friction that comes gradually, too. The best
    fits are led on, fewer each time: it takes some sticks to tell two minima apart. Where that
    leaves more than LEFT_EARLY, it is begun with friction that comes along the way, too, and with
    one that differs with the direction. None where more than `most` is left: that is no matter of
    how friction begins. floor: (5,) what the sensors leave in each balance.
    """
    first = best = _begun(start, evidence, floor)
    for other in (along_the_way(start), uneven(start)):
        if best.law.misfit > LEFT_EARLY:
            found = _begun(other, evidence, floor, first.left)
            best = min(best, found, key=lambda each: each.law.misfit)
    return best.law.trial if best.law.misfit <= most else None


class Law(NamedTuple):
    """A law of friction and its fit to a beginning."""

    start: Trial
    fitted: Solution

    @property
    def misfit(self) -> float:
        """Return the RMS error in units of the noise."""
        return self.fitted.misfit

    @property
    def trial(self) -> Trial:
        """Return it as a trial."""
        return self.start.continued(self.fitted)


def _misfit(law: Law) -> float:
    return law.misfit


class Begun(NamedTuple):
    """A law fitted to a beginning, and what the best left over each shorter one before.

    A law that was given up leaves an infinite misfit.
    """

    law: Law
    left: list[float]


def _begun(start: Trial, evidence: Evidence, floor: Array, rival: Sequence[float] = ()) -> Begun:
    """Return the fit of a law to the free run of a beginning that grows to DECIDED.

    It is given up over a beginning where it leaves more than OFF, or, of what a rival law leaves
    over that one, not clearly less.
    """
    laws, time = _over_the_first(start, evidence, floor), FIRST
    left = [laws[0].misfit]
    for count in LED:
        if _given_up(left, rival):
            return Begun(Law(start, replace(laws[0].fitted, misfit=math.inf)), left)
        longer = GROWTH * time
        on = partial(_led_on, evidence=evidence, time=time, longer=longer)
        laws, time = _distinct(side_by_side(on, laws[:count])), longer
        left.append(laws[0].misfit)

    def end(law: Law) -> Law:
        return law._replace(fitted=led(law.start, evidence, law.fitted.x, time, DECIDED))

    ends = side_by_side(end, _both(laws, start, evidence.until(time)))
    return Begun(_as_good(ends, evidence.until(DECIDED))[0], left)


def _both(laws: Sequence[Law], start: Trial, evidence: Evidence) -> list[Law]:
    """Return the best laws as `_as_good`; one by tanh is begun from one that comes gradually, too.

    Rounding may have lost it on the way.
    """
    best = _as_good(laws, evidence)
    if is_gradual(start) or not is_gradual(best[0].start):
        return best
    blunter = with_sharper_friction(start.at(best[0].trial.x), 1.0 / SHARPER)
    by_tanh = _refitted(Law(start, best[0].fitted), evidence, from_rest(blunter, evidence))
    return _as_good([*best, by_tanh], evidence)


def _as_good(laws: Sequence[Law], evidence: Evidence) -> list[Law]:
    """Return the best friction by tanh and gradually, one alone where it leaves clearly less.

    By tanh comes first, as most models have it.
    """
    best = {is_gradual(law.start): law for law in sorted(laws, key=_misfit, reverse=True)}
    most = min(law.misfit**2 for law in laws) + STRONG / readings(evidence)
    return [best[late] for late in sorted(best) if best[late].misfit ** 2 <= most]


def gradually(known: Trial, evidence: Evidence) -> Trial:
    """Return friction that came by tanh as friction that comes gradually, fitted to DECIDED.

    It has another minimum, to which the first beginning leads and a longer one does not.
    """
    law, time = _gradually(known, gradual(known), evidence.until(FIRST)), FIRST
    while time < DECIDED:
        time = min(GROWTH * time, DECIDED)
        law = _refitted(law, evidence.until(time), law.fitted.x)
    return law.trial


def _gradually(by_tanh: Trial, start: Trial, first: Evidence) -> Law:
    """Return friction that came by tanh, as a law that comes gradually, fitted to a beginning."""
    sharper = with_sharper_friction(gradual(by_tanh), SHARPER)
    return Law(start, fitted_to(start, first, from_rest(sharper, first), ROUGH_ACCURACY))


def _led_on(law: Law, evidence: Evidence, time: float, longer: float) -> Law:
    """Return a law that was fitted until a time, s, fitted to a longer beginning, s."""
    begin = _begin(law.start, law.fitted, evidence, time, longer)
    return _refitted(law, evidence.until(longer), begin)


def _refitted(law: Law, evidence: Evidence, x: Array) -> Law:
    """Return a law fitted to a beginning from x, (k,)."""
    return law._replace(fitted=fitted_to(law.start, evidence, x, ROUGH_ACCURACY))


def _over_the_first(start: Trial, evidence: Evidence, floor: Array) -> list[Law]:
    """Return fits of a law to the first beginning, the best first, by tanh gradually, too.

    From as many starts again where none comes to the noise, unless half of them end in the same
    minimum. Not gradually where more than OFF is left: then more is missing.
    """
    if evidence.told[FORCE]:
        starts = friction_starts(start, evidence, floor, FIRST)
    else:
        starts = shapes(start, STRIBECK, evidence.until(FIRST))
    first = evidence.until(FIRST)
    points = [from_rest(each, evidence) for each in starts]
    fits: list[Solution] = []

    def fitted(x: Array) -> Solution:
        return fitted_to(start, first, x, ROUGH_ACCURACY)

    together = SMOOTH if is_along_the_way(start) else STARTS
    for k in (0, together):
        fits += side_by_side(fitted, points[k : k + together])
        left = np.array([each.misfit for each in fits])
        least = np.min(left)
        half_there = np.median(left) <= NEARLY * least
        if least <= LEFT_EARLY or least > OFF or half_there:
            break
    laws = _distinct([Law(start, each) for each in fits])
    if not is_along_the_way(start) and least <= OFF:
        late = partial(_gradually, start=gradual(start), first=first)
        laws = _distinct([*laws, *side_by_side(late, [law.trial for law in laws])])
    return laws


def _given_up(left: list[float], rival: Sequence[float]) -> bool:
    """Tell whether a law is, by what it leaves over beginnings that grow, and a rival."""
    other = rival[len(left) - 1] if len(left) <= len(rival) else 0.0
    most = min(OFF, other / CLEARLY) if other > AT_NOISE else OFF
    return left[-1] > most


def _distinct(laws: Sequence[Law]) -> list[Law]:
    """Return the laws, the best first, each minimum of each once."""
    found: list[Law] = []
    for law in sorted(laws, key=_misfit):
        same = [each for each in found if each.start is law.start]
        if not same or law.misfit > SAME_MINIMUM * same[-1].misfit:
            found.append(law)
    return found


def with_less_friction(known: Trial, evidence: Evidence, sheet: Sheet, floor: Array) -> list[Trial]:
    """Return trials with as much friction as a beginning up to DECIDED needs, and more behind.

    More has to take half of the rest away: a law that is a little off is mimicked by another.
    And it has to be more than the force balance could tell from noise. What is left out is held
    against all friction together: without the part before, a fit may not have found its way.
    floor: as for `begun`.
    """
    begin = evidence.until(DECIDED)
    _, misfit = refined(known, begin)
    limit = beginning_score(misfit, known, begin) + STRONG
    unheard = not viscous_is_heard(known, evidence, floor)
    laws, fewer = [known], simpler(known, sheet)
    while fewer:
        fitted, left = refined(fewer.pop(0), begin)
        no_worse = beginning_score(left, fitted, begin) < limit
        no_worse |= unheard and VISCOUS in laws[0].effects and VISCOUS not in fitted.effects
        if no_worse or 0.5 * (left**2 - 1.0) < misfit**2 - 1.0:
            laws, fewer = [fitted, *laws], simpler(fitted, sheet)
    return laws


def beginning_score(misfit: float, fitted: Trial, evidence: Evidence) -> float:
    """Return the criterion of `select` for a fit whose state at rest was fitted along."""
    channels = np.full(np.count_nonzero(evidence.shown), misfit**2)
    return score(channels, evidence.duration(1.0) / CORRELATION_TIME, fitted.x.size)


def follows_the_beginning(known: Trial, evidence: Evidence) -> bool:
    """Tell whether a trial's friction is near enough for the first DECIDED to be explained."""
    _, misfit = refined(known, evidence.until(DECIDED))
    return misfit <= LEFT_EARLY


def refined(known: Trial, evidence: Evidence) -> tuple[Trial, float]:
    """Fit a trial that is near the optimum; return it and its RMS error in units of the noise."""
    fitted = fitted_to(known, evidence, from_rest(known, evidence), ROUGH_ACCURACY)
    return known.continued(fitted), fitted.misfit


def _begin(known: Trial, fitted: Solution, evidence: Evidence, time: float, longer: float) -> Array:
    """Return from where a fit to a longer beginning, s, begins, (k,)."""
    if is_along_the_way(known):
        return fitted.x
    if followed(known, fitted, evidence, time, longer, (GROWTH,)) > time:
        return fitted.x
    return drawn(known, evidence.until(longer), fitted, DRAWN_OF_EACH)

"""What follows the machine where a law of friction no longer does: another law, or an effect more.

Over the whole recording nothing tells which, since each instant of sticking shifts the next. Over
the beginning up to where the law is off the noise the error is smooth, and every effect can be
asked about as it is where nothing sticks.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.friction_beginning import (
    LEFT_EARLY,
    beginning_score,
    gradually,
    refined,
)
from emir_analysis.diagnosis.friction_laws import (
    COULOMB,
    STRIBECK,
    VISCOUS,
    elastic,
    gradual,
    is_along_the_way,
    is_elastic,
    is_gradual,
    is_uneven,
    uneven,
)
from emir_analysis.diagnosis.screening import screen_free_run
from emir_analysis.diagnosis.select import LEFT
from emir_analysis.diagnosis.side_by_side import side_by_side
from emir_analysis.diagnosis.stick_slip import Grown
from emir_analysis.diagnosis.trial import Trial, trial
from emir_plant.sheet import Sheet

MOST_ASKED = 3  # effects that are fitted to that beginning
MOST_BESIDE = 2  # effects beside friction
IN_LAWS = {COULOMB, STRIBECK, VISCOUS}  # effects that fuller laws have


class Laws(NamedTuple):
    """A law of friction, with or without effects besides, and fuller ones that may be needed."""

    law: Trial
    fuller: Sequence[Trial]


class Fitted(NamedTuple):
    """Laws of which the first is fitted to a beginning, what it leaves there and its score.

    left: RMS error in units of the noise.
    """

    laws: Laws
    left: float
    score: float


def next_laws(lost: Grown, laws: Laws, evidence: Evidence, sheet: Sheet) -> Fitted | None:
    """Return what explains the beginning that a law of friction no longer does; None: nothing.

    lost: the law, led as far as it follows. laws: it and fuller ones. An effect more is asked about
    where it does not follow to the end and no other law explains that beginning: it takes longer.
    Beside fuller laws, too, where none beside the law itself explains it.
    """
    begins = [evidence.until(time) for time in sorted({lost.time_before, lost.time})]
    found = _best(_other_laws(laws, evidence), begins, LEFT_EARLY if lost.given_up else LEFT)
    if found is not None or not lost.given_up:
        return found
    more = _with_an_effect_more(lost.before, laws, begins[0], sheet)
    fuller = [each for with_effect in more for each in _fuller(with_effect)]
    return _best(more, begins, LEFT_EARLY) or _best(fuller, begins, LEFT_EARLY)


def _best(found: Sequence[Laws], begins: Sequence[Evidence], most: float) -> Fitted | None:
    """Return the laws of which the first explains a beginning best, fitted to shorter ones first.

    None where all leave more than most, in units of the noise.
    """

    def fitted(laws: Laws) -> Fitted:
        law = laws.law
        for begin in begins:
            law, left = refined(law, begin)
        return Fitted(laws._replace(law=law), left, beginning_score(left, law, begins[-1]))

    fits = [fit for fit in side_by_side(fitted, found) if fit.left <= most]
    return min(fits, key=lambda fit: fit.score, default=None)


def _other_laws(laws: Laws, evidence: Evidence) -> list[Laws]:
    """Return fuller laws, the same one come otherwise, and uneven.

    Gradually, where it comes by tanh; from seals that spring back, where it comes along the way.
    """
    law, fuller = laws
    found = _fuller(laws)
    if not is_uneven(law):
        found.append(Laws(uneven(law), [uneven(more) for more in fuller]))
    if not is_along_the_way(law) and not is_gradual(law):
        found.append(Laws(gradually(law, evidence), [gradual(more) for more in fuller]))
    if is_along_the_way(law) and not is_elastic(law):
        found.append(Laws(elastic(law), [elastic(more) for more in fuller]))
    return found


def _fuller(laws: Laws) -> list[Laws]:
    return [Laws(more, laws.fuller[k + 1 :]) for k, more in enumerate(laws.fuller)]


def _with_an_effect_more(law: Trial, laws: Laws, begin: Evidence, sheet: Sheet) -> list[Laws]:
    """Return laws with each of the effects that promise most beside a law where it still follows.

    Where it sticks at another instant no first-order step says anything.
    """
    if sum(name not in IN_LAWS for name in law.effects) >= MOST_BESIDE:
        return []
    asked = [screened.trial for screened in screen_free_run(law, sheet, begin)]
    asked = [more for more in asked if more.effects[-1] not in IN_LAWS]
    return [
        Laws(more, [_with_effect(each, more, sheet) for each in laws.fuller])
        for more in asked[:MOST_ASKED]
    ]


def _with_effect(law: Trial, more: Trial, sheet: Sheet) -> Trial:
    """Return a law with the last effect of another, of the same size."""
    found = trial(sheet, (*law.effects, more.effects[-1]), law)
    return found.at(np.append(law.x, more.x[law.x.size - found.x.size :]))

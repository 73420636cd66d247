"""How a trial goes on from the balances to the free run: with which sizes, terms and shares."""

from dataclasses import replace

import numpy as np

from emir_analysis.diagnosis.effect_shapes import at_other_ends
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.fitting import fit_balances, fit_free_run, with_fewer_terms
from emir_analysis.diagnosis.friction_laws import sticks
from emir_analysis.diagnosis.late_end import with_a_late_end
from emir_analysis.diagnosis.loads import LOAD
from emir_analysis.diagnosis.select import (
    EXPLAINED,
    HOPELESS,
    SEEN,
    beyond,
    excess,
    free_run_score,
    leaves_quiet,
)
from emir_analysis.diagnosis.side_by_side import side_by_side
from emir_analysis.diagnosis.trial import Trial
from emir_analysis.diagnosis.tried import Tried
from emir_analysis.diagnosis.whole import Progress
from emir_analysis.signals import Array
from emir_plant.effects import REGISTRY


class FreeRunFits:
    """Fits of trials to the free run of the part of recordings that fits see.

    floor: (5,), what the sensors leave in each balance.
    """

    def __init__(self, evidence: Evidence, floor: Array, progress: Progress) -> None:
        self._evidence, self._floor, self._progress = evidence, floor, progress
        self._head = evidence.head(SEEN)

    def fitted(self, tried: Tried) -> Tried:
        """Return a trial fitted to the free run.

        Of several sizes of an effect one alone is taken where the others are not worth their while.
        A load may have ended since. Where all that leads nowhere near, what else is missing drives
        the free run away and the parameters with it: they stay as the balances say, if those are
        all told. Nor do fewer terms of a series lead anywhere then.
        """
        self._progress(f"free run: {tried.trial.name}")
        full = self._with_shares_told(tried.trial, fit_free_run(tried.trial, self._head))
        hopeless = excess(full, self._head) > beyond(HOPELESS)
        if self._evidence.complete and hopeless:
            return replace(tried, free_run=free_run_score(full, self._evidence))
        ways = [full]
        for effect in full.effects:
            if REGISTRY[effect].is_series:
                ways += [] if hopeless else with_fewer_terms(full, effect, self._head)
            else:
                ways += full.with_each_size(effect)
        if LOAD in full.effects:
            ways += [with_a_late_end(way, self._evidence, SEEN) for way in ways]
        scores = [free_run_score(way, self._evidence) for way in ways]
        best_way = int(np.argmin(scores))
        return Tried(ways[best_way], tried.balances, scores[best_way])

    def _with_shares_told(self, balanced: Trial, full: Trial) -> Trial:
        """Return a trial fitted to the free run, or the same with a share at an end, if better.

        balanced: the same fitted to the balances. Where those are quiet and the free run is not
        explained, a share that they do not tell may have led it astray.
        """
        told = excess(full, self._head) <= beyond(EXPLAINED)
        if told or sticks(full) or not leaves_quiet(balanced, self._evidence):
            return full
        ends = side_by_side(self._fitted_twice, at_other_ends(balanced, full))
        return min([full, *ends], key=lambda one: excess(one, self._head))

    def _fitted_twice(self, begun: Trial) -> Trial:
        """Return a trial fitted to the balances and, where they are quiet, to the free run."""
        told = fit_balances(begun, self._head, self._floor)
        return fit_free_run(told, self._head) if leaves_quiet(told, self._evidence) else told

"""Which of the effects that were found are not needed, and go."""

import numpy as np

from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.fitting import fit_balances, fit_free_run, refine_free_run
from emir_analysis.diagnosis.foresight import is_enough
from emir_analysis.diagnosis.friction_laws import COULOMB, STRIBECK, sticks
from emir_analysis.diagnosis.run_errors import free_run_errors
from emir_analysis.diagnosis.select import EXPLAINED, HOPELESS, STRONG, beyond, excess
from emir_analysis.diagnosis.side_by_side import side_by_side
from emir_analysis.diagnosis.trial import Trial, trial
from emir_analysis.diagnosis.whole import Progress, Whole
from emir_plant.sheet import Sheet


class BackwardElimination:
    """Effects go one by one, as long as the whole is explained as well without.

    settled: effects that are known to be needed.
    """

    def __init__(self, evidence: Evidence, sheet: Sheet, whole: Whole, progress: Progress) -> None:
        self._evidence, self._sheet, self._floor = evidence, sheet, evidence.floor(sheet.machine)
        self._whole, self._progress = whole, progress
        self.settled: tuple[str, ...] = ()

    def needed(self, chosen: Trial, plain: Trial) -> Trial:
        """Return a trial without the effects that are not needed, the least needed first.

        plain: the parameters alone, fitted to the whole free run.
        """
        if not chosen.effects or not is_enough(self._whole.fitted(chosen), self._evidence):
            return chosen
        full = self._whole.fitted(chosen)
        least = self._whole.score(full) + STRONG
        droppable = [effect for effect in chosen.effects if self._may_go(effect, full, plain)]
        found = side_by_side(lambda effect: self._fitted_without(effect, full), droppable)
        enough = self._as_good_as(least, found)
        enough = enough or self._as_good_as(least, self._anew(found, full, plain))
        if not enough:
            return chosen
        best = min(enough, key=self._whole.score)
        self._whole.keep(best)
        return self.needed(best, plain)

    def _may_go(self, effect: str, full: Trial, plain: Trial) -> bool:
        """Tell whether a fit without one of its effects may be enough."""
        if effect in self.settled and not (effect == COULOMB and STRIBECK in full.effects):
            return False  # but Coulomb's friction is in Stribeck's
        if self._hopeless_without(effect, full):
            return False
        return full.effects != (effect,) or self._excess(plain) <= beyond(EXPLAINED)

    def _fitted_without(self, effect: str, full: Trial) -> Trial:
        self._progress(f"fitting without: {effect}")
        fewer = refine_free_run(full.without(effect), self._evidence, full)
        return self._whole.better(fewer)

    def _as_good_as(self, least: float, fitted: list[Trial]) -> list[Trial]:
        """Return those that explain enough and whose score of the whole is below least."""
        return [t for t in fitted if self._whole.score(t) < least and is_enough(t, self._evidence)]

    def _anew(self, behind: list[Trial], full: Trial, plain: Trial) -> list[Trial]:
        """Return trials that are behind a fuller one fitted anew beside parameters alone.

        What is not needed may have led the others astray: a play that stands for a dead zone leads
        a late command to a lag. Single effects were all begun there.
        """

        def anew(fewer: Trial) -> Trial:
            self._progress(f"fitting anew: {fewer.name}")
            begun = trial(self._sheet, fewer.effects, plain).formed(fewer.form)
            if np.any(self._evidence.fitted):
                begun = fit_balances(begun, self._evidence, self._floor)
            return refine_free_run(fit_free_run(begun, self._evidence), self._evidence, full)

        near = [t for t in behind if self._excess(t) < beyond(HOPELESS)]
        return side_by_side(anew, [t for t in near if len(t.effects) > 1 and not sticks(t)])

    def _hopeless_without(self, effect: str, full: Trial) -> bool:
        """Tell whether a trial is so far off without one of its effects that no fit is worthwhile.

        To first order, so only where that is far more than what has to be left: beyond it, what
        else is fitted may do better than along straight lines.
        """
        count = sum(error.size for error in free_run_errors(full.machine, self._evidence))
        return full.cost_without(effect) > beyond(HOPELESS) * count

    def _excess(self, tried: Trial) -> float:
        return excess(tried, self._evidence)

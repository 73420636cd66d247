"""Which effects explain the recordings: what is tried, in which order, and what is kept."""

import math
from functools import cached_property

import numpy as np

from emir_analysis.diagnosis.backward_elimination import BackwardElimination
from emir_analysis.diagnosis.drift import Drift, drift
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.fitting import (
    fit_balances,
    fit_free_run,
    following,
    refine_free_run,
)
from emir_analysis.diagnosis.foresight import is_enough
from emir_analysis.diagnosis.forward_selection import MOST_EFFECTS, ForwardSelection
from emir_analysis.diagnosis.friction_laws import sticks
from emir_analysis.diagnosis.friction_told import FrictionTold
from emir_analysis.diagnosis.load_course import load_course, may_be_loaded
from emir_analysis.diagnosis.loads import LOAD
from emir_analysis.diagnosis.misstated import Misstated
from emir_analysis.diagnosis.rounds import Rounds
from emir_analysis.diagnosis.run_errors import free_run_errors
from emir_analysis.diagnosis.select import (
    AT_NOISE,
    EXPLAINED,
    HOPELESS,
    LEFT,
    SEEN,
    STRONG,
    at_noise,
    beyond,
    excess,
    free_run_score,
    leaves_quiet,
)
from emir_analysis.diagnosis.trial import Trial, trial
from emir_analysis.diagnosis.tried import Tried, as_good
from emir_analysis.diagnosis.whole import Progress, Whole
from emir_analysis.root_mean_square import column_rms
from emir_plant.sheet import Sheet

MOST_BESIDE_LOAD = 5  # sets of effects beside which a load of any course is looked for


class Search:
    """Forward selection, then backward elimination.

    Effects are added one at a time, as long as the unseen free run gets better; then those go
    without which the whole is explained as well.

    balanced, refitted: the parameters alone, fitted to the balances and to the whole free run.
    misstated: what one value of the sheet explains, if it is another. elimination: of effects.
    loaded: with a load of any course, where that explains what no effect does, once that was asked.
    """

    def __init__(self, evidence: Evidence, sheet: Sheet, progress: Progress) -> None:
        self._evidence, self._sheet, self._progress = evidence, sheet, progress
        self._head = evidence.head(SEEN)
        self.floor = evidence.floor(sheet.machine)
        progress("parameters only")
        self.balanced = fit_balances(trial(sheet, ()), evidence, self.floor)
        self.refitted = fit_free_run(self.balanced, evidence)
        self.whole = Whole(evidence, sheet, self.floor, progress)
        self.misstated = Misstated(self.balanced, evidence, self.floor, progress)
        self._rounds = Rounds(evidence, sheet, self.floor, self.whole, progress)
        self._friction = FrictionTold(
            evidence, sheet, self.floor, self.whole, self._rounds, progress
        )
        self._forward = ForwardSelection(
            evidence,
            self.floor,
            self.whole,
            self._rounds,
            self._friction,
            lambda: self.drifting is not None,
            progress,
        )
        self.elimination = BackwardElimination(evidence, sheet, self.whole, progress)
        self.loaded: Trial | None = None
        self._courses: dict[tuple[str, ...], Trial | None] = {}  # of loads, by effects beside

    @property
    def tried(self) -> list[Tried]:
        """All trials."""
        return self._rounds.tried

    @cached_property
    def drifting(self) -> Drift | None:
        """Return the size that goes from one value to another, if that is most of what is missing.

        None where no balance can be fitted.
        """
        if not np.any(self._evidence.fitted):
            return None
        self._progress("asking whether something drifts")
        return drift(self.balanced, self._evidence, self.floor)

    def run(self) -> list[Trial]:
        """Return the best trial and those that are as good, or the best until time was over."""
        return self._evidence.limit.within(self._run, self._so_far)

    def named(self, best: Trial) -> Trial:
        """Return a trial as it is named: fitted to the whole, without what it does not need."""
        return self._evidence.limit.within(
            lambda: self.whole.plainer(self.whole.fitted(best)), lambda: self.whole.better(best)
        )

    def _so_far(self) -> list[Trial]:
        """Return the best of all that was fitted."""
        self._progress("the time is over: the best so far")
        fitted = [t.trial for t in self.tried if t.free_run is not None]
        best = min([self.refitted, *self.whole.known(), *fitted], key=self.whole.score)
        return [best if sticks(best) else refine_free_run(best, self._evidence)]

    def _run(self) -> list[Trial]:
        if self._nothing_left():
            self._rounds.tried = [self._rounds.scored(self.balanced)]
            return [self.refitted]  # nothing is left that an effect could explain
        plain = self._rounds.scored(self._plain(), free_run_score(self.refitted, self._evidence))
        self._rounds.tried = [plain]
        best, equal, enough = self._forward.one_at_a_time(plain, [plain.trial])
        if not best.trial.effects:
            late = self._by_whole(self.refitted)
        else:
            late = self._by_whole(self.whole.fitted(best.trial)) if enough else []
        equal, enough = (late, True) if late else (equal, enough)
        if not enough and sticks(best.trial):  # however far off: where it sticks drives it away
            equal, best = self._friction.told(equal, best, LEFT)
            enough = is_enough(best.trial, self._evidence)
        if not enough and self._is_load(best.trial):
            return [best.trial]
        if enough or not (self.misstated.better_than(best.trial) or self.drifting):
            if not enough:
                equal = self._forward.two_at_once(plain, best) or equal
                if equal[0].effects != best.trial.effects and self._is_load(equal[0]):
                    return equal
            equal = self._with_others_in_place(self.nearest_the_whole(equal))
            equal = self.nearest_the_whole(equal)
        self.elimination.settled = self._friction.settled
        needed = self.elimination.needed(equal[0], self.refitted)
        if equal[0].effects and not needed.effects:  # beside none the whole may know more
            return self._by_whole(self.refitted) or [needed]
        if needed is not equal[0]:
            equal = self._forward.equal.get(needed.effects, [needed])
        return self._rivals_on_the_whole(equal)

    def _nothing_left(self) -> bool:
        """Tell whether the parameters alone bring everything to the noise.

        Where they come near, once they are fitted to the end.
        """
        if not leaves_quiet(self.balanced, self._evidence):
            return False
        near = self._excess(self.refitted) < beyond(EXPLAINED)
        if near and not self._each_at_noise(self.refitted):
            self.refitted = refine_free_run(self.refitted, self._evidence)
        return self._each_at_noise(self.refitted)

    def _each_at_noise(self, one: Trial) -> bool:
        """Tell whether the free run of each signal is at the noise; it is not where it is none."""
        errors = free_run_errors(one.machine, self._evidence)
        return bool(np.all(column_rms(np.concatenate(errors)) <= AT_NOISE))

    def _is_load(self, best: Trial) -> bool:
        """Tell whether a load of any course explains all: alone, or beside effects that came near.

        Beside these where alone it leaves something, since it may stand for any force. A size that
        drifts is no load.
        """
        if self.drifting or is_enough(self.whole.better(best), self._evidence):
            return False
        self.loaded = self._with_load(self.balanced)
        others = best.without(LOAD) if LOAD in best.effects else best
        singles = [t.trial for t in sorted(self.tried, key=lambda t: t.balances)]
        for known in [others, *(t for t in singles if len(t.effects) == 1)][:MOST_BESIDE_LOAD]:
            if self.loaded is None or self._excess(self.loaded) > beyond(LEFT):
                self._look_beside(known)
        return self.loaded is not None

    def _look_beside(self, known: Trial) -> None:
        """Take a load beside effects, asked for once, where that is clearly better."""
        asked = LOAD in known.effects or known.effects in self._courses
        if asked or not may_be_loaded(known, self._evidence):
            return
        beside = self._with_load(fit_balances(known, self._evidence, self.floor))
        limit = math.inf if self.loaded is None else self.whole.score(self.loaded) - STRONG
        if beside is not None and self.whole.score(beside) < limit:
            self.loaded = beside

    def _with_load(self, known: Trial) -> Trial | None:
        """Return a trial with a load of any course beside its effects, as it was found once."""
        if known.effects not in self._courses:
            found = load_course(known, self._evidence, self.floor, self._progress)
            self._courses[known.effects] = found
        return self._courses[known.effects]

    def _with_others_in_place(self, equal: list[Trial]) -> list[Trial]:
        """Return the best trials with other effects in place of some of several, where better.

        The same where they are at the noise, or with a series at all of it, nowhere near, or stick,
        which takes too long.
        """
        if not equal[0].effects[1:] or sticks(equal[0]):
            return equal
        full = self.whole.fitted(equal[0])
        enough = LEFT if full.has_series else AT_NOISE
        if not beyond(enough) < self._excess(full) <= beyond(HOPELESS):
            return equal
        better = self._rounds.exchanged(full)
        return self._with_others_in_place(as_good(better)) if better else equal

    def nearest_the_whole(self, equal: list[Trial]) -> list[Trial]:
        """Return the best trials, or other effects that explain the whole better: as many of them.

        Where the best one leaves something, the part held back may have preferred it by chance, and
        a series has terms enough to stand for another effect. Of the others, also of those that few
        balances have spoken against, that which is nearest is fitted to the whole as well.
        """
        best = equal[0]
        if not best.effects or sticks(best):
            return equal
        left = self._excess(self.whole.fitted(best))
        if left >= beyond(HOPELESS) or not (best.has_series or left > beyond(LEFT)):
            return equal
        self._rounds.ask_further(best)
        asked = [t.trial for t in self.tried if t.free_run is not None]
        alike = [t for t in asked if len(t.effects) == len(best.effects) and not sticks(t)]
        others = [t for t in alike if set(t.effects) != set(best.effects)]
        nearest = min(others, key=self.whole.score, default=best)
        if self._excess(nearest) > beyond(EXPLAINED):
            return equal
        plainer = self.whole.plainer if best.has_series else lambda full: full
        scores = [self.whole.score(plainer(self.whole.fitted(t))) for t in (best, nearest)]
        return [nearest] if scores[1] < scores[0] - STRONG else equal

    def _rivals_on_the_whole(self, equal: list[Trial]) -> list[Trial]:
        """Return the best trial and those that are as good on the whole, too.

        The part held back may be too short to part them. What sticks may be led to the whole badly.
        """
        best, *others = equal
        if not others or not best.effects:
            return equal
        limit = self.whole.fitted_score(best) + STRONG
        return [best, *(t for t in others if sticks(t) or self.whole.fitted_score(t) < limit)]

    def _by_whole(self, known: Trial) -> list[Trial]:
        """Return the best trials with one effect more that the whole alone tells, if there are any.

        known: fitted to the whole.
        """
        many = len(known.effects) >= MOST_EFFECTS
        better = [] if many or sticks(known) else self._rounds.beside_explained(known)
        return as_good(better) if better else []

    def _plain(self) -> Trial:
        """Return the parameters alone as effects are looked for beside them.

        As the balances have them. Where sensors leave all of these out, or some and the others are
        quiet, as the longest beginning has them that they explain: what acts later cannot have led
        them astray. Likewise where all are quiet and they explain all that the fits see.
        """
        if not np.any(self._evidence.fitted):
            return following(self.balanced, self._head)
        told = fit_balances(self.balanced, self._head, self.floor)
        if not leaves_quiet(told, self._head):
            return told
        followed = following(told, self._head)
        trusted = not self._evidence.complete or at_noise(followed, self._head)
        return followed if trusted else told

    def _excess(self, tried: Trial) -> float:
        return excess(tried, self._evidence)

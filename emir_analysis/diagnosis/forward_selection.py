"""Effects are added one at a time, or two at once, as long as the unseen free run gets better."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.fitting import fit_balances
from emir_analysis.diagnosis.foresight import is_enough
from emir_analysis.diagnosis.friction_laws import sticks
from emir_analysis.diagnosis.friction_told import FrictionTold
from emir_analysis.diagnosis.loads import LOAD
from emir_analysis.diagnosis.rounds import Rounds
from emir_analysis.diagnosis.select import (
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
from emir_analysis.diagnosis.trial import Trial
from emir_analysis.diagnosis.tried import Tried, as_good, free
from emir_analysis.diagnosis.whole import Progress, Whole
from emir_analysis.signals import Array

MOST_EFFECTS = 3  # that are looked for in one machine
MOST_BESIDE_ENOUGH = 2  # the same where fewer suffice, but more than the noise is left
MOST_OTHERS = 2  # effects beside which is looked where nothing beside the best one suffices


class ForwardSelection:
    """What is added to a trial, and where it stops.

    equal: the best trials of each round, by the effects of the first.
    drifts: tells whether a size that goes from one value to another is most of what is missing.
    """

    def __init__(  # noqa: PLR0913, PLR0917 (what is asked, of what)
        self,
        evidence: Evidence,
        floor: Array,
        whole: Whole,
        rounds: Rounds,
        friction: FrictionTold,
        drifts: Callable[[], bool],
        progress: Progress,
    ) -> None:
        self._evidence, self._floor, self._head = evidence, floor, evidence.head(SEEN)
        self._whole, self._rounds, self._friction = whole, rounds, friction
        self._drifts, self._progress = drifts, progress
        self.equal: dict[tuple[str, ...], list[Trial]] = {}

    def one_at_a_time(self, best: Tried, equal: list[Trial]) -> tuple[Tried, list[Trial], bool]:
        """Add effects to a trial, one a round, as long as that is better.

        equal: trials as good as that. Return the best trial, those that are as good and whether an
        effect has made it suffice.
        """
        enough = False
        self.equal[best.trial.effects] = equal
        while len(best.trial.effects) < MOST_EFFECTS:
            better = self._with_one_more(best, enough=enough)
            if not better:
                break
            equal = self.simplest(as_good(better), better)
            self.equal[equal[0].effects] = equal
            best = self._known_whole(next(t for t in better if t.trial is equal[0]))
            if sticks(best.trial) and self._excess(best.trial) < beyond(HOPELESS):
                equal, best = self._friction.told(equal, best)
            enough = is_enough(best.trial, self._evidence)
            many = len(best.trial.effects) >= MOST_BESIDE_ENOUGH
            if enough and (many or self._excess(best.trial) <= beyond(LEFT)):
                break
            if not enough and LOAD in best.trial.effects and self._drifts():
                break  # which comes slowly, as a load does, and no effect beside it explains
        return best, equal, enough

    def two_at_once(self, plain: Tried, best: Tried) -> list[Trial]:
        """Return the best trials beside another first effect, or else of pairs, if there are any.

        Beside a pair that does not suffice a third effect is looked for.
        plain: parameters alone. best: so far, which does not suffice.
        """
        others = [] if self._evidence.complete else self._beside_others(best)
        if others or not np.any(self._evidence.fitted):
            return others
        self._progress("pairs of effects")
        better = self._rounds.pairs(plain, best) or self._rounds.triples(best)
        if not better:
            return []
        equal = as_good(better)
        pair = next(t for t in better if t.trial is equal[0])
        if sticks(pair.trial):  # however far off: where it sticks drives it away
            equal, pair = self._friction.told(equal, pair)
        pair = self._known_whole(pair)
        if not is_enough(pair.trial, self._evidence):
            _, equal, _ = self.one_at_a_time(pair, equal)
        return equal

    def simplest(self, equal: list[Trial], better: list[Tried]) -> list[Trial]:
        """Return the best trials; one with fewer parameters where the whole knows nothing better.

        Of two that both explain what they were fitted to, the part held back may prefer the one
        whose parameters happen to be nearer.
        """
        best, score = equal[0], self._whole.fitted_score
        for other in (t.trial for t in better):
            fewer = other.numbers < best.numbers and not sticks(other)
            explain = fewer and at_noise(best, self._head) and at_noise(other, self._head)
            if explain and score(other) < score(best) + STRONG:
                best, equal = other, [other]
        return equal

    def _with_one_more(self, best: Tried, *, enough: bool) -> list[Tried]:
        """Return what is better with an effect more; with two, where the first leaves much.

        enough: the best so far suffices.
        """
        self._progress(f"all effects beside: {best.trial.name}")
        if enough:
            return self._rounds.beside_enough(best)
        better = self._beside_quiet(best) or self._rounds.beside(best)
        if best.trial.effects or not better:
            return better
        pairs = self._quiet_pairs(best, min(better, key=free))
        if pairs:  # one of two may still not be needed
            singles = as_good(better)
            self.equal[singles[0].effects] = singles
        return pairs or better

    def _beside_quiet(self, best: Tried) -> list[Tried]:
        """Return what suffices beside another single effect, one that the balances clearly prefer.

        Where all are told, and quiet with it as they have it: what they hardly know of, such as a
        small leak, leads its free run astray. What sticks is told by a beginning.
        """
        if len(best.trial.effects) != 1 or not self._evidence.complete:
            return []
        singles = self._singles()
        first = min(singles, key=lambda t: t.balances, default=best)
        if first.balances > best.balances - STRONG or sticks(first.trial):
            return []
        told = fit_balances(first.trial, self._head, self._floor)
        if not leaves_quiet(told, self._evidence):
            return []
        self._progress(f"all effects beside what the balances prefer: {told.name}")
        other = self._rounds.scored(told, free_run_score(told, self._evidence))
        better = self._rounds.beside(other)
        suffices = better and is_enough(self._whole.fitted(as_good(better)[0]), self._evidence)
        return better if suffices else []

    def _quiet_pairs(self, plain: Tried, single: Tried) -> list[Tried]:
        """Return the pairs of effects that are better than a single one that leaves much.

        What sticks is told by a beginning, not by the balances; a size that drifts is no pair.
        """
        told = self._evidence.complete and not sticks(single.trial)
        if not told or leaves_quiet(single.trial, self._evidence) or self._drifts():
            return []
        self._progress("pairs of effects that leave the balances quiet")
        return self._rounds.quiet_pairs(plain, single)

    def _beside_others(self, best: Tried) -> list[Trial]:
        """Return the best trials beside another effect than the best one, if they suffice.

        Where sensors are missing, the balances do not tell which of two the first to look beside
        is, and the part held back knows little of it. What was not simulated beside the best one
        takes least time; then that which says most to the balances comes first, then those that
        are ahead in the free run.
        """
        alone = (t for t in self._rounds.tried if t.trial.effects == best.trial.effects[:1])
        first = next(alone, best)
        singles = self._singles()
        singles = sorted(singles, key=lambda t: t.balances)[:1] + sorted(singles, key=free)
        others: dict[tuple[str, ...], Tried] = {}
        for single in singles:
            if single.trial.effects != best.trial.effects[:1]:
                others.setdefault(single.trial.effects, single)
        self._progress(f"further effects beside: {first.trial.name}")
        found = self._sufficient(self._rounds.further(first))
        for other in list(others.values())[:MOST_OTHERS]:
            if not found:
                self._progress(f"all effects beside: {other.trial.name}")
                found = self._sufficient(self._rounds.beside(other))
        return found

    def _singles(self) -> list[Tried]:
        """Return the trials with one effect that were simulated."""
        tried = self._rounds.tried
        return [t for t in tried if t.free_run is not None and len(t.trial.effects) == 1]

    def _sufficient(self, better: list[Tried]) -> list[Trial]:
        """Return the best of what is better than another, if it suffices."""
        if not better:
            return []
        equal = as_good(better)
        best = next(t for t in better if t.trial is equal[0])
        if sticks(best.trial):
            equal, _ = self._friction.told(equal, best)
        return equal if is_enough(self._whole.fitted(equal[0]), self._evidence) else []

    def _known_whole(self, best: Tried) -> Tried:
        """Return a trial as the whole recordings have it, if it is near them.

        What the part that the fits see tells badly, such as how a drift goes on, is then no
        reason to look for another effect. What sticks and leaves much even there is not led to
        the optimum so.
        """
        if sticks(best.trial) and not at_noise(best.trial, self._head):
            return best
        near = self._excess(best.trial) < beyond(HOPELESS)
        return replace(best, trial=self._whole.fitted(best.trial)) if near else best

    def _excess(self, tried: Trial) -> float:
        return excess(tried, self._evidence)

"""Which effects explain the recordings: what is tried, in which order, and what is kept."""

from dataclasses import replace
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
from emir_analysis.diagnosis.friction_beginning import begun, with_less_friction
from emir_analysis.diagnosis.friction_laws import fullest, nested, sticks
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
    rivals,
)
from emir_analysis.diagnosis.stick_slip import OFF
from emir_analysis.diagnosis.trial import Trial, trial
from emir_analysis.diagnosis.tried import Tried, free
from emir_analysis.diagnosis.whole import Progress, Whole
from emir_analysis.root_mean_square import column_rms
from emir_plant.sheet import Sheet

MOST_EFFECTS = 3  # that are looked for in one machine
MOST_BESIDE_ENOUGH = 2  # the same where fewer suffice, but more than the noise is left
MOST_OTHERS = 2  # effects beside which is looked where nothing beside the best one suffices


class Search:
    """Forward selection, then backward elimination.

    Effects are added one at a time, as long as the unseen free run gets better; then those go
    without which the whole is explained as well.

    balanced, refitted: the parameters alone, fitted to the balances and to the whole free run.
    misstated: what one value of the sheet explains, if it is another. elimination: of effects.
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
        self.elimination = BackwardElimination(evidence, sheet, self.whole, progress)
        self._equal: dict[tuple[str, ...], list[Trial]] = {}  # the best of each round, by effects
        self._begun: set[tuple[str, ...]] = set()  # laws of friction that a beginning has told

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
        best, equal, enough = self._one_at_a_time(plain, [plain.trial])
        if not best.trial.effects:
            late = self._by_whole(self.refitted)
        else:
            late = self._by_whole(self.whole.fitted(best.trial)) if enough else []
        equal, enough = (late, True) if late else (equal, enough)
        if not enough and sticks(best.trial):  # however far off: where it sticks drives it away
            equal, best = self._by_beginning(equal, best, LEFT)
            enough = is_enough(best.trial, self._evidence)
        if enough or not (self.misstated.better_than(best.trial) or self.drifting):
            if not enough:
                equal = self._two_at_once(plain, best) or equal
            equal = self._with_others_in_place(self.nearest_the_whole(equal))
            equal = self.nearest_the_whole(equal)
        needed = self.elimination.needed(equal[0], self.refitted)
        if equal[0].effects and not needed.effects:  # beside none the whole may know more
            return self._by_whole(self.refitted) or [needed]
        if needed is not equal[0]:
            equal = self._equal.get(needed.effects, [needed])
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
        return self._with_others_in_place(_as_good(better)) if better else equal

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
        limit = self._on_the_whole(best) + STRONG
        as_good = [t for t in others if sticks(t) or self._on_the_whole(t) < limit]
        return [best, *as_good]

    def _on_the_whole(self, one: Trial) -> float:
        return self.whole.score(self.whole.fitted(one))

    def _by_whole(self, known: Trial) -> list[Trial]:
        """Return the best trials with one effect more that the whole alone tells, if there are any.

        known: fitted to the whole.
        """
        many = len(known.effects) >= MOST_EFFECTS
        better = [] if many or sticks(known) else self._rounds.beside_explained(known)
        return _as_good(better) if better else []

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

    def _one_at_a_time(self, best: Tried, equal: list[Trial]) -> tuple[Tried, list[Trial], bool]:
        """Add effects to a trial, one a round, as long as that is better.

        equal: trials as good as that. Return the best trial, those that are as good and whether an
        effect has made it suffice.
        """
        enough = False
        self._equal[best.trial.effects] = equal
        while len(best.trial.effects) < MOST_EFFECTS:
            better = self._with_one_more(best, enough=enough)
            if not better:
                break
            equal = self.simplest(_as_good(better), better)
            self._equal[equal[0].effects] = equal
            best = self._known_whole(next(t for t in better if t.trial is equal[0]))
            if sticks(best.trial) and self._excess(best.trial) < beyond(HOPELESS):
                equal, best = self._by_beginning(equal, best)
            enough = is_enough(best.trial, self._evidence)
            many = len(best.trial.effects) >= MOST_BESIDE_ENOUGH
            if enough and (many or self._excess(best.trial) <= beyond(LEFT)):
                break
            if not enough and LOAD in best.trial.effects and self.drifting:
                break  # which comes slowly, as a load does, and no effect beside it explains
        return best, equal, enough

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
            singles = _as_good(better)
            self._equal[singles[0].effects] = singles
        return pairs or better

    def _beside_quiet(self, best: Tried) -> list[Tried]:
        """Return what suffices beside another single effect, one that the balances clearly prefer.

        Where all are told, and quiet with it as they have it: what they hardly know of, such as a
        small leak, leads its free run astray. What sticks is told by a beginning.
        """
        if len(best.trial.effects) != 1 or not self._evidence.complete:
            return []
        singles = [t for t in self.tried if t.free_run is not None and len(t.trial.effects) == 1]
        first = min(singles, key=lambda t: t.balances, default=best)
        if first.balances > best.balances - STRONG or sticks(first.trial):
            return []
        told = fit_balances(first.trial, self._head, self.floor)
        if not leaves_quiet(told, self._evidence):
            return []
        self._progress(f"all effects beside what the balances prefer: {told.name}")
        other = self._rounds.scored(told, free_run_score(told, self._evidence))
        better = self._rounds.beside(other)
        suffices = better and is_enough(self.whole.fitted(_as_good(better)[0]), self._evidence)
        return better if suffices else []

    def _quiet_pairs(self, plain: Tried, single: Tried) -> list[Tried]:
        """Return the pairs of effects that are better than a single one that leaves much.

        What sticks is told by a beginning, not by the balances; a size that drifts is no pair.
        """
        told = self._evidence.complete and not sticks(single.trial)
        if not told or leaves_quiet(single.trial, self._evidence) or self.drifting:
            return []
        self._progress("pairs of effects that leave the balances quiet")
        return self._rounds.quiet_pairs(plain, single)

    def _two_at_once(self, plain: Tried, best: Tried) -> list[Trial]:
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
        equal = _as_good(better)
        pair = next(t for t in better if t.trial is equal[0])
        if sticks(pair.trial):  # however far off: where it sticks drives it away
            equal, pair = self._by_beginning(equal, pair)
        pair = self._known_whole(pair)
        if not is_enough(pair.trial, self._evidence):
            _, equal, _ = self._one_at_a_time(pair, equal)
        return equal

    def _beside_others(self, best: Tried) -> list[Trial]:
        """Return the best trials beside another effect than the best one, if they suffice.

        Where sensors are missing, the balances do not tell which of two the first to look beside
        is, and the part held back knows little of it. What was not simulated beside the best one
        takes least time; then that which says most to the balances comes first, then those that
        are ahead in the free run.
        """
        alone = (t for t in self.tried if t.trial.effects == best.trial.effects[:1])
        first = next(alone, best)
        singles = [t for t in self.tried if t.free_run is not None and len(t.trial.effects) == 1]
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

    def _sufficient(self, better: list[Tried]) -> list[Trial]:
        """Return the best of what is better than another, if it suffices."""
        if not better:
            return []
        equal = _as_good(better)
        best = next(t for t in better if t.trial is equal[0])
        if sticks(best.trial):
            equal, _ = self._by_beginning(equal, best)
        return equal if is_enough(self.whole.fitted(equal[0]), self._evidence) else []

    def simplest(self, equal: list[Trial], better: list[Tried]) -> list[Trial]:
        """Return the best trials; one with fewer parameters where the whole knows nothing better.

        Of two that both explain what they were fitted to, the part held back may prefer the one
        whose parameters happen to be nearer.
        """
        best = equal[0]
        for other in (t.trial for t in better):
            fewer = other.numbers < best.numbers and not sticks(other)
            explain = fewer and at_noise(best, self._head) and at_noise(other, self._head)
            if explain and self._on_the_whole(other) < self._on_the_whole(best) + STRONG:
                best, equal = other, [other]
        return equal

    def _known_whole(self, best: Tried) -> Tried:
        """Return a trial as the whole recordings have it, if it is near them.

        What the part that the fits see tells badly, such as how a drift goes on, is then no
        reason to look for another effect. What sticks and leaves much even there is not led to
        the optimum so.
        """
        if sticks(best.trial) and not at_noise(best.trial, self._head):
            return best
        near = self._excess(best.trial) < beyond(HOPELESS)
        return replace(best, trial=self.whole.fitted(best.trial)) if near else best

    def _by_beginning(
        self, equal: list[Trial], best: Tried, most: float = OFF
    ) -> tuple[list[Trial], Tried]:
        """Return the best trials, one that sticks, with the friction that a beginning tells.

        The same where they leave nothing, where more than most is left over that beginning, in
        units of the noise, or where that is no better on the whole.
        """
        if self._excess(best.trial) <= beyond(LEFT):
            return equal, best
        led = self.whole.led(best.trial)
        if led is not None:
            self.whole.keep(led)
            return equal, replace(best, trial=led)
        found = self._with_friction(best.trial, most)
        if found is None or self.whole.score(found) > self.whole.score(best.trial) - STRONG:
            return equal, best
        self.whole.keep(found)
        self.elimination.settled = tuple(n for n in found.effects if n.endswith("_friction"))
        told = self._rounds.scored(found, free_run_score(found, self._evidence))
        self._rounds.tried.append(told)
        return [found], told

    def _with_friction(self, known: Trial, most: float) -> Trial | None:
        """Return a trial that sticks with the friction that a beginning tells, fitted to the whole.

        None where that was asked before, tells that more than friction is missing, or is the same.
        """
        start = fullest(known, self._sheet)
        if start.effects in self._begun:
            return None
        self._begun.add(start.effects)
        self._progress(f"friction by a growing beginning: {known.name}")
        law = begun(start, self._evidence, self.floor, most)
        if law is None:
            return None
        law, *fuller = with_less_friction(law, self._evidence, self._sheet, self.floor)
        if set(law.effects) == set(known.effects) and at_noise(known, self._evidence):
            return self.whole.at_noise(fuller)  # a break-away may show in later sticks only
        return self.whole.with_friction(law, fuller, known)

    def _excess(self, tried: Trial) -> float:
        return excess(tried, self._evidence)


def _as_good(better: list[Tried]) -> list[Trial]:
    """Return the best trial and those that are as good.

    Of two of which one is the other without a break-away the one with fewer parameters: it would
    be as good whatever the recordings are. An effect in an unusual form is named where nothing else
    is as good: under one command one edge of a valve opens later as a gain is less.
    """
    equal = rivals([t.trial for t in better], [free(t) for t in better])
    equal = [t for t in equal if not t.unusual] or equal
    best = next((less for less in equal[1:] if nested(equal[0], less)), equal[0])
    others = [t for t in equal[1:] if t is not best and t.numbers <= best.numbers]
    return [best, *others]

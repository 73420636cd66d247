"""Which effects explain the recordings: what is tried, in which order, and what is kept."""

from dataclasses import dataclass, replace

import numpy as np

from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.experiment import SHORTEST
from emir_analysis.diagnosis.fitting import (
    fit_balances,
    fit_free_run,
    following,
    refine_free_run,
    with_fewer_terms,
)
from emir_analysis.diagnosis.foresight import explained
from emir_analysis.diagnosis.friction_laws import fullest, nested, sticks
from emir_analysis.diagnosis.late_end import with_a_late_end
from emir_analysis.diagnosis.run_errors import free_run_errors
from emir_analysis.diagnosis.screening import LOAD, OnBalances, Screened, screen_free_run
from emir_analysis.diagnosis.select import (
    AT_NOISE,
    EXPLAINED,
    HOPELESS,
    LEFT,
    SEEN,
    STRONG,
    astray,
    at_noise,
    balance_score,
    beyond,
    excess,
    free_run_score,
    leaves_quiet,
    rivals,
)
from emir_analysis.diagnosis.stick_slip import OFF, begun, with_less_friction
from emir_analysis.diagnosis.trial import Trial, trial
from emir_analysis.diagnosis.whole import Progress, Whole
from emir_analysis.root_mean_square import column_rms
from emir_plant.effects import REGISTRY
from emir_plant.sheet import Sheet

MOST_EFFECTS = 3  # that are looked for in one machine
MOST_BESIDE_ENOUGH = 2  # the same where fewer suffice, but more than the noise is left
MOST_FITTED = 4  # effects that are fitted to the balances with all parameters
MOST_SIMULATED = 3  # trials of a round that go on from the balances to the free run
MOST_OTHERS = 2  # effects beside which is looked where nothing beside the best one suffices
PROMISING = 0.3  # share of the rest; a quarter of the step to where all is gone takes 0.44 away
CLOSE = 5.0 * STRONG  # of the best score on the balances, within which the free run decides


@dataclass(frozen=True)
class Tried:
    """A trial and its scores on the balances and on the unseen free run; smaller is better.

    free_run: None where the balances already spoke against it.
    """

    trial: Trial
    balances: float
    free_run: float | None = None


class Search:
    """Forward selection, then backward elimination.

    Effects are added one at a time, as long as the unseen free run gets better; then those go
    without which the whole is explained as well.

    tried: all trials. balanced, refitted: the parameters alone, fitted to the balances and to the
    free run of the whole recordings.
    """

    def __init__(self, evidence: Evidence, sheet: Sheet, progress: Progress) -> None:
        self._evidence, self._sheet, self._progress = evidence, sheet, progress
        self._head = evidence.head(SEEN)
        self.floor = evidence.floor(sheet.machine)
        progress("parameters only")
        self.balanced = fit_balances(trial(sheet, ()), evidence, self.floor)
        self.refitted = fit_free_run(self.balanced, evidence)
        self.tried: list[Tried] = []
        self.whole = Whole(evidence, sheet, self.floor, progress)
        self._rounds: dict[tuple[str, ...], list[Trial]] = {}  # the best of each, by effects
        self._settled: tuple[str, ...] = ()  # effects that are known to be needed
        self._begun: set[tuple[str, ...]] = set()  # laws of friction that a beginning has told
        self._beside_none: OnBalances | None = None

    def run(self) -> list[Trial]:
        """Return the best trial and those that are as good."""
        errors = free_run_errors(self.refitted.machine, self._evidence)
        left = column_rms(np.concatenate(errors))  # NaN where there is no free run
        if np.all(left <= AT_NOISE) and self._quiet(self.balanced):
            self.tried = [self._scored(self.balanced)]
            return [self.refitted]  # nothing is left that an effect could explain
        plain = self._scored(self._plain(), free_run_score(self.refitted, self._evidence))
        self.tried = [plain]
        best, equal, enough = self._one_at_a_time(plain)
        if not enough and sticks(best.trial):  # however far off: where it sticks drives it away
            equal, best = self._by_beginning(equal, best, LEFT)
            enough = self._enough(best.trial)
        if not enough:
            equal = self._two_at_once(plain, best) or equal
        needed = self.needed(equal[0])
        return equal if needed is equal[0] else self._rounds.get(needed.effects, [needed])

    def _plain(self) -> Trial:
        """Return the parameters alone as effects are looked for beside them.

        As the balances have them. Where sensors leave all of these out, as the longest beginning
        has them that they explain: what acts later cannot have led them astray.
        """
        if np.any(self._evidence.fitted):
            return fit_balances(self.balanced, self._head, self.floor)
        return following(self.balanced, self._head)

    def _one_at_a_time(self, plain: Tried) -> tuple[Tried, list[Trial], bool]:
        """Add effects to parameters alone, one a round, as long as that is better.

        Return the best trial, those that are as good and whether an effect has made it suffice.
        """
        best, equal, enough = plain, [plain.trial], False
        self._rounds = {plain.trial.effects: equal}
        while len(best.trial.effects) < MOST_EFFECTS:
            self._progress(f"all effects beside: {best.trial.name}")
            better = self._beside_enough(best) if enough else self._beside(best)
            if not better:
                break
            equal = self.simplest(_as_good(better), better)
            self._rounds[equal[0].effects] = equal
            best = self._known_whole(next(t for t in better if t.trial is equal[0]))
            if sticks(best.trial) and self._excess(best.trial) < beyond(HOPELESS):
                equal, best = self._by_beginning(equal, best)
            enough = self._enough(best.trial)
            many = len(best.trial.effects) >= MOST_BESIDE_ENOUGH
            if enough and (many or self._excess(best.trial) <= beyond(LEFT)):
                break
        return best, equal, enough

    def _two_at_once(self, plain: Tried, best: Tried) -> list[Trial]:
        """Return the best trials beside another first effect, or else of pairs, if there are any.

        plain: parameters alone. best: so far, which does not suffice.
        """
        others = [] if self._evidence.complete else self._beside_others(best)
        if others or not np.any(self._evidence.fitted):
            return others
        self._progress("pairs of effects")
        better = self._by_balances(self._pairs(plain, best), best)
        if not better:
            return []
        equal = _as_good(better)
        pair = next(t for t in better if t.trial is equal[0])
        if sticks(pair.trial):  # however far off: where it sticks drives it away
            equal, _ = self._by_beginning(equal, pair)
        return equal

    def _beside_others(self, best: Tried) -> list[Trial]:
        """Return the best trials beside another effect than the best one, if they suffice.

        Where sensors are missing, the balances do not tell which of two the first to look beside
        is, and the part held back knows little of it. That which says most to the balances comes
        first, then those that are ahead in the free run.
        """
        singles = [t for t in self.tried if t.free_run is not None and len(t.trial.effects) == 1]
        singles = sorted(singles, key=lambda t: t.balances)[:1] + sorted(singles, key=_free)
        others: dict[tuple[str, ...], Tried] = {}
        for single in singles:
            if single.trial.effects != best.trial.effects[:1]:
                others.setdefault(single.trial.effects, single)
        for other in list(others.values())[:MOST_OTHERS]:
            self._progress(f"all effects beside: {other.trial.name}")
            better = self._beside(other)
            found = _as_good(better) if better else []
            if found and self._enough(self.whole.fitted(found[0])):
                return found
        return []

    def simplest(self, equal: list[Trial], better: list[Tried]) -> list[Trial]:
        """Return the best trials; one with fewer parameters where the whole knows nothing better.

        Of two that both explain what they were fitted to, the part held back may prefer the one
        whose parameters happen to be nearer.
        """
        best = equal[0]
        for other in (t.trial for t in better):
            fewer = other.x.size < best.x.size and not sticks(other)
            if fewer and at_noise(best, self._head) and at_noise(other, self._head):
                limit = self.whole.score(self.whole.fitted(best)) + STRONG
                if self.whole.score(self.whole.fitted(other)) < limit:
                    best, equal = other, [other]
        return equal

    def needed(self, chosen: Trial) -> Trial:
        """Return a trial without the effect that is least needed, if one is not."""
        if not chosen.effects or not self._enough(self.whole.fitted(chosen)):
            return chosen
        full = self.whole.fitted(chosen)
        least = self.whole.score(full) + STRONG
        enough = []
        for effect in chosen.effects:
            if effect in self._settled or self._hopeless_without(full, effect):
                continue
            fewer = full.without(effect)
            if not fewer.effects and self._excess(self.refitted) > beyond(EXPLAINED):
                continue
            self._progress(f"fitting without: {effect}")
            fitted = self.whole.better(refine_free_run(fewer, self._evidence, full))
            if self.whole.score(fitted) < least and self._enough(fitted):
                enough.append(fitted)
        if not enough:
            return chosen
        best = min(enough, key=self.whole.score)
        self.whole.keep(best)
        return self.needed(best)

    def _hopeless_without(self, full: Trial, effect: str) -> bool:
        """Tell whether a trial is so far off without one of its effects that no fit is worthwhile.

        To first order, so only where that is far more than what has to be left: beyond it, what
        else is fitted may do better than along straight lines.
        """
        count = sum(error.size for error in free_run_errors(full.machine, self._evidence))
        return full.cost_without(effect) > beyond(HOPELESS) * count

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
        self._settled = tuple(name for name in found.effects if name.endswith("_friction"))
        told = self._scored(found, free_run_score(found, self._evidence))
        self.tried.append(told)
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
            return None
        return self.whole.with_friction(law, fuller, known)

    def _pairs(self, plain: Tried, best: Tried) -> list[Screened]:
        """Return pairs of effects, the most promising first.

        All to first order, and all beside the one effect that says most to the balances: the
        free run may be none the better for it while another effect drives it away.
        """
        found = self._on_balances(plain.trial).pairs()
        singles = [t for t in self.tried if len(t.trial.effects) == 1]
        first = min(singles, key=lambda t: t.balances, default=best)
        if first.trial.effects != best.trial.effects:
            told = fit_balances(first.trial, self._head, self.floor)
            found += self._on_balances(told).singles()
        return sorted(found, key=lambda s: s.cost)

    def _on_balances(self, known: Trial) -> OnBalances:
        """Return each effect begun beside a trial; beside none they are asked for twice."""
        if not known.effects and self._beside_none is not None:
            return self._beside_none
        begun = OnBalances(known, self._sheet, self._head, self.floor)
        if not known.effects:
            self._beside_none = begun
        return begun

    def _beside(self, best: Tried) -> list[Tried]:
        """Return what is better with one effect more.

        Where missing sensors leave balances out, what those would show is in the free run alone:
        that is asked too where the others lead nowhere near, and where they are quiet: what acts
        in a few windows only, or hardly more than their noise, does not tell there which it is.
        """
        better = []
        if np.any(self._evidence.fitted):
            found = self._on_balances(best.trial).singles()
            better = self._by_balances(found, best)
            near = any(self._excess(t.trial) < beyond(HOPELESS) for t in better)
            told = near or self._evidence.complete
            if told and not self._quiet(best.trial):
                return better
        known = [t.trial.effects for t in better]
        others = [t for t in self._on_free_run(best) if t.trial.effects not in known]
        better += self._better(others, best)
        return better or self._in_held_back(best)

    def _in_held_back(self, best: Tried) -> list[Tried]:
        """Return what suffices with one effect more that acts in the part held back alone.

        The part that the fits see is explained without, so that nothing there asks for it.
        """
        unexplained = beyond(EXPLAINED)
        if excess(best.trial, self._head) > unexplained or self._excess(best.trial) <= unexplained:
            return []
        near = self._evidence.until(astray(best.trial, self._evidence) + SHORTEST)
        limit = (1.0 - PROMISING) * excess(best.trial, near)
        found = []
        for screened in screen_free_run(best.trial, self._sheet, near)[:MOST_SIMULATED]:
            if excess(screened.trial, near) < limit:
                fitted = self.whole.fitted(screened.trial)
                if self._suffices(fitted, best.trial):
                    found.append(self._scored(fitted, free_run_score(fitted, self._evidence)))
        self.tried += found
        return found

    def _beside_enough(self, best: Tried) -> list[Tried]:
        """Return the same beside a trial that is good enough: what takes away most of the rest.

        The balances are quiet then; the free run alone may know more. Beside what sticks, where a
        fit takes longest, only what takes a part away before it is fitted.
        """
        least = 0.5 * self._excess(best.trial)
        promising = self._on_free_run(best)
        if sticks(best.trial):
            limit = (1.0 - PROMISING) * excess(best.trial, self._head)
            promising = [t for t in promising if excess(t.trial, self._head) < limit]
        better = self._better(promising, best)
        close = min(map(_free, better), default=0.0) + STRONG
        better = [t for t in better if _free(t) < close]
        return [t for t in better if self._excess(self.whole.fitted(t.trial)) < least]

    def _on_free_run(self, best: Tried) -> list[Tried]:
        """Return the trials with one effect more that promise most on the free run.

        Where it has long gone astray no first-order step says anything.
        """
        near = self._head.until(astray(best.trial, self._head) + SHORTEST)
        found = screen_free_run(best.trial, self._sheet, near)
        return [self._scored(self._led(s.trial, best)) for s in found[:MOST_SIMULATED]]

    def _led(self, begun: Trial, best: Tried) -> Trial:
        """Return a trial as it was begun on the free run, or as the balances have it, if better.

        To first order play that opens seldom is far too small: it explains nothing until the
        piston crosses it at the right instants.
        """
        if not self._evidence.complete:
            return begun
        start = trial(self._sheet, begun.effects, best.trial)
        balanced = fit_balances(start, self._head, self.floor)
        return min(begun, balanced, key=lambda t: excess(t, self._head))

    def _by_balances(self, found: list[Screened], best: Tried) -> list[Tried]:
        """Fit trials to the balances, those that come close to the best of them to the free run.

        Return what is better. Where none is, the one that is ahead in the free run already.
        """
        known = {frozenset(tried.trial.effects) for tried in self.tried}
        new = []
        for screened in found:
            if frozenset(screened.trial.effects) not in known:
                known.add(frozenset(screened.trial.effects))
                new.append(screened.trial)
        round_ = []
        for trial_ in new[:MOST_FITTED]:
            self._progress(f"balances: {trial_.name}")
            round_.append(self._scored(fit_balances(trial_, self._head, self.floor)))
        least = min((t.balances for t in round_), default=np.inf)
        limit = min(best.balances - STRONG, least + CLOSE)
        close = sorted((t for t in round_ if t.balances <= limit), key=lambda t: t.balances)
        promising = close[:MOST_SIMULATED]
        others = [t for t in round_ if t not in promising]
        better = self._better(promising, best)
        if not better:
            ahead = self._ahead(others, best)
            others = [t for t in others if t not in ahead]
            better = self._better(ahead, best)
        self.tried += others
        return better

    def _ahead(self, others: list[Tried], best: Tried) -> list[Tried]:
        """Return the trial whose free run is best, if it is better than the best so far.

        Though it is fitted to the balances alone: a free run adds up what they hardly know of,
        such as a small leak.
        """
        least, ahead = _free(best) - STRONG, []
        for tried in others:
            score = free_run_score(tried.trial, self._evidence)
            if score < least:
                least, ahead = score, [tried]
        return ahead

    def _better(self, promising: list[Tried], best: Tried) -> list[Tried]:
        """Fit trials to the free run; return those that are better than the best so far."""
        simulated = []
        for tried in promising:
            self._progress(f"free run: {tried.trial.name}")
            simulated.append(self._simulated(tried))
        self.tried += simulated
        better = [t for t in simulated if _free(t) < _free(best) - STRONG]
        better = better or [t for t in simulated if self._suffices(t.trial, best.trial)]
        return better or self._late(simulated, best)

    def _late(self, simulated: list[Tried], best: Tried) -> list[Tried]:
        """Return the trial nearest to the whole recordings, fitted to them, if that suffices.

        What acts in the part held back alone, as play that opens there, no fit has seen. One that
        is no nearer than the best so far is not fitted: that takes long.
        """
        limit = self.whole.score(best.trial) - STRONG
        nearest = min(simulated, key=lambda t: self.whole.score(t.trial), default=None)
        if nearest is None or self.whole.score(nearest.trial) >= limit:
            return []
        fitted = replace(nearest, trial=self.whole.fitted(nearest.trial))
        return [fitted] if self._suffices(fitted.trial, best.trial) else []

    def _simulated(self, tried: Tried) -> Tried:
        """Return a trial fitted to the free run.

        Of several sizes of an effect one alone is taken where the others are not worth their while.
        A load may have ended since. Where all that leads nowhere near, what else is missing drives
        the free run away and the parameters with it: they stay as the balances say, if those are
        all told. Nor do fewer terms of a series lead anywhere then.
        """
        full = fit_free_run(tried.trial, self._head)
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

    def _suffices(self, tried: Trial, best: Trial) -> bool:
        """Tell whether the whole recordings need no more than a trial, and that far more than best.

        For recordings too short for a part held back to tell: nothing may move in it.
        """
        better = self.whole.score(tried) < self.whole.score(best) - STRONG
        return better and not self._enough(best) and self._enough(tried)

    def _enough(self, tried: Trial) -> bool:
        """Tell whether a trial leaves no balance speaking and explains the free run."""
        return self._quiet(tried) and explained(tried, self._evidence)

    def _quiet(self, tried: Trial) -> bool:
        return leaves_quiet(tried, self._evidence)

    def _excess(self, tried: Trial) -> float:
        return excess(tried, self._evidence)

    def _scored(self, tried: Trial, free_run: float | None = None) -> Tried:
        return Tried(tried, balance_score(tried, self._evidence, self.floor), free_run)


def _as_good(better: list[Tried]) -> list[Trial]:
    """Return the best trial and those that are as good.

    Of two of which one is the other without a break-away the one with fewer parameters: it would
    be as good whatever the recordings are.
    """
    equal = rivals([t.trial for t in better], [_free(t) for t in better])
    best = next((less for less in equal[1:] if nested(equal[0], less)), equal[0])
    others = [t for t in equal[1:] if t is not best and t.x.size <= best.x.size]
    return [best, *others]


def _free(tried: Tried) -> float:
    return float("inf") if tried.free_run is None else tried.free_run

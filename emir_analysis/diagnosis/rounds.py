"""One round of a search: which trials with an effect more are better than the best so far."""

import numpy as np

from emir_analysis.diagnosis.balances import level
from emir_analysis.diagnosis.candidate import Screened
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.experiment import SHORTEST
from emir_analysis.diagnosis.fitting import fit_balances, fit_free_run
from emir_analysis.diagnosis.free_run_fits import FreeRunFits
from emir_analysis.diagnosis.friction_laws import sticks
from emir_analysis.diagnosis.late_effects import LateEffects
from emir_analysis.diagnosis.screening import OnBalances, screen_free_run
from emir_analysis.diagnosis.select import (
    EXPLAINED,
    HOPELESS,
    LEFT,
    MOST,
    PROMISING,
    SEEN,
    STRONG,
    astray,
    at_noise,
    balance_score,
    beyond,
    excess,
    free_run_score,
    leaves_quiet,
)
from emir_analysis.diagnosis.side_by_side import side_by_side
from emir_analysis.diagnosis.trial import Trial, trial
from emir_analysis.diagnosis.tried import Tried, free
from emir_analysis.diagnosis.whole import Progress, Whole
from emir_analysis.signals import Array
from emir_plant.effects import REGISTRY
from emir_plant.sheet import Sheet

MOST_FITTED = 4  # effects that are fitted to the balances with all parameters
MOST_BESIDE = 2  # effects beside which a second one is looked for on the balances
MOST_SIMULATED = 3  # trials of a round that go on from the balances to the free run
CLOSE = 5.0 * STRONG  # of the best score on the balances, within which the free run decides


class Rounds:
    """What is tried beside a trial: fitted to the balances, what comes close to the free run.

    tried: all trials.
    """

    def __init__(
        self, evidence: Evidence, sheet: Sheet, floor: Array, whole: Whole, progress: Progress
    ) -> None:
        self._evidence, self._sheet, self._floor = evidence, sheet, floor
        self._whole, self._progress = whole, progress
        self._fits = FreeRunFits(evidence, floor, progress)
        self._late = LateEffects(evidence, sheet, whole, self.scored, progress)
        self._head = evidence.head(SEEN)
        self.tried: list[Tried] = []
        self._asked: set[frozenset[str]] = set()  # effects beside which another was looked for
        self._beside_none: OnBalances | None = None
        self._next: dict[frozenset[str], tuple[Tried, list[Trial]]] = {}  # left, by effects beside

    def beside(self, best: Tried) -> list[Tried]:
        """Return what is better with one effect more.

        Where all that the fits see is explained, what acts later is asked for first.
        """
        self._asked.add(frozenset(best.trial.effects))
        if at_noise(best.trial, self._head):
            return self._kept(self._late.in_held_back(best)) or self._one_more(best)
        return self._one_more(best) or self._kept(self._late.beside(best, self.tried))

    def _one_more(self, best: Tried) -> list[Tried]:
        """Return what is better with one effect more on what the fits see.

        Where missing sensors leave balances out, what those would show is in the free run alone:
        that is asked too where the others do not explain it, and where they are quiet: what acts
        in a few windows only, or hardly more than their noise, does not tell there which it is.
        """
        better = []
        if np.any(self._evidence.fitted):
            found = self._on_balances(best.trial).singles
            better = self._by_balances(found, best)
            near = any(self._excess(t.trial) < beyond(EXPLAINED) for t in better)
            told = near or self._evidence.complete
            if told and not self._quiet(best.trial):
                return better
        known = [t.trial.effects for t in better]
        others = [t for t in self._on_free_run(best) if t.trial.effects not in known]
        return better + self._better(others, best)

    def exchanged(self, full: Trial) -> list[Tried]:
        """Return what is better on the whole with another effect in place of one of several.

        What came first may stand for another, which shows once what came later is known
        (floating search, Pudil et al. 1994). At the noise, a series alone. full: fitted to the
        whole.
        """
        least = self.scored(full).balances - STRONG if self._evidence.complete else np.inf
        found: list[Tried] = []
        spent = at_noise(full, self._evidence)
        for effect in full.effects:
            fewer = full.without(effect)
            stays = spent and not REGISTRY[effect].is_series
            if not stays and frozenset(fewer.effects) not in self._asked:
                self._progress(f"all effects in place of: {effect}")
                self._asked.add(frozenset(fewer.effects))
                found += self._in_its_place(fewer, least)
        limit = self._whole.score(full) - STRONG
        return [t for t in found if self._whole.score(self._whole.fitted(t.trial)) < limit]

    def _in_its_place(self, fewer: Trial, least: float) -> list[Tried]:
        """Return trials with one effect more, fitted to the free run.

        least: score on the balances, where all are told, below which that is worthwhile.
        """
        if not self._evidence.complete:
            known = fit_free_run(fewer, self._head)
            return self.beside(self.scored(known, free_run_score(known, self._evidence)))
        known = fit_balances(fewer, self._head, self._floor)
        begun = self._fitted_to_balances(self._on_balances(known).singles)
        close = sorted((t for t in begun if t.balances < least), key=lambda t: t.balances)
        promising = close[:MOST_SIMULATED]
        found = side_by_side(self._fits.fitted, promising)
        self.tried += found + [t for t in begun if t not in promising]
        return found

    def ask_further(self, best: Trial) -> None:
        """Fit what was next to a series of a trial on the free run, as many as were fitted there.

        A series has terms enough to stand for what comes close. What got no further than the
        balances as well; where they are all told, what is close to the trial there.
        """
        limit = self.scored(best).balances + CLOSE if self._evidence.complete else np.inf
        for effect in best.effects:
            others = frozenset(best.effects) - {effect}
            if REGISTRY[effect].is_series and others in self._next:
                beside, begun = self._next.pop(others)
                known = {frozenset(tried.trial.effects) for tried in self.tried}
                new = [t for t in begun if frozenset(t.effects) not in known]
                self.tried += side_by_side(self._fits.fitted, self._all_led(new, beside))
            promising = self._no_further(others, limit)
            self.tried += side_by_side(self._fits.fitted, promising)

    def further(self, known: Tried) -> list[Tried]:
        """Return what is better with one effect more of what got no further than the balances.

        Where sensors are missing, those that are left do not tell all that the free run knows.
        """
        return self._better(self._no_further(frozenset(known.trial.effects)), known)

    def _no_further(self, effects: frozenset[str], limit: float = np.inf) -> list[Tried]:
        """Take out the trials with one effect more that got no further than the balances.

        limit: of their score there.
        """
        simulated = {frozenset(t.trial.effects) for t in self.tried if t.free_run is not None}
        left = [t for t in self.tried if frozenset(t.trial.effects) not in simulated]
        more = [t for t in left if effects < set(t.trial.effects)]
        alike = [t for t in more if len(t.trial.effects) == len(effects) + 1]
        close = (t for t in alike if t.balances <= limit)
        taken = sorted(close, key=lambda t: t.balances)[:MOST_SIMULATED]
        self.tried = [t for t in self.tried if t not in taken]
        return taken

    def beside_enough(self, best: Tried) -> list[Tried]:
        """Return the same beside a trial that is good enough: what takes away most of the rest.

        The balances are quiet then; the free run alone may know more. Beside what sticks, where a
        fit takes longest, only what takes a part away before it is fitted.
        """
        least = MOST * self._excess(best.trial)
        promising = self._on_free_run(best)
        if sticks(best.trial):
            limit = (1.0 - PROMISING) * excess(best.trial, self._head)
            promising = [t for t in promising if excess(t.trial, self._head) < limit]
        simulated = side_by_side(self._fits.fitted, promising)
        self.tried += simulated
        better = [t for t in simulated if free(t) < free(best) - STRONG]
        better = better or self._down_to_noise(simulated, best)
        close = min(map(free, better), default=0.0) + STRONG
        better = [t for t in better if free(t) < close]
        return [t for t in better if self._excess(self._whole.fitted(t.trial)) < least]

    def _down_to_noise(self, simulated: list[Tried], best: Tried) -> list[Tried]:
        """Return the trial nearest to the whole recordings that leaves nothing, fitted to them.

        Of those that the part held back prefers, if not clearly: the other two thirds may know more
        of an effect.
        """
        limit = self._whole.score(best.trial) - STRONG
        ahead = [t for t in simulated if free(t) < free(best)]
        nearest = sorted(ahead, key=lambda t: self._whole.score(t.trial))[:1]
        near = [t for t in nearest if self._whole.score(t.trial) < limit]
        return [t for t in near if self._excess(self._whole.fitted(t.trial)) <= beyond(LEFT)]

    def beside_explained(self, known: Trial) -> list[Tried]:
        """Return what takes a trial to the noise that explains the whole but leaves a little.

        known: fitted to the whole.
        """
        return self._kept(self._late.beside_explained(known))

    def quiet_pairs(self, plain: Tried, best: Tried) -> list[Tried]:
        """Return what is better than the best so far of two effects that leave no balance speaking.

        Beside parameters alone. An effect that leaves much stands for others, and leads those
        astray that are looked for beside it. Pairs that are no better may be so from there.
        """
        pairs = self._fitted_to_balances(self._on_balances(plain.trial).pairs)
        quiet = [pair for pair in pairs if self._quiet(pair.trial)]
        before = list(self.tried)
        better = self._better_on_balances(quiet, best) if quiet else []
        if not better:
            self.tried = before
        return better

    def pairs(self, plain: Tried, best: Tried) -> list[Tried]:
        """Return what is better than the best so far with two effects beside parameters alone.

        All to first order, and all beside the effects that say most to the balances: the free run
        may be none the better for one while another effect drives it away.
        """
        found = list(self._on_balances(plain.trial).pairs)
        singles = [t for t in self.tried if len(t.trial.effects) == 1]
        for first in sorted(singles, key=lambda t: t.balances)[:MOST_BESIDE]:
            if first.trial.effects != best.trial.effects:
                told = fit_balances(first.trial, self._head, self._floor)
                found += self._on_balances(told).singles
        return self._by_balances(sorted(found, key=lambda s: s.cost), best)

    def triples(self, best: Tried) -> list[Tried]:
        """Return what is better than the best so far with an effect more than the best pair.

        That on the balances, if it is clearly better there than one effect and leaves little: of
        three that are all needed no two need bring the free run any nearer.
        """
        single, pair = self._least(1), self._least(2)
        if single is None or pair is None or pair.balances > single.balances - STRONG:
            return []
        told = fit_balances(pair.trial, self._head, self._floor)
        if np.nanmax(level(self._head.residuals([told.machine])[0]) / self._floor) > HOPELESS:
            return []
        self._progress(f"all effects beside: {told.name}")
        return self._by_balances(self._on_balances(told).singles, best)

    def _least(self, effects: int) -> Tried | None:
        """Return the trial with so many effects that leaves least in the balances."""
        alike = [t for t in self.tried if len(t.trial.effects) == effects]
        return min(alike, key=lambda t: t.balances, default=None)

    def scored(self, tried: Trial, free_run: float | None = None) -> Tried:
        """Return a trial with its scores; free_run: if it is known."""
        return Tried(tried, balance_score(tried, self._evidence, self._floor), free_run)

    def _kept(self, found: list[Tried]) -> list[Tried]:
        self.tried += found
        return found

    def _on_balances(self, known: Trial) -> OnBalances:
        """Return each effect begun beside a trial; beside none they are asked for twice."""
        if not known.effects and self._beside_none is not None:
            return self._beside_none
        begun = OnBalances(known, self._sheet, self._head, self._floor)
        if not known.effects:
            self._beside_none = begun
        return begun

    def _on_free_run(self, best: Tried) -> list[Tried]:
        """Return the trials with one effect more that promise most on the free run.

        Where it has long gone astray no first-order step says anything. Begun from the parameters
        as they are and as a beginning has them, which may have taken an effect's place.
        """
        near = self._head.until(astray(best.trial, self._head) + SHORTEST)
        bases = dict.fromkeys((best.trial, self._nearer(best.trial, near)))
        each = [s for base in bases for s in screen_free_run(base, self._sheet, near)]
        found: dict[tuple[str, ...], Trial] = {}
        for screened in sorted(each, key=lambda s: s.cost):
            found.setdefault(screened.trial.effects, screened.trial)
        begun = list(found.values())[: 2 * MOST_SIMULATED]
        self._next[frozenset(best.trial.effects)] = best, begun[MOST_SIMULATED:]
        return self._all_led(begun[:MOST_SIMULATED], best)

    def _nearer(self, known: Trial, near: Evidence) -> Trial:
        """Return a trial with its parameters as a beginning has them.

        Where sensors are missing, the balances leave them open, and what an effect would add to
        first order far from the machine says nothing. What sticks would take long.
        """
        if self._evidence.complete or sticks(known):
            return known
        return fit_free_run(known, near)

    def _all_led(self, begun: list[Trial], best: Tried) -> list[Tried]:
        return side_by_side(lambda each: self.scored(self._led(each, best)), begun)

    def _led(self, begun: Trial, best: Tried) -> Trial:
        """Return a trial as it was begun on the free run, or as the balances have it, if better.

        To first order play that opens seldom is far too small: it explains nothing until the
        piston crosses it at the right instants.
        """
        if not self._evidence.complete:
            return begun
        start = trial(self._sheet, begun.effects, best.trial).formed(begun.form)
        balanced = fit_balances(start, self._head, self._floor)
        return min(begun, balanced, key=lambda t: excess(t, self._head))

    def _by_balances(self, found: list[Screened], best: Tried) -> list[Tried]:
        """Fit trials to the balances and return what is better; see `_better_on_balances`."""
        return self._better_on_balances(self._fitted_to_balances(found), best)

    def _fitted_to_balances(self, found: list[Screened]) -> list[Tried]:
        """Return the first trials that were not tried yet, fitted to the balances."""
        known = {frozenset(tried.trial.effects) for tried in self.tried}
        new = []
        for screened in found:
            if frozenset(screened.trial.effects) not in known:
                known.add(frozenset(screened.trial.effects))
                new.append(screened.trial)
        return side_by_side(self._on_its_balances, new[:MOST_FITTED])

    def _better_on_balances(self, round_: list[Tried], best: Tried) -> list[Tried]:
        """Fit trials that come close to the best of a round on the balances to the free run.

        Return what is better. Where none is, the one that is ahead in the free run already.
        """
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

    def _on_its_balances(self, begun: Trial) -> Tried:
        self._progress(f"balances: {begun.name}")
        return self.scored(fit_balances(begun, self._head, self._floor))

    def _ahead(self, others: list[Tried], best: Tried) -> list[Tried]:
        """Return the trial whose free run is best, if it is better than the best so far.

        Though it is fitted to the balances alone: a free run adds up what they hardly know of,
        such as a small leak.
        """
        least, ahead = free(best) - STRONG, []
        for tried in others:
            score = free_run_score(tried.trial, self._evidence)
            if score < least:
                least, ahead = score, [tried]
        return ahead

    def _better(self, promising: list[Tried], best: Tried) -> list[Tried]:
        """Fit trials to the free run; return those that are better than the best so far."""
        simulated = side_by_side(self._fits.fitted, promising)
        self.tried += simulated
        better = [t for t in simulated if free(t) < free(best) - STRONG]
        better = better or [t for t in simulated if self._late.suffices(t.trial, best.trial)]
        return better or self._late.nearest(simulated, best)

    def _quiet(self, tried: Trial) -> bool:
        return leaves_quiet(tried, self._evidence)

    def _excess(self, tried: Trial) -> float:
        return excess(tried, self._evidence)

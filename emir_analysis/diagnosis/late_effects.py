"""What acts in the part of recordings held back from the fits, and hardly before."""

from collections.abc import Callable, Iterator
from dataclasses import replace

from emir_analysis.diagnosis.balances import FORCE
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.experiment import SHORTEST
from emir_analysis.diagnosis.foresight import is_enough
from emir_analysis.diagnosis.friction_laws import sticks
from emir_analysis.diagnosis.loads import LOAD
from emir_analysis.diagnosis.screening import screen_faint_load, screen_free_run
from emir_analysis.diagnosis.select import (
    AT_NOISE,
    EXPLAINED,
    MOST,
    PROMISING,
    SEEN,
    STRONG,
    astray,
    at_noise,
    beyond,
    excess,
    free_run_score,
)
from emir_analysis.diagnosis.trial import Trial
from emir_analysis.diagnosis.tried import Tried
from emir_analysis.diagnosis.whole import Progress, Whole
from emir_plant.sheet import Sheet

MOST_FITTED = 3  # effects more that are fitted to the whole


class LateEffects:
    """Trials with one effect more that the whole recordings tell and the part fits see does not.

    scored: gives a trial with its scores, the second one known.
    """

    def __init__(
        self,
        evidence: Evidence,
        sheet: Sheet,
        whole: Whole,
        scored: Callable[[Trial, float], Tried],
        progress: Progress,
    ) -> None:
        self._evidence, self._sheet, self._whole = evidence, sheet, whole
        self._scored, self._progress = scored, progress
        self._head = evidence.head(SEEN)

    def beside_explained(self, known: Trial) -> list[Tried]:
        """Return what takes a trial to the noise that explains the whole but leaves a little.

        What acts in the part held back, and hardly before, only the whole knows: the part that the
        fits see is at the noise without. known: fitted to the whole.
        """
        if at_noise(known, self._evidence) or not is_enough(known, self._evidence):
            return []
        self._progress(f"all effects in the whole recording beside: {known.name}")
        least = self._whole.score(known) - STRONG
        limit = MOST * excess(known, self._evidence)
        return [
            self._scored(fitted, free_run_score(fitted, self._evidence))
            for fitted in self._promising(known, self._evidence, limit)
            if self._whole.score(fitted) < least
            and at_noise(fitted, self._evidence)
            and is_enough(fitted, self._evidence)
        ]

    def beside(self, best: Tried, tried: list[Tried]) -> list[Tried]:
        """Return what suffices with an effect that acts in the part held back alone.

        Beside the best so far, or beside what explains with one effect more all that the fits see,
        of all that was tried.
        """
        late = self.in_held_back(best)
        if late:
            return late
        more = [t for t in tried if set(t.trial.effects) > set(best.trial.effects)]
        told = [t for t in more if t.free_run is not None and at_noise(t.trial, self._head)]
        nearest = min(told, key=lambda t: excess(t.trial, self._head), default=None)
        return [] if nearest is None else self.in_held_back(nearest)

    def in_held_back(self, best: Tried) -> list[Tried]:
        """Return what suffices with one effect more that acts in the part held back alone.

        The part that the fits see is explained without, so that nothing there asks for it. Where
        it sticks that part has to be at the noise: else it is the law that is off.
        """
        most = AT_NOISE if sticks(best.trial) else EXPLAINED
        if excess(best.trial, self._head) > beyond(most) or is_enough(best.trial, self._evidence):
            return []
        near = self._evidence.until(astray(best.trial, self._evidence) + SHORTEST)
        limit = (1.0 - PROMISING) * excess(best.trial, near)
        return [
            self._scored(fitted, free_run_score(fitted, self._evidence))
            for fitted in self._promising(best.trial, near, limit)
            if self.suffices(fitted, best.trial)
        ]

    def suffices(self, tried: Trial, best: Trial) -> bool:
        """Tell whether the whole recordings need no more than a trial, and that far more than best.

        For recordings too short for a part held back to tell: nothing may move in it.
        """
        better = self._whole.score(tried) < self._whole.score(best) - STRONG
        return better and not is_enough(best, self._evidence) and is_enough(tried, self._evidence)

    def nearest(self, simulated: list[Tried], best: Tried) -> list[Tried]:
        """Return the trial nearest to the whole recordings, fitted to them, if that suffices.

        What acts in the part held back alone, as play that opens there, no fit has seen. One that
        is no nearer than the best so far is not fitted: that takes long.
        """
        limit = self._whole.score(best.trial) - STRONG
        nearest = min(simulated, key=lambda t: self._whole.score(t.trial), default=None)
        if nearest is None or self._whole.score(nearest.trial) >= limit:
            return []
        fitted = replace(nearest, trial=self._whole.fitted(nearest.trial))
        return [fitted] if self.suffices(fitted.trial, best.trial) else []

    def _promising(self, known: Trial, evidence: Evidence, limit: float) -> Iterator[Trial]:
        """Yield trials with one effect more that leave less than a limit, fitted to the whole.

        evidence: in whose free run they are looked for. Once one suffices, only those are fitted
        that are at the noise there as they are begun. A faint load is asked about where none is.
        """
        told = explains = False
        for screened in screen_free_run(known, self._sheet, evidence)[:MOST_FITTED]:
            most = beyond(AT_NOISE) if told else limit
            if excess(screened.trial, evidence) < most:
                fitted = self._whole.fitted_from(screened.trial)
                yield fitted
                told = told or is_enough(fitted, self._evidence)
                explains = explains or at_noise(fitted, self._evidence)
        if self._evidence.told[FORCE] and not explains and LOAD not in known.effects:
            loaded = screen_faint_load(known, self._sheet, evidence).trial
            if excess(loaded, evidence) < limit:
                yield self._whole.fitted_from(loaded)

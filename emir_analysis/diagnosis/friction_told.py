"""The friction that a growing beginning tells, in place of what drives trials that stick away."""

from dataclasses import replace

from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.friction_beginning import begun, with_less_friction
from emir_analysis.diagnosis.friction_laws import fullest
from emir_analysis.diagnosis.rounds import Rounds
from emir_analysis.diagnosis.select import LEFT, STRONG, at_noise, beyond, excess, free_run_score
from emir_analysis.diagnosis.stick_slip import OFF
from emir_analysis.diagnosis.trial import Trial
from emir_analysis.diagnosis.tried import Tried
from emir_analysis.diagnosis.whole import Progress, Whole
from emir_analysis.signals import Array
from emir_plant.sheet import Sheet


class FrictionTold:
    """Friction by a growing beginning, each law asked for once.

    settled: effects that are thereby known to be needed.
    """

    def __init__(  # noqa: PLR0913, PLR0917 (what is asked, of what)
        self,
        evidence: Evidence,
        sheet: Sheet,
        floor: Array,
        whole: Whole,
        rounds: Rounds,
        progress: Progress,
    ) -> None:
        self._evidence, self._sheet, self._floor = evidence, sheet, floor
        self._whole, self._rounds, self._progress = whole, rounds, progress
        self._begun: set[tuple[str, ...]] = set()  # laws that a beginning has told
        self.settled: tuple[str, ...] = ()

    def told(self, equal: list[Trial], best: Tried, most: float = OFF) -> tuple[list[Trial], Tried]:
        """Return the best trials, one that sticks, with the friction that a beginning tells.

        The same where they leave nothing, where more than most is left over that beginning, in
        units of the noise, or where that is no better on the whole.
        """
        if excess(best.trial, self._evidence) <= beyond(LEFT):
            return equal, best
        led = self._whole.led(best.trial)
        if led is not None:
            self._whole.keep(led)
            return equal, replace(best, trial=led)
        found = self._with_friction(best.trial, most)
        if found is None or self._whole.score(found) > self._whole.score(best.trial) - STRONG:
            return equal, best
        self._whole.keep(found)
        self.settled = tuple(n for n in found.effects if n.endswith("_friction"))
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
        law = begun(start, self._evidence, self._floor, most)
        if law is None:
            return None
        law, *fuller = with_less_friction(law, self._evidence, self._sheet, self._floor)
        if set(law.effects) == set(known.effects) and at_noise(known, self._evidence):
            return self._whole.at_noise(fuller)  # a break-away may show in later sticks only
        return self._whole.with_friction(law, fuller, known)

"""A trial and how it did."""

from dataclasses import dataclass

from emir_analysis.diagnosis.friction_laws import nested
from emir_analysis.diagnosis.select import rivals
from emir_analysis.diagnosis.trial import Trial


@dataclass(frozen=True)
class Tried:
    """A trial and its scores on the balances and on the unseen free run; smaller is better.

    free_run: None where the balances already spoke against it.
    """

    trial: Trial
    balances: float
    free_run: float | None = None


def free(tried: Tried) -> float:
    """Return the score on the unseen free run, infinite where there is none."""
    return float("inf") if tried.free_run is None else tried.free_run


def as_good(better: list[Tried]) -> list[Trial]:
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

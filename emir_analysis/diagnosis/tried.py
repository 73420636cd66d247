"""A trial and how it did."""

from dataclasses import dataclass

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

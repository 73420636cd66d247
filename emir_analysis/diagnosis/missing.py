"""What trials leave of recordings, in units of the noise: of their balances, of their free run."""

from collections.abc import Callable

from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.run_errors import coarse_errors, settled
from emir_analysis.diagnosis.trial import Trial
from emir_analysis.signals import Array

Missing = Callable[[list[Trial]], Array]  # (m, n), in units of the noise


def in_balances(evidence: Evidence, floor: Array) -> Missing:
    """Return what trials leave in the balances, in units of a floor, (5,)."""

    def missing(trials: list[Trial]) -> Array:
        return evidence.in_noise(evidence.residuals([t.machine for t in trials]), floor)

    return missing


def in_free_run(known: Trial, evidence: Evidence) -> Missing:
    """Return what trials leave in the coarse free run, from where a known one is at rest."""
    rest = [settled(known.machine, e, evidence) for e in evidence.experiments]

    def missing(trials: list[Trial]) -> Array:
        return coarse_errors([t.machine for t in trials], evidence, rest)

    return missing

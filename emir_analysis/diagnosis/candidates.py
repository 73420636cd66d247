"""What was tried: each set of effects once, the nearest first."""

import math
from dataclasses import dataclass

from emir_analysis.diagnosis.diagnose import Findings
from emir_analysis.diagnosis.run_errors import mean_square
from emir_analysis.diagnosis.select import free_run_score
from emir_analysis.diagnosis.trial import Trial
from emir_common.parameter_tree import declared
from emir_plant.effects import REGISTRY


@dataclass(frozen=True)
class Size:
    """How large an effect is; unit: SI."""

    value: float
    unit: str


@dataclass(frozen=True)
class CandidateResult:
    """A set of effects that was tried.

    score: how much better than parameters only on the balances, free_run: the same of the unseen
    part's free run where it was fitted; above 10 is strong evidence. left: RMS error of the free
    run of the whole recordings, times the noise, where it was fitted. sizes: of the effects, by
    effect and parameter, those that are not 0.
    """

    name: str
    score: float
    free_run: float | None
    left: float | None
    sizes: dict[str, Size]


def candidates(findings: Findings) -> tuple[CandidateResult, ...]:
    """Return the sets of effects, each as it came nearest.

    What was fitted to the whole in the end counts as that. Nearest is what explains the free run of
    the whole best by its criterion, behind all that were simulated what explains the balances best.
    """
    plain, *others = findings.tried
    ended = findings.chosen if findings.rejected is None else findings.rejected
    nearest: dict[frozenset[str], tuple[float, CandidateResult]] = {}
    for tried in others:
        fitted, free_run, left, distance = tried.trial, None, None, math.inf
        effects = frozenset(fitted.effects)
        if tried.free_run is not None:
            fitted = ended if effects == frozenset(ended.effects) else fitted
            left = math.sqrt(mean_square(fitted, findings.evidence))
            distance = free_run_score(fitted, findings.evidence, seen=0.0)
            free_run = None if plain.free_run is None else float(plain.free_run - tried.free_run)
        score = float(plain.balances - tried.balances)
        candidate = CandidateResult(fitted.name, score, free_run, left, _sizes(fitted))
        found = distance, candidate
        nearest[effects] = min(found, nearest.get(effects, found), key=_rank)
    return tuple(candidate for _, candidate in sorted(nearest.values(), key=_rank))


def _rank(found: tuple[float, CandidateResult]) -> tuple[float, float]:
    distance, candidate = found
    return distance, -candidate.score


def _sizes(fitted: Trial) -> dict[str, Size]:
    values = declared(fitted.machine)
    names = [f"{effect}.{size}" for effect in fitted.effects for size in REGISTRY[effect].sizes]
    told = {name: values[f"effects.{name}"] for name in names}
    return {name: Size(value, about.unit) for name, (about, value) in told.items() if value}

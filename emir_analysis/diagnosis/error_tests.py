"""How sure the errors on the judge recordings are, and what they still know."""

from dataclasses import dataclass

import numpy as np

from emir_analysis.diagnosis.experiment import OUTPUTS, Experiment
from emir_analysis.diagnosis.judged import Judged
from emir_analysis.diagnosis.statistics import (
    Interval,
    input_correlation,
    rms_intervals,
    whiteness,
)
from emir_analysis.signals import Array


@dataclass(frozen=True)
class ErrorTests:
    """How sure a signal's free-run error is and what it still knows, by stage.

    intervals: of the RMS, 95 %, by block bootstrap. input_correlation: largest correlation of
    the free run's error with the command. whiteness: Ljung-Box statistic of the one-step error
    over its 95 % value; below 1 it is white. Of several recordings the largest counts.
    """

    intervals: dict[str, Interval]
    input_correlation: dict[str, float]
    whiteness: dict[str, float]


def error_tests(judged: Judged, slow_period: float) -> dict[str, ErrorTests]:
    """Return the tests of each signal that sensors show. slow_period: s, of the slow mode."""
    experiments = judged.evidence.experiments
    commands = [_commands(experiment) for experiment in experiments]
    periods = [experiment.period for experiment in experiments]
    errors = {stage: judged.errors(stage) for stage in judged.runs}
    intervals = {stage: rms_intervals(parts, periods) for stage, parts in errors.items()}

    def correlation(stage: str, k: int) -> float:
        parts = zip(errors[stage], commands, periods, strict=True)
        return max(input_correlation(e[:, k], u, period, slow_period) for e, u, period in parts)

    def colour(stage: str, k: int) -> float:
        parts = zip(judged.one_step[stage], periods, strict=True)
        return max(whiteness(e[:, k], period, slow_period) for e, period in parts)

    return {
        name: ErrorTests(
            {stage: found[k] for stage, found in intervals.items()},
            {stage: correlation(stage, k) for stage in errors},
            {stage: colour(stage, k) for stage in errors},
        )
        for k, name in enumerate(OUTPUTS)
        if judged.evidence.shown[k]
    }


def _commands(experiment: Experiment) -> Array:
    """Return the command at each sample, (n,)."""
    return np.append(experiment.commands, experiment.commands[-1])[:: experiment.every]

"""The result of a diagnosis as values, as JSON and as lines of text."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from emir_analysis.diagnosis.balances import BALANCES
from emir_analysis.diagnosis.diagnose import Findings
from emir_analysis.diagnosis.experiment import OUTPUTS, Experiment, noise
from emir_analysis.diagnosis.free_run import block_medians, errors, rms
from emir_analysis.diagnosis.shape import Shape
from emir_analysis.errors import InputError
from emir_analysis.signals import Array
from emir_plant.effects import REGISTRY

TOLD = 0.5  # share of the variance from which on a signal is said to predict a residual
INTERVAL = 2.0  # standard deviations on either side of a parameter's low and high


@dataclass(frozen=True)
class ParameterResult:
    """A fitted parameter; low, high: two standard deviations from the curvature of the fit."""

    value: float
    unit: str
    low: float
    high: float


@dataclass(frozen=True)
class EffectResult:
    """An effect that the machine has, with its parameters by name."""

    name: str
    balance: str
    parameters: dict[str, ParameterResult]


@dataclass(frozen=True)
class CandidateResult:
    """What was tried.

    score: how much better than parameters only on the unseen part's balances, free_run: the same
    of the free run where it was simulated; above 10 is strong evidence.
    """

    name: str
    score: float
    free_run: float | None


@dataclass(frozen=True)
class BalanceResult:
    """RMS over the windows; noise: the part that the sensors alone make."""

    unit: str
    noise: float
    before: float
    refitted: float
    after: float


@dataclass(frozen=True)
class SignalResult:
    """RMS error of the free run; with_effect equals refitted where no effect is named."""

    unit: str
    noise: float
    nominal: float
    refitted: float
    with_effect: float


@dataclass(frozen=True)
class Diagnosis:
    """What a recording's machine lacks in the model, and the error before and after.

    verdict: nothing_missing, found, ambiguous, unexplained; statement: the same in words.
    signals: over the whole judge recording; block_medians: medians over its 15 s blocks.
    parameters: the re-fitted tolerances of the final machine. shape: of what stays unexplained.
    """

    verdict: str
    statement: str
    effects: tuple[EffectResult, ...]
    candidates: tuple[CandidateResult, ...]
    balances: dict[str, BalanceResult]
    signals: dict[str, SignalResult]
    block_medians: dict[str, SignalResult]
    parameters: dict[str, ParameterResult]
    shape: Shape | None
    recording: str
    judged_on: str


def diagnosis(findings: Findings, judge: Experiment) -> Diagnosis:
    """Put the findings into numbers, judged on a recording that no fit has seen."""
    machines = [findings.sheet.machine, findings.refitted.machine, findings.chosen.machine]
    found = [errors(machine, judge) for machine in machines]
    return Diagnosis(
        verdict=findings.verdict,
        statement=_statement(findings),
        effects=_effects(findings),
        candidates=_candidates(findings),
        balances=_balances(findings),
        signals=_signals(findings, [rms(error) for error in found]),
        block_medians=_signals(findings, [block_medians(e, judge.period) for e in found]),
        parameters={
            path: parameter
            for path, parameter in _parameters(findings.chosen).items()
            if path in findings.sheet.tolerances
        },
        shape=findings.shape,
        recording=findings.experiment.name,
        judged_on=judge.name,
    )


def write_json(path: Path, result: Diagnosis) -> None:
    """Write the result as JSON, numbers that do not exist as null.

    Raises InputError when the file cannot be written.
    """
    try:
        path.write_text(json.dumps(_plain(asdict(result)), indent=2) + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from None


def summary(result: Diagnosis) -> str:
    """Return the result as lines for a terminal."""
    lines = [f"{result.verdict}: {result.statement}", ""]
    lines.append(f"{'balance':24}{'noise':>11}{'before':>11}{'refitted':>11}{'after':>11}")
    for name, b in result.balances.items():
        figures = (b.noise, b.before, b.refitted, b.after)
        lines.append(f"{name:24}" + "".join(f"{f:11.3g}" for f in figures) + f"  {b.unit}")
    lines += ["", f"free-run error on {result.judged_on}, times the sensor noise"]
    lines.append(f"{'signal':24}{'noise':>11}{'nominal':>11}{'refitted':>11}{'with effect':>13}")
    for name, s in result.signals.items():
        lines.append(f"{name:24}{s.noise:11.3g}" + _ratios(s) + f"  RMS, noise in {s.unit}")
        lines.append(f"{'':35}" + _ratios(result.block_medians[name]) + "  median of 15 s blocks")
    return "\n".join(lines)


def _ratios(s: SignalResult) -> str:
    return f"{s.nominal / s.noise:11.2f}{s.refitted / s.noise:11.2f}{s.with_effect / s.noise:13.2f}"


def _statement(findings: Findings) -> str:
    names = " and ".join(findings.chosen.effects)
    speaking, shape = findings.speaking, findings.shape
    if findings.verdict == "nothing_missing":
        return "parameters inside the tolerances bring every balance and the free run to the noise"
    remainder = ""
    if speaking is not None and shape is not None:
        column = list(BALANCES).index(speaking)
        size = rms(findings.residuals["after"])[column]
        noise_share = size / findings.floor[column]
        remainder = (
            f"the balance {speaking} keeps {size:.3g} {BALANCES[speaking]}"
            f" ({noise_share:.1f} times its noise); {_described(shape)}"
        )
    if findings.verdict == "unexplained":
        rejected = " and ".join(findings.rejected)
        known = f"{rejected} comes closest but leaves too much; " if rejected else ""
        return known + (remainder or "the balances are quiet, but the free run drifts away")
    if findings.verdict == "ambiguous":
        names += " or " + " or ".join(rival.name for rival in findings.rivals)
        names += ", which this recording cannot tell apart"
    return names + (f"; {remainder}" if remainder else "")


def _described(shape: Shape) -> str:
    if shape.share < TOLD:
        return "no single signal predicts it"
    direction = " and the direction of motion" if shape.by_direction else ""
    return f"{shape.predictor}{direction} predicts {100 * shape.share:.0f} % of it"


def _parameters(trial: Any) -> dict[str, ParameterResult]:
    result = {}
    for unknown, x, spread in zip(trial.unknowns.members, trial.x, trial.spread, strict=True):
        low, high = unknown.deviation(float(x), INTERVAL * float(spread))
        result[unknown.path] = ParameterResult(unknown.value(float(x)), unknown.unit, low, high)
    return result


def _effects(findings: Findings) -> tuple[EffectResult, ...]:
    fitted = _parameters(findings.chosen)
    return tuple(
        EffectResult(
            name,
            REGISTRY[name].balance,
            {
                path.rsplit(".", 1)[1]: parameter
                for path, parameter in fitted.items()
                if path.startswith(f"effects.{name}.")
            },
        )
        for name in findings.chosen.effects
    )


def _candidates(findings: Findings) -> tuple[CandidateResult, ...]:
    plain = findings.tried[0]
    return tuple(
        CandidateResult(
            tried.trial.name,
            float(plain.balances - tried.balances),
            None
            if tried.free_run is None or plain.free_run is None
            else float(plain.free_run - tried.free_run),
        )
        for tried in findings.tried[1:]
    )


def _balances(findings: Findings) -> dict[str, BalanceResult]:
    figures = [rms(findings.residuals[stage]) for stage in ("before", "refitted", "after")]
    return {
        name: BalanceResult(unit, float(findings.floor[k]), *(float(f[k]) for f in figures))
        for k, (name, unit) in enumerate(BALANCES.items())
    }


def _signals(findings: Findings, figures: list[Array]) -> dict[str, SignalResult]:
    sensors = noise(findings.sheet.machine)
    return {
        name: SignalResult(unit, float(sensors[k]), *(float(f[k]) for f in figures))
        for k, (name, unit) in enumerate(OUTPUTS.items())
    }


def _plain(value: Any) -> Any:
    """Return the value as JSON can hold it: NaN is null there."""
    if isinstance(value, dict):
        return {key: _plain(member) for key, member in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(member) for member in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value

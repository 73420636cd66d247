"""The result of a diagnosis as values, and as JSON."""

import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from emir_analysis.diagnosis.balances import BALANCES, level
from emir_analysis.diagnosis.candidates import CandidateResult, candidates
from emir_analysis.diagnosis.control import ControlResult
from emir_analysis.diagnosis.curves import Curve
from emir_analysis.diagnosis.diagnose import Findings
from emir_analysis.diagnosis.drift import Drift
from emir_analysis.diagnosis.error_tests import ErrorTests, error_tests
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.experiment import OUTPUTS
from emir_analysis.diagnosis.free_run import block_medians
from emir_analysis.diagnosis.friction_laws import sticks
from emir_analysis.diagnosis.judged import BLACK_BOX, STAGES, Judged
from emir_analysis.diagnosis.load_course import SHARE, has_course, sizes
from emir_analysis.diagnosis.loads import LOAD
from emir_analysis.diagnosis.shape import Shape
from emir_analysis.diagnosis.statement import at_end, statement, tell_apart, verdict
from emir_analysis.diagnosis.statistics import BOOTSTRAP_BLOCK, PERIODS
from emir_analysis.diagnosis.swing import Swing
from emir_analysis.diagnosis.telling import between_steps, untold
from emir_analysis.diagnosis.trial import Trial
from emir_analysis.diagnosis.unknowns import is_share
from emir_analysis.diagnosis.where import Where
from emir_analysis.outputs import write_text
from emir_analysis.root_mean_square import column_rms
from emir_analysis.signals import Array
from emir_common.parameter_tree import declared
from emir_common.quantity import quantities
from emir_plant.effects import REGISTRY, Effects
from emir_plant.linearize import linearize
from emir_plant.plant import Plant, SimulationError
from emir_plant.unnamed import UNNAMED

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

INTERVAL = 2.0  # standard deviations on either side of a parameter's low and high
FEWEST_DIGITS = 3
OPEN = "not determined by the recording"
SET = "not told here: taken so"
NONE_BETTER = "none of the others explains it better"
CONFOUNDED = 0.9  # correlation of two fitted parameters from which on the data hardly part them


@dataclass(frozen=True)
class ParameterResult:
    """A fitted parameter; low, high: two standard deviations from the curvature of the fit.

    confounded_with: parameters whose fitted values go up or down with this one's. meaning: of an
    effect's parameter, as its registry says. note: what to know of it in place of an interval.
    """

    value: float
    unit: str
    low: float
    high: float
    confounded_with: tuple[str, ...]
    meaning: str = ""
    note: str = ""

    @property
    def told(self) -> tuple[str, str, str]:
        """Return value, low and high with as many digits as tell them apart."""
        largest, width = max(abs(self.low), abs(self.high)), self.high - self.low
        digits = FEWEST_DIGITS
        if math.isfinite(width) and width > 0.0:
            digits += max(math.ceil(math.log10(largest / width)) - 1, 0)
        value, low, high = (f"{x:.{digits}g}" for x in (self.value, self.low, self.high))
        return value, low, high

    @property
    def interval(self) -> str:
        """Return the interval as it is shown, or what to know in its place."""
        return self.note or "{1} ... {2}".format(*self.told)


def parameter_line(name: str, p: ParameterResult, unit: str) -> str:
    """Return a parameter as a line for a terminal, in a unit as it is called there."""
    shown = "" if unit == "1" else f" {unit}"
    return f"{name:40}{p.told[0]:>11}{shown}  ({p.interval})  {p.meaning}"


@dataclass(frozen=True)
class EffectResult:
    """An effect that the machine has, with its parameters by name."""

    name: str
    balance: str
    parameters: dict[str, ParameterResult]


@dataclass(frozen=True)
class MisstatedResult:
    """A value of the data sheet, by dotted path, as it is stated and as the recordings want it."""

    name: str
    stated: float
    wanted: ParameterResult


@dataclass(frozen=True)
class BalanceResult:
    """RMS over the quieter 95 % of the windows; noise: the part that the sensors alone make."""

    unit: str
    noise: float
    before: float
    refitted: float
    after: float


@dataclass(frozen=True)
class SignalResult:
    """RMS error of a model by stage; with_effect equals refitted where nothing is added to it."""

    unit: str
    noise: float
    nominal: float
    refitted: float
    with_effect: float
    black_box: float


@dataclass(frozen=True)
class Diagnosis:
    """What a recording's machine lacks in the model, and the error before and after.

    verdict: nothing_missing, found, ambiguous, unexplained; statement: the same in words. Where
    nothing is missing in the recordings but something in the judge, it is unexplained, unless
    other parameters inside the tolerances explain both. candidates: what was tried, the nearest
    first. rivals: what would do as well where ambiguous. tell_apart: a movement that would tell
    them apart. signals: over the whole judge recordings; block_medians: medians over 15 s blocks;
    one_step: one sample ahead. parameters: the re-fitted tolerances of the final machine. shape: of
    what stays unexplained, swing: how that swings with time, where: most of it lies. at_end:
    parameters that were led to the end of what data sheet and registry allow. curve: what has no
    name and `with_effect` then has. untold: what missing sensors leave open, by balance. control: a
    controller designed before and after, on the machine as found, where that was asked for.
    """

    verdict: str
    statement: str
    effects: tuple[EffectResult, ...]
    rivals: tuple[str, ...]
    tell_apart: str | None
    candidates: tuple[CandidateResult, ...]
    balances: dict[str, BalanceResult]
    signals: dict[str, SignalResult]
    block_medians: dict[str, SignalResult]
    one_step: dict[str, SignalResult]
    tests: dict[str, ErrorTests]
    parameters: dict[str, ParameterResult]
    shape: Shape | None
    swing: Swing | None
    where: Where | None
    misstated: tuple[MisstatedResult, ...]
    curve: Curve | None
    drift: Drift | None
    at_end: tuple[str, ...]
    untold: dict[str, str]
    control: dict[str, ControlResult]
    recording: str
    judged_on: str


def diagnosis(
    findings: Findings, judged: Judged, control: dict[str, ControlResult] | None = None
) -> Diagnosis:
    """Put the findings into numbers, judged on recordings that no fit has seen."""
    stages = (*STAGES, BLACK_BOX)
    errors = {stage: judged.errors(stage) for stage in stages}
    periods = [experiment.period for experiment in judged.evidence.experiments]
    fitted = _parameters(findings.chosen, findings.evidence)
    return Diagnosis(
        verdict=verdict(findings, judged),
        statement=statement(findings, judged),
        effects=effect_results(findings.chosen, fitted, findings.undecided),
        rivals=tuple(rival.name for rival in findings.rivals if findings.verdict == "ambiguous"),
        tell_apart=tell_apart(findings),
        candidates=candidates(findings),
        balances=_balances(findings),
        signals=_signals(findings, {s: column_rms(np.concatenate(e)) for s, e in errors.items()}),
        block_medians=_signals(findings, {s: block_medians(e, periods) for s, e in errors.items()}),
        one_step=_signals(
            findings,
            {s: column_rms(np.concatenate(judged.one_step[s])) for s in stages},
            _STEP_NOISE,
        ),
        tests=error_tests(judged, _slow_period(findings)),
        parameters={path: p for path, p in fitted.items() if path in findings.sheet.tolerances},
        shape=findings.shape,
        swing=findings.swing,
        where=findings.where,
        misstated=tuple(_misstated(trial, findings.evidence) for trial in findings.misstated),
        curve=findings.curve,
        drift=findings.drift,
        at_end=at_end(findings),
        untold=untold(findings.evidence),
        control=control or {},
        recording=findings.evidence.name,
        judged_on=judged.evidence.name,
    )


# one step ahead, a difference of two samples is predicted; the bending follows the force
_STEP_NOISE = np.array([np.sqrt(2.0), np.sqrt(2.0), np.sqrt(2.0), 1.0])


def write_json(path: Path, result: "DataclassInstance") -> None:
    """Write the result as JSON, numbers that do not exist as null.

    Raises InputError when the file cannot be written.
    """
    write_text(path, json.dumps(_plain(asdict(result)), indent=2) + "\n")


def _parameters(trial: Trial, evidence: Evidence) -> dict[str, ParameterResult]:
    members = trial.unknowns.members
    spread = trial.spread
    together = confounded([member.path for member in members], trial.covariance)
    together = {path: _without_points(others) for path, others in together.items()}
    result = {}
    for k, (unknown, x) in enumerate(zip(members, trial.x, strict=True)):
        low, high = unknown.deviation(float(x), INTERVAL * float(spread[k]))
        value = unknown.value(float(x))
        with_it = together[unknown.path]
        if unknown.is_stepwise and not np.isfinite(spread[k]):
            low, high = between_steps(trial, k, evidence)
        anything = (low, high) == unknown.deviation(float(x), math.inf)
        note = OPEN if anything and not unknown.toleranced else ""
        result[unknown.path] = ParameterResult(value, unknown.unit, low, high, with_it, "", note)
    return result


def _misstated(trial: Trial, evidence: Evidence) -> MisstatedResult:
    value = trial.unknowns.members[-1]
    wanted = _parameters(trial, evidence)[value.path]
    meaning = declared(trial.machine)[value.path][0].meaning
    return MisstatedResult(value.path, value.origin, replace(wanted, meaning=meaning))


def _without_points(paths: Sequence[str]) -> tuple[str, ...]:
    """Return what is named among parameters: of a curve's points nobody would read a list."""
    return tuple(path for path in paths if path.partition(".")[0] not in UNNAMED)


def confounded(paths: Sequence[str], covariance: Array) -> dict[str, tuple[str, ...]]:
    """Return with which other parameters' values each one's goes up or down."""
    spread = np.sqrt(np.maximum(np.diag(covariance), np.finfo(float).tiny))
    with np.errstate(invalid="ignore"):  # of what the data do not tell the spread is infinite
        correlation = np.nan_to_num(covariance / np.outer(spread, spread))
    return {
        path: tuple(
            other for j, other in enumerate(paths) if j != k and abs(correlation[k, j]) > CONFOUNDED
        )
        for k, path in enumerate(paths)
    }


def effect_results(
    chosen: Trial, fitted: dict[str, ParameterResult], undecided: Iterable[str] = ()
) -> tuple[EffectResult, ...]:
    """Return a trial's effects with their fitted parameters, and those that were fixed at the end.

    fitted: by dotted path. undecided: paths of shares that may as well be the other end.
    """
    found = []
    for name in chosen.effects:
        kind = REGISTRY[name]
        if name == LOAD and has_course(chosen):
            found.append(EffectResult(name, kind.balance, _of_course(chosen, fitted)))
            continue
        effect = getattr(chosen.machine.effects, name)
        usual = quantities(kind).keys() - {*kind.sizes, *kind.other_law, *kind.given}
        parameters = {}
        for parameter, about in quantities(kind).items():
            path = f"effects.{name}.{parameter}"
            if path in fitted:
                parameters[parameter] = replace(fitted[path], meaning=about.meaning)
            elif path in chosen.form or parameter in usual or getattr(effect, parameter) != 0.0:
                value = float(getattr(effect, parameter))
                low, high, note = value, value, SET
                if path in chosen.form:
                    note = NONE_BETTER
                elif path in undecided:
                    low, high, note = 0.0, 1.0, OPEN
                elif is_share(path) and not sticks(chosen):  # whose other end is hard to fit
                    note = f"{1.0 - value:.0f} explains it worse"
                parameters[parameter] = ParameterResult(
                    value, about.unit, low, high, (), about.meaning, note
                )
        found.append(EffectResult(name, kind.balance, parameters))
    return tuple(found)


def _of_course(chosen: Trial, fitted: dict[str, ParameterResult]) -> dict[str, ParameterResult]:
    """Return what there is to say of a load of any course in a few numbers."""
    told = {}
    for name, (value, spread, meaning) in sizes(chosen).items():
        low, high = value - INTERVAL * spread, value + INTERVAL * spread
        told[name] = ParameterResult(value, "N", low, high, (), meaning)
    return told | {"joint_share": replace(fitted[SHARE], meaning="of it, a torque about the joint")}


def _balances(findings: Findings) -> dict[str, BalanceResult]:
    """Return those balances that the signals allow."""
    figures = [level(findings.residuals[stage]) for stage in ("before", "refitted", "after")]
    return {
        name: BalanceResult(balance.unit, float(findings.floor[k]), *(float(f[k]) for f in figures))
        for k, (name, balance) in enumerate(BALANCES.items())
        if findings.evidence.told[k]
    }


def _signals(
    findings: Findings, figures: dict[str, Array], factor: Array | None = None
) -> dict[str, SignalResult]:
    """Return the measured signals' figures; factor: (4,) on the sensors' noise."""
    sensors = findings.evidence.sensors * (1.0 if factor is None else factor)
    return {
        name: SignalResult(unit, float(sensors[k]), **{s: float(f[k]) for s, f in figures.items()})
        for k, (name, unit) in enumerate(OUTPUTS.items())
        if findings.evidence.shown[k]
    }


def _slow_period(findings: Findings) -> float:
    """Return the period of the machine's slow mode, s, as it rests where a recording begins.

    Without effects: dry friction would hold the piston. Where it cannot rest there, what a block
    of the bootstrap takes for the longest.
    """
    angle, _ = findings.evidence.experiments[0].start()
    plant = Plant(replace(findings.evidence.stated, effects=Effects()))
    try:
        rest = plant.initial(angle)
    except SimulationError:
        return BOOTSTRAP_BLOCK / PERIODS
    return float(1.0 / linearize(plant, rest).modes()[0][0])


def _plain(value: Any) -> Any:
    """Return the value as JSON can hold it: NaN is null there."""
    if isinstance(value, dict):
        return {key: _plain(member) for key, member in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(member) for member in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value

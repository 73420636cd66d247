"""The result of an actuator's diagnosis, in the form and with the keys of the boom's."""

import math
from dataclasses import dataclass, replace

import numpy as np

from emir_analysis.diagnosis.actuator.black_box import linear_model, linear_run, one_step_error
from emir_analysis.diagnosis.actuator.curves import CurveResult, as_result
from emir_analysis.diagnosis.actuator.fitting import Fitted, free_run
from emir_analysis.diagnosis.actuator.record import PRESSURE, ActuatorRecord, noise_of
from emir_analysis.diagnosis.actuator.search import Misstated, Search
from emir_analysis.diagnosis.actuator.verdict import BALANCE, statement, verdict
from emir_analysis.diagnosis.error_tests import ErrorTests
from emir_analysis.diagnosis.result import (
    INTERVAL,
    OPEN,
    BalanceResult,
    EffectResult,
    MisstatedResult,
    ParameterResult,
    SignalResult,
    confounded,
    parameter_line,
)
from emir_analysis.diagnosis.select import EXPLAINED
from emir_analysis.diagnosis.statistics import input_correlation, rms_intervals, whiteness
from emir_analysis.root_mean_square import rms
from emir_analysis.signals import Array
from emir_common.parameter_tree import declared
from emir_common.quantity import quantities
from emir_plant.actuator import REGISTRY, Actuator, ActuatorSheet
from emir_plant.actuator.model import driven
from emir_plant.actuator.unnamed import CURVES

BOOTSTRAP_BLOCK = 2.0  # slow periods in a block of the bootstrap
NOT_TOLD = (
    "without the piston's position and velocity, forces cannot be told from flows by"
    " measurement: effects are told apart by the course of the pressure alone"
)


@dataclass(frozen=True)
class CandidateResult:
    """What was tried.

    score: twice the logarithm of how much more probable than parameters only it makes the
    recording; unseen: see `Search`, None where it was not looked at.
    """

    name: str
    score: float
    unseen: float | None


@dataclass(frozen=True)
class ActuatorDiagnosis:
    """What the model of an actuator lacks.

    rivals: sets of effects that would do as well, "a + b", where the verdict is ambiguous.
    misstated: a value of the data sheet that explains the recording if it is another, or curve:
    what has no name, measured, where the verdict is unexplained. last: what is the last stage's.
    signals: over the judge recording; one_step: one sample ahead of the measured pressure.
    spread: standard deviation of the judged pressure.
    """

    verdict: str
    statement: str
    effects: tuple[EffectResult, ...]
    rivals: tuple[str, ...]
    misstated: MisstatedResult | None
    curve: CurveResult | None
    candidates: tuple[CandidateResult, ...]
    balances: dict[str, BalanceResult]
    signals: dict[str, SignalResult]
    one_step: dict[str, SignalResult]
    tests: dict[str, ErrorTests]
    parameters: dict[str, ParameterResult]
    spread: float
    not_told: str
    time_unit: str
    recording: str
    judged_on: str
    judged_from_its_own_start: bool
    last: str

    @property
    def labels(self) -> dict[str, str]:
        """Return what the stages are called."""
        return {
            "nominal": "data sheet",
            "refitted": "re-fitted",
            "with_effect": self.last,
            "black_box": "best linear model",
        }


def noise_floor(sheet: ActuatorSheet, record: ActuatorRecord) -> float:
    """Return the noise of the pressure: the data sheet's, or that which the recording shows."""
    return sheet.machine.sensor.pressure_noise or noise_of(record.pressure)


def stages(sheet: ActuatorSheet, found: Search) -> dict[str, Actuator]:
    """Return the machine as stated, re-fitted, and with the effects chosen or what else is told."""
    return {
        "nominal": sheet.machine,
        "refitted": found.plain.machine,
        "with_effect": found.last.machine,
    }


def judged_runs(
    machines: dict[str, Actuator], record: ActuatorRecord, judge: ActuatorRecord | None
) -> dict[str, Array]:
    """Return each machine's pressure over the judge recording, (n,), and the linear model's.

    A judge recording that goes on where the other ended is simulated from that one's start, by
    the valve opening alone. judge: None for the recording itself.
    """
    judged, skipped = _whole(record, judge)
    runs = {name: free_run(machine, judged)[skipped:] for name, machine in machines.items()}
    return runs | {"black_box": linear_run(linear_model(record), judged.opening)[skipped:]}


def one_step_errors(
    machines: dict[str, Actuator], record: ActuatorRecord, judge: ActuatorRecord | None
) -> dict[str, Array]:
    """Return each machine's errors one sample ahead, and the linear model's.

    The measured pressure goes into every term up to the sample before.
    """
    judged, skipped = _whole(record, judge)
    steps = {
        name: np.diff(driven(machine, judged.opening, judged.pressure, judged.period))
        - np.diff(judged.pressure)
        for name, machine in machines.items()
    }
    steps["black_box"] = one_step_error(record, judged)[1:]
    return {name: error[skipped:] for name, error in steps.items()}


def _whole(record: ActuatorRecord, judge: ActuatorRecord | None) -> tuple[ActuatorRecord, int]:
    """Return what is simulated to judge, and how many samples of it are not judged."""
    if judge is None:
        return record, 0
    if judge.follows(record):
        return judge.behind(record), record.opening.size
    return judge, 0


def diagnosis(
    sheet: ActuatorSheet,
    found: Search,
    record: ActuatorRecord,
    judge: ActuatorRecord | None,
    runs: dict[str, Array],
) -> ActuatorDiagnosis:
    """Put the findings into numbers; runs: as `judged_runs` returns them."""
    noise = noise_floor(sheet, record)
    curve = as_result(found.curve) if found.curve else None
    judged = record if judge is None else judge
    errors = {name: run - judged.pressure for name, run in runs.items()}
    ahead = one_step_errors(stages(sheet, found), record, judge)
    slow = _slow_period(found)
    chosen, fitted = found.chosen, _parameters(found.last)
    wanted = _misstated(sheet, found.misstated, fitted) if found.misstated else None
    about = declared(sheet.machine)
    own = {path: fitted[path] for path in sheet.ranges if path in fitted}
    word = verdict(sheet, found, noise)
    said = statement(word, found, noise, wanted or curve)
    if judge is not None and sheet.machine.sensor.pressure_noise:
        word, said = _judged(word, said, judge.name, rms(errors["with_effect"]) / noise)
    said += _not_from_rest(record, found, noise)
    return ActuatorDiagnosis(
        verdict=word,
        statement=said,
        effects=tuple(_effect(name, fitted) for name in chosen.effects)
        if word in ("found", "ambiguous")
        else (),
        misstated=wanted,
        curve=curve,
        rivals=tuple(" + ".join(r.effects) for r in found.rivals if word == "ambiguous"),
        candidates=_candidates(found),
        balances={BALANCE: _balance(stages(sheet, found), slow, record, noise)},
        signals={PRESSURE: _signal(record.unit, noise, errors)},
        one_step={PRESSURE: _signal(record.unit, math.sqrt(2.0) * noise, ahead)},
        tests={PRESSURE: _tests(errors, ahead, judged, slow)},
        parameters={k: replace(p, meaning=about[k][0].meaning) for k, p in own.items()},
        spread=float(np.std(judged.pressure)),
        not_told=NOT_TOLD,
        time_unit=sheet.time_unit,
        recording=record.name,
        judged_on=judged.name,
        judged_from_its_own_start=judge is None or not judge.follows(record),
        last=_last(found),
    )


def _not_from_rest(record: ActuatorRecord, found: Search, noise: float) -> str:
    if not record.begins_moving(found.last.machine.valve.gain, noise):
        return ""
    return (
        f"; but {record.name} begins while the machine moves, and what is simulated begins at rest:"
        " an offset or a load may be for that alone, record from rest"
    )


def _last(found: Search) -> str:
    """Return what is in the machine of the last stage."""
    if found.misstated is not None:
        return f"with another {found.misstated.path}"
    if found.curve is not None:
        return "with the curve"
    return "with the effects" if found.chosen.effects else "with no effect"


def _judged(word: str, said: str, judge: str, left: float) -> tuple[str, str]:
    """Return verdict and statement where a judge recording is left with so much, over its noise."""
    if left > EXPLAINED and word != "unexplained":
        word = "unexplained" if word == "nothing_missing" else word
        said += f"; but {judge}, {left:.1f} times the noise, shows more"
    return word, said


def _candidates(found: Search) -> tuple[CandidateResult, ...]:
    plain = found.plain.evidence
    return tuple(
        CandidateResult(f.name, 2.0 * (f.evidence - plain), found.unseen.get(f.name))
        for f in found.tried
        if f.effects
    )


def summary(result: ActuatorDiagnosis) -> str:
    """Return the result as lines for a terminal."""
    s = result.signals[PRESSURE]
    start = "its own start" if result.judged_from_its_own_start else f"that of {result.recording}"
    lines = [f"{result.verdict}: {result.statement}", f"({result.not_told})", ""]
    told = {f"{e.name}.{name}": p for e in result.effects for name, p in e.parameters.items()}
    if result.misstated:
        told[result.misstated.name] = result.misstated.wanted
    told |= {path: p for path, p in result.parameters.items() if path not in told}
    lines += [parameter_line(name, p, _unit(p.unit, result)) for name, p in told.items()]
    i, ahead = result.tests[PRESSURE].intervals, result.one_step[PRESSURE]
    labels = result.labels
    figures = "  " + ", ".join(f"{label} {getattr(s, n):.3g}" for n, label in labels.items())
    lines += [
        "",
        f"free run of {PRESSURE} on {result.judged_on}, from {start}, by the valve opening alone",
        f"RMS error in units of the file (its spread {result.spread:.3g}, noise {s.noise:.2g}):",
        figures,
        "  95 % by block bootstrap: "
        + ", ".join(f"{label} {i[n].low:.3g} ... {i[n].high:.3g}" for n, label in labels.items()),
        f"one sample ahead of the measured pressure (noise, of two readings, {ahead.noise:.2g}):",
        "  " + ", ".join(f"{label} {getattr(ahead, n):.3g}" for n, label in labels.items()),
    ]
    return "\n".join(lines)


def _unit(unit: str, result: ActuatorDiagnosis) -> str:
    shown = unit.replace("time", result.time_unit)
    return "" if shown == "1" else shown


def _signal(unit: str, noise: float, errors: dict[str, Array]) -> SignalResult:
    return SignalResult(unit, noise, **{name: rms(error) for name, error in errors.items()})


def _tests(
    errors: dict[str, Array], ahead: dict[str, Array], judged: ActuatorRecord, slow: float
) -> ErrorTests:
    period, opening, block = judged.period, judged.opening, BOOTSTRAP_BLOCK * slow
    return ErrorTests(
        {n: rms_intervals([e[:, None]], [period], block)[0] for n, e in errors.items()},
        {n: input_correlation(e, opening, period, slow) for n, e in errors.items()},
        # of every second step: the noise of one reading is in two neighbours
        {n: whiteness(e[::2], 2.0 * period, slow) for n, e in ahead.items()},
    )


def _slow_period(found: Search) -> float:
    return 2.0 * math.pi / found.plain.machine.load.frequency


def _parameters(fitted: Fitted) -> dict[str, ParameterResult]:
    found = {}
    together = confounded([unknown.path for unknown in fitted.unknowns], fitted.covariance)
    deviations = np.sqrt(np.maximum(np.diag(fitted.covariance), 0.0))
    for path, others in together.items():  # of a curve's points nobody would read a list
        together[path] = tuple(other for other in others if other.split(".")[1] not in CURVES)
    for unknown, x, deviation in zip(fitted.unknowns, fitted.x, deviations, strict=True):
        ends = [min(max(x + s * INTERVAL * deviation, unknown.low), unknown.high) for s in (-1, 1)]
        low, high = sorted(unknown.value(float(end)) for end in ends)
        value, with_it = unknown.value(float(x)), together[unknown.path]
        note = OPEN if (unknown.low, unknown.high) == tuple(ends) else ""
        found[unknown.path] = ParameterResult(value, unknown.unit, low, high, with_it, "", note)
    return found


def _misstated(
    sheet: ActuatorSheet, found: Misstated, fitted: dict[str, ParameterResult]
) -> MisstatedResult:
    about, stated = declared(sheet.machine)[found.path]
    wanted = replace(fitted[found.path], meaning=about.meaning)
    return MisstatedResult(found.path, float(stated), wanted)


def _effect(name: str, fitted: dict[str, ParameterResult]) -> EffectResult:
    start = f"effects.{name}."
    own = {path.removeprefix(start): p for path, p in fitted.items() if path.startswith(start)}
    about = quantities(REGISTRY[name])
    own = {parameter: replace(p, meaning=about[parameter].meaning) for parameter, p in own.items()}
    return EffectResult(name, REGISTRY[name].balance, own)


def _balance(
    machines: dict[str, Actuator], slow: float, record: ActuatorRecord, noise: float
) -> BalanceResult:
    window = max(1, round(0.5 * slow / record.period))

    def missing(machine: Actuator) -> float:
        modelled = driven(machine, record.opening, record.pressure, record.period)
        rest = record.pressure - modelled
        return rms(rest[window:] - rest[:-window])

    figures = (missing(machine) for machine in machines.values())
    return BalanceResult(record.unit, math.sqrt(2.0) * noise, *figures)

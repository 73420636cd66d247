"""The report of a diagnosis as a page that is read in two minutes."""

import math
from pathlib import Path

import numpy as np

from emir_analysis.diagnosis.balances import level
from emir_analysis.diagnosis.candidates import CandidateResult
from emir_analysis.diagnosis.curves import BY_TIME, CURVE_PARTS, Curve
from emir_analysis.diagnosis.diagnose import Findings
from emir_analysis.diagnosis.drift import Drift
from emir_analysis.diagnosis.error_tests import ErrorTests
from emir_analysis.diagnosis.judged import Judged
from emir_analysis.diagnosis.pictures import (
    SHOWN,
    balances_picture,
    curve_picture,
    free_runs_picture,
    shape_picture,
    swing_picture,
)
from emir_analysis.diagnosis.result import (
    Diagnosis,
    EffectResult,
    ParameterResult,
    SignalResult,
)
from emir_analysis.diagnosis.select import quiet
from emir_analysis.diagnosis.shape import PREDICTED_SHARE, Shape
from emir_analysis.diagnosis.summary import cautions, in_short, nothing_added, told_balances
from emir_analysis.diagnosis.swing import Swing
from emir_analysis.report import Block, Heading, Picture, Table, Text, write_html

VERDICTS = {
    "nothing_missing": "Nothing is missing",
    "found": "Found",
    "ambiguous": "More than one effect would do",
    "unexplained": "Something is there that no known effect explains",
}
MOST_ROWS = 40  # points of a curve whose every second is in its table


def write_page(path: Path, findings: Findings, result: Diagnosis, judged: Judged) -> None:
    """Write the report as HTML. Raises InputError when the file cannot be written."""
    blocks: list[Block] = [
        Text(f"{VERDICTS[result.verdict]}: {result.statement}.", lead=True),
        Text(in_short(result)),
        *[Text(line) for line in cautions(result)],
        *_effects(result.effects),
        *_misstated(result),
        *_free_runs(findings, result, judged),
        *_balances(findings, result),
        *_candidates(result),
        *_parameters(findings, result),
        *tests_of_errors(
            {name: shown[0] for name, shown in SHOWN.items()},
            result.signals,
            result.one_step,
            result.tests,
        ),
        *_control(result),
    ]
    write_html(path, f"What does the model of {result.recording} lack?", blocks)


def _effects(effects: tuple[EffectResult, ...]) -> list[Block]:
    rows = [
        (effect.name, effect.balance, name, p.told[0], p.interval, p.unit, p.meaning)
        for effect in effects
        for name, p in effect.parameters.items()
    ]
    columns = ("effect", "balance", "parameter", "value", "interval", "unit", "meaning")
    caption = (
        "interval: two standard deviations either way from the curvature of the fit; "
        "what the noise leaves open, not what a law is wrong by"
    )
    return [Table(columns, rows, caption)] if rows else []


def _misstated(result: Diagnosis) -> list[Block]:
    rows = [
        (m.name, m.stated, m.wanted.told[0], m.wanted.interval, m.wanted.unit)
        for m in result.misstated
    ]
    columns = ("value in the data sheet", "stated", "wanted", "interval", "unit")
    caption = "Each alone explains the recordings with the others as stated, within tolerances."
    return [Table(columns, rows, caption)] if rows else []


def _free_runs(findings: Findings, result: Diagnosis, judged: Judged) -> list[Block]:
    rows: list[tuple[str | float, ...]] = []
    for name, s in result.signals.items():
        m = result.block_medians[name]
        factor = SHOWN[name][1]
        ratios = [s.nominal, m.nominal, s.refitted, m.refitted, s.with_effect, m.with_effect]
        ratios.append(s.black_box)
        rows.append((SHOWN[name][0], s.noise * factor, *(ratio / s.noise for ratio in ratios)))
    columns = (
        "signal",
        "noise",
        "data sheet",
        "(blocks)",
        "re-fitted",
        "(blocks)",
        "with effect",
        "(blocks)",
        "black box",
    )
    return [
        Heading(f"Free run on {result.judged_on}"),
        Table(
            columns,
            rows,
            "p_H is the pressure in the lifting chamber, p_S in the lowering one. "
            "RMS error over the whole recording, and the median over its blocks of 15 s, in units "
            "of the sensor noise (which is given in the signal's unit). Up to 1.1 is at the noise, "
            "up to 2 explained. The black box is a linear model of measured signals, trained on "
            f"the same recordings. {nothing_added(result)}",
        ),
        Picture(
            free_runs_picture(findings, judged),
            "The machine simulated from rest under the recorded valve command alone. "
            "Right: simulated minus measured, linear up to 5 times the noise.",
        ),
    ]


def _balances(findings: Findings, result: Diagnosis) -> list[Block]:
    if not np.any(findings.evidence.fitted):
        return []
    blocks: list[Block] = [
        Heading("What each balance lacks"),
        Table(
            ("balance", "noise", "data sheet", "re-fitted", "with effect"),
            [
                (label, *(factor * f for f in (b.noise, b.before, b.refitted, b.after)))
                for label, factor, b in (
                    (*SHOWN[name], b) for name, b in told_balances(result).items() if name in SHOWN
                )
            ],
            f"RMS over windows of half a second to a second of {result.recording}; "
            "noise is what the sensors alone would leave. Re-fitted here: to the balances; in the "
            "free runs: to those. H is the lifting chamber, S the lowering one.",
        ),
        Picture(
            balances_picture(findings),
            "Measured signals go into each balance; what does not come out is missing there. "
            "The band is twice the sensors' noise.",
        ),
    ]
    if not quiet(level(findings.residuals["refitted"]), findings.limit):
        figure, name = shape_picture(findings)
        blocks.append(
            Picture(figure, f"What parameters alone leave in the balance {name}, and against what.")
        )
    return [*blocks, *_what_is_left(findings, result)]


def _what_is_left(findings: Findings, result: Diagnosis) -> list[Block]:
    """Return what no effect explains: a curve, else what drifts or swings, else over a signal."""
    shape = result.shape
    if result.curve is not None:
        return _curve(result.curve)
    if result.drift is not None:
        return _drift(result.drift)
    if result.swing is not None:
        return _swing(result.swing, findings, result)
    if shape is None or findings.speaking is None or not shape.share > PREDICTED_SHARE:
        return []
    what = f"{findings.speaking}, {result.balances[findings.speaking].unit}"
    return [
        Table(
            (_over(shape), "lowering", "lifting"),
            shape.table,
            f"What is left in the balance {what}, against the signal that predicts it best "
            f"({100 * shape.share:.0f} % of the variance in parts left out).",
        )
    ]


def _over(function: Shape | Swing) -> str:
    """Return of what signal it is a function."""
    return (
        f"{function.predictor}, {function.unit}" if function.predictor else "whatever the signals"
    )


def _swing(swing: Swing, findings: Findings, result: Diagnosis) -> list[Block]:
    """Return a picture of what swings with time, and a table of how much it does."""
    name = findings.speaking or ""
    unit = result.balances[name].unit
    told = (
        f"What is left in the balance {name} swings with a period of {swing.period:.3g} s "
        f"({100 * swing.share:.0f} % of the variance in parts left out)."
    )
    return [
        Picture(swing_picture(swing, findings), told),
        Table(
            (_over(swing), f"steady, {unit}", f"amplitude, {unit}"),
            swing.table,
            "The same in numbers.",
        ),
    ]


def _drift(drift: Drift) -> list[Block]:
    return [
        Table(
            ("size of an effect", "at the begin", "at the end", "unit"),
            [(drift.path.removeprefix("effects."), drift.begin, drift.end, drift.unit)],
            f"It makes {100 * drift.share:.0f} % of what the balances lack when it goes linearly "
            "along the recording; no effect of the registry does.",
        )
    ]


def _curve(curve: Curve) -> list[Block]:
    """Return a picture of what has no name, or of a load over time, and a table of its points."""
    every = 2 * math.ceil(len(curve.signal) / MOST_ROWS)
    rows = list(zip(curve.signal, *curve.parts.values(), strict=True))[::every]
    what = "What has no name" if curve.over != BY_TIME else "The load from outside"
    heads = [f"{CURVE_PARTS[name]}, {curve.part_unit}" for name in curve.parts]
    return [
        Picture(
            curve_picture(curve),
            f"{what}, as a curve in the machine ({curve.name}), fitted to the free run.",
        ),
        Table((f"{curve.over}, {curve.unit}", *heads), rows, "The same in numbers."),
    ]


def _candidates(result: Diagnosis) -> list[Block]:
    def where_fitted(figure: float | None) -> str:
        return "not simulated" if figure is None else f"{figure:.3g}"

    def sizes(candidate: CandidateResult) -> str:
        told = (f"{n.partition('.')[2]} {s.value:.3g} {s.unit}" for n, s in candidate.sizes.items())
        return ", ".join(each.removesuffix(" 1") for each in told)

    rows = [
        (c.name, c.score, where_fitted(c.free_run), where_fitted(c.left), sizes(c))
        for c in result.candidates
    ]
    return [
        Heading("What was tried"),
        Table(
            ("effects", "balances", "free run", "left", "sizes"),
            rows,
            "balances, free run: how much better than parameters only, in the free run on the last "
            "third of the recording, which the fit had not seen: difference of the Bayesian "
            "information criterion, above 10 strong. left: RMS error of the free run of the whole "
            "recording, times the noise; 1 is all that can be explained. sizes: as fitted so far.",
        ),
    ]


def _parameters(findings: Findings, result: Diagnosis) -> list[Block]:
    stated = {u.path: u for u in findings.refitted.unknowns.members}

    def row(path: str, p: ParameterResult) -> tuple[str | float, ...]:
        about = stated[path]
        return (
            path,
            p.unit,
            about.origin,
            "{:.3g} ... {:.3g}".format(*about.deviation(0.0, 1.0)),
            p.told[0],
            p.interval,
            ", ".join(other.rsplit(".", 1)[1] for other in p.confounded_with),
        )

    return [
        Heading("Parameters"),
        Table(
            ("parameter", "unit", "stated", "tolerance", "fitted", "interval", "confounded with"),
            [row(path, p) for path, p in result.parameters.items()],
            "interval: two standard deviations either way from the curvature of the fit, the "
            "tolerance counted as knowledge. What the recording cannot tell stays near its stated "
            "value, unless something that no effect explains pulls at it.",
        ),
    ]


def tests_of_errors(
    names: dict[str, str],
    signals: dict[str, SignalResult],
    one_step: dict[str, SignalResult],
    all_tests: dict[str, ErrorTests],
) -> list[Block]:
    """Return what is said of each signal's errors; names: what the signals are called."""
    rows: list[tuple[str | float, ...]] = []
    for name, tests in all_tests.items():
        ahead, noise = one_step[name], signals[name].noise
        for stage in ("nominal", "refitted", "with_effect", "black_box"):
            bounds = tests.intervals[stage]
            rows.append(
                (
                    names[name],
                    stage.replace("_", " "),
                    bounds.low / noise,
                    bounds.high / noise,
                    getattr(ahead, stage) / ahead.noise,
                    tests.whiteness[stage],
                    tests.input_correlation[stage],
                )
            )
    columns = ("signal", "model", "low", "high", "one step", "whiteness", "input")
    return [
        Heading("How sure the errors are, and what they still know"),
        Table(
            columns,
            rows,
            "low, high: the free run's RMS error in units of the noise, 95 % by block bootstrap. "
            "one step: error of the modelled change from one sample to the next, all else as "
            "measured (black box: from earlier samples alone), in units of its noise. whiteness: "
            "Ljung-Box statistic of the one-step error over its 95 % value, white below 1. input: "
            "largest correlation of the free run's error with the command.",
        ),
    ]


def _control(result: Diagnosis) -> list[Block]:
    if not result.control:
        return []
    rows = [
        (f"designed {name}", 1e3 * c.tracking, 1e2 * c.tcp) for name, c in result.control.items()
    ]
    return [
        Heading("What it is worth to a controller"),
        Table(
            ("predictive controller", "stroke error, mm", "TCP deflection, cm"),
            rows,
            "Largest errors on moves of 64 mm away and back at 45 deg, simulated on the machine as "
            "found; designed for the data sheet and for that machine.",
        ),
    ]

"""The report of an actuator's diagnosis as a page, and its pictures."""

from pathlib import Path

from matplotlib.figure import Figure

from emir_analysis.diagnosis.actuator.curves import CurveResult
from emir_analysis.diagnosis.actuator.record import OPENING, PRESSURE, ActuatorRecord
from emir_analysis.diagnosis.actuator.result import ActuatorDiagnosis
from emir_analysis.diagnosis.drawing import COLOURS, MEASURED, tidy
from emir_analysis.diagnosis.page import tests_of_errors
from emir_analysis.report import Block, Heading, Picture, Table, Text, new_figure, write_html
from emir_analysis.signals import Array

SHOWN = 12  # candidates on the page; the JSON has all


def write_page(
    path: Path, result: ActuatorDiagnosis, judged: ActuatorRecord, runs: dict[str, Array]
) -> None:
    """Write the report as HTML. Raises InputError when the file cannot be written."""
    blocks: list[Block] = [
        Text(f"{result.verdict}: {result.statement}.", lead=True),
        Text(result.not_told.capitalize() + "."),
        *_effects(result),
        *_misstated(result),
        *(_curve(result.curve) if result.curve else []),
        *_free_run(result, judged, runs),
        *_balances(result),
        *_candidates(result),
        *_parameters(result),
        *tests_of_errors({PRESSURE: "oil pressure"}, result.signals, result.one_step, result.tests),
    ]
    write_html(path, f"What does the model of {result.recording} lack?", blocks)


def _effects(result: ActuatorDiagnosis) -> list[Block]:
    unit = result.time_unit
    rows = [
        (e.name, e.balance, name, p.told[0], p.interval, p.unit.replace("time", unit), p.meaning)
        for e in result.effects
        for name, p in e.parameters.items()
    ]
    about = (
        "interval: two standard deviations either way from the curvature of the fit. Flows are in"
        " units of the pressure rate that they make, velocities in units of flow."
    )
    columns = ("effect", "balance", "parameter", "value", "interval", "unit", "meaning")
    return [Table(columns, rows, about)] if rows else []


def _misstated(result: ActuatorDiagnosis) -> list[Block]:
    if result.misstated is None:
        return []
    m = result.misstated
    unit = m.wanted.unit.replace("time", result.time_unit)
    columns = ("value in the data sheet", "stated", "wanted", "interval", "unit", "meaning")
    row = (m.name, m.stated, m.wanted.told[0], m.wanted.interval, unit, m.wanted.meaning)
    return [Table(columns, [row], "Explains the recording with the others inside their ranges.")]


def _curve(curve: CurveResult) -> list[Block]:
    figure = new_figure(3.2)
    ax = figure.subplots()
    ax.plot(*zip(*curve.points, strict=True), color=COLOURS["with_effect"], marker="o")
    ax.set_xlabel(curve.over)
    ax.set_ylabel(f"{curve.what} that the model lacks")
    tidy(ax)
    return [
        Heading(f"What has no name: a {curve.what} over the {curve.over}"),
        Picture(
            figure,
            f"Fitted to the free run with the parameters; {curve.left:.3g} is left. It belongs to"
            f" the balance of: {curve.balance}.",
        ),
        Table((curve.over, curve.what), curve.points, ""),
    ]


def _free_run(
    result: ActuatorDiagnosis, judged: ActuatorRecord, runs: dict[str, Array]
) -> list[Block]:
    s = result.signals[PRESSURE]
    errors = {name: getattr(s, name) for name in result.labels}
    return [
        Heading(f"Free run on {result.judged_on}"),
        Table(
            ("", "RMS error", "share of the spread"),
            [(result.labels[n], e, e / result.spread) for n, e in errors.items()],
            f"Unit: the file's ({s.unit}); noise of the pressure {s.noise:.2g}.",
        ),
        Picture(
            _picture(judged, runs, result),
            "Simulated under the recorded valve opening alone; below, simulated minus measured.",
        ),
    ]


def _balances(result: ActuatorDiagnosis) -> list[Block]:
    return [
        Heading("What the balance of the oil lacks"),
        Table(
            ("balance", "noise", "data sheet", "re-fitted", result.last),
            [(n, b.noise, b.before, b.refitted, b.after) for n, b in result.balances.items()],
            "RMS over half a slow period, the measured pressure in every term.",
        ),
    ]


def _candidates(result: ActuatorDiagnosis) -> list[Block]:
    closest = result.candidates[:SHOWN]
    return [
        Heading("What was tried"),
        Table(
            ("effects", "better by", "error on parts left out"),
            [(c.name, c.score, "" if c.unseen is None else c.unseen) for c in closest],
            "better by: twice the logarithm of how much more probable the recording is than under"
            " parameters only; 6 are strong. The"
            f" {len(closest)} closest of {len(result.candidates)} that were tried.",
        ),
    ]


def _parameters(result: ActuatorDiagnosis) -> list[Block]:
    rows = [
        (path, p.told[0], p.interval, p.unit.replace("time", result.time_unit),
         ", ".join(p.confounded_with))
        for path, p in result.parameters.items()
    ]  # fmt: skip
    columns = ("parameter", "fitted", "interval", "unit", "confounded with")
    return [Heading("Parameters"), Table(columns, rows)]


def _picture(judged: ActuatorRecord, runs: dict[str, Array], result: ActuatorDiagnosis) -> Figure:
    figure = new_figure(7.0)
    time = judged.time - judged.begin
    above, middle, below = figure.subplots(3, 1, sharex=True, height_ratios=(1, 3, 2))
    above.plot(time, judged.opening, color=MEASURED, lw=0.9)
    above.set_ylabel(OPENING.replace("_", " "))
    limit = 2.0 * abs(judged.pressure).max()
    for name, colour in COLOURS.items():
        shown = runs[name].clip(-limit, limit)
        middle.plot(time, shown, color=colour, lw=1.0, label=result.labels[name])
        below.plot(time, shown - judged.pressure, color=colour, lw=0.8)
    middle.plot(time, judged.pressure, color=MEASURED, lw=1.0, ls="--", label="measured")
    middle.set_ylabel(PRESSURE.replace("_", " "))
    middle.legend(ncols=5, fontsize=8, loc="lower left", bbox_to_anchor=(0.0, 1.0))
    below.set_ylabel("error")
    below.set_xlabel(f"time from the beginning of this recording, {result.time_unit}")
    tidy(above, middle, below)
    return figure

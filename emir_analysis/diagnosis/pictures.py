"""The pictures of a diagnosis."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, StrMethodFormatter

from emir_analysis.diagnosis.balances import BALANCES
from emir_analysis.diagnosis.curves import CURVE_PARTS, Curve
from emir_analysis.diagnosis.diagnose import Findings, loudest
from emir_analysis.diagnosis.drawing import COLOURS, MEASURED, tidy
from emir_analysis.diagnosis.experiment import OUTPUTS
from emir_analysis.diagnosis.judged import STAGES, Judged
from emir_analysis.diagnosis.swing import Swing, by_swing
from emir_analysis.report import new_figure

NOMINAL, REFITTED, FINAL = (COLOURS[stage] for stage in STAGES)
LOWERING, LIFTING = "#b5460b", "#0b6bb5"

# What a hydraulics engineer reads: label and factor from the SI unit
SHOWN = {
    "piston_stroke": ("stroke, mm", 1e3),
    "pressure_lifting": ("p_H, bar", 1e-5),
    "pressure_lowering": ("p_S, bar", 1e-5),
    "tip_deflection_angle": ("tip deflection, mrad", 1e3),
    "linkage": ("linkage, mm", 1e3),
    "force": ("force, kN", 1e-3),
    "lifting_chamber": ("flow H, l/min", 6e4),
    "lowering_chamber": ("flow S, l/min", 6e4),
    "bending": ("bending, mrad", 1e3),
}

# what a residual is drawn against, likewise
AGAINST = {
    "piston_velocity": ("piston velocity, mm/s", 1e3),
    "piston_stroke": ("piston stroke, mm", 1e3),
    "pressure_lifting": ("p_H, bar", 1e-5),
    "pressure_lowering": ("p_S, bar", 1e-5),
    "valve_command": ("valve command", 1.0),
    "time": ("time, s", 1.0),
    "own_pressure": ("the chamber's pressure, bar", 1e-5),
    "pressure_difference": ("p_H - p_S, bar", 1e-5),
    "valve_opening": ("opening as stated", 1.0),
}
PART = {  # of a curve, by the unit of its points
    "N": ("force, kN", 1e-3),
    "1": ("change, %", 1e2),
    "m^3/s": ("flow, l/min", 6e4),
    "m^3/Pa": ("compliance, ml/bar", 1e11),
}
TIMES_NOISE = [sign * 10.0**k for sign in (-1, 1) for k in range(1, 7)] + [0.0]  # ticks of errors


def free_runs_picture(findings: Findings, judged: Judged) -> Figure:
    """Show each measured signal and its simulations, and the errors beside it.

    Of the first judge recording.
    """
    judge = judged.evidence.experiments[0]
    rows = [k for k in range(len(OUTPUTS)) if judged.evidence.shown[k]]
    figure = new_figure(0.6 + 1.9 * len(rows))
    axes = figure.subplots(len(rows), 2, sharex=True, width_ratios=(3, 2), squeeze=False)
    stages = {"nominal": ("data sheet", NOMINAL), "refitted": ("re-fitted", REFITTED)}
    if findings.chosen is not findings.refitted:
        stages["with_effect"] = (_added(findings), FINAL)
    for (signal, beside), row in zip(axes, rows, strict=True):
        label, factor = SHOWN[list(OUTPUTS)[row]]
        for stage, (name, colour) in stages.items():
            run = judged.runs[stage][0][:, row]
            error = (run - judge.outputs[:, row]) / judged.evidence.sensors[row]
            signal.plot(judge.time, factor * run, color=colour, lw=1.0, label=name)
            beside.plot(judge.time, error, color=colour, lw=0.7)
        measured = factor * judge.outputs[:, row]
        signal.plot(judge.time, measured, color=MEASURED, lw=0.8, ls=(0, (3, 2)), label="measured")
        signal.set_ylabel(label)
        beside.set_ylabel("error / noise")
        beside.set_yscale("symlog", linthresh=5.0)
        beside.yaxis.set_major_locator(FixedLocator(TIMES_NOISE))
        beside.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        tidy(signal, beside)
    # of the figure: beside the left axes it would push the right ones away
    lines, names = axes[0, 0].get_legend_handles_labels()
    figure.legend(lines, names, ncols=4, fontsize=8, loc="outside upper left")
    axes[-1, 0].set_xlabel("time, s")
    axes[-1, 1].set_xlabel("time, s")
    return figure


def balances_picture(findings: Findings) -> Figure:
    """Show what is missing in each balance over time, with the band of the sensors' noise."""
    shown = [(k, name) for k, name in enumerate(BALANCES) if findings.evidence.fitted[k]]
    figure = new_figure(0.5 + 1.5 * max(1, len(shown)))
    axes = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
    stages = {"before": ("data sheet", NOMINAL), "refitted": ("re-fitted", REFITTED)}
    if findings.chosen is not findings.refitted:
        stages["after"] = (_added(findings), FINAL)
    for ax, (k, name) in zip(axes, shown, strict=True):
        label, factor = SHOWN[name]
        band = 2.0 * factor * findings.floor[k]
        ax.axhspan(-band, band, color=FINAL, alpha=0.12, lw=0)
        for stage, (text, colour) in stages.items():
            residual = factor * findings.residuals[stage][:, k]
            ax.plot(findings.evidence.time, residual, color=colour, lw=1.0, label=text)
        ax.set_ylabel(label)
        tidy(ax)
    axes[0].legend(ncols=3, fontsize=8, loc="lower left", bbox_to_anchor=(0.0, 1.0))
    axes[-1].set_xlabel("time, s")
    return figure


def shape_picture(findings: Findings) -> tuple[Figure, str]:
    """Show the loudest balance of the re-fitted machine against what might govern it."""
    refitted = findings.residuals["refitted"]
    name = loudest(refitted, findings.floor, findings.limit) or "force"
    k = list(BALANCES).index(name)
    label, factor = SHOWN.get(name, (name, 1.0))
    means = {key: values for key, (_, values) in findings.evidence.signals().items()}
    velocity = means["piston_velocity"]
    signals = {text: scale * means[key] for key, (text, scale) in AGAINST.items() if key in means}
    figure = new_figure(2.8)
    axes = figure.subplots(1, len(signals), sharey=True)
    for ax, (text, values) in zip(axes, signals.items(), strict=True):
        for moving, colour, where in (
            ("lowering", LOWERING, velocity < 0.0),
            ("lifting", LIFTING, velocity >= 0.0),
        ):
            ax.plot(
                values[where], factor * refitted[where, k], ".", ms=3, color=colour, label=moving
            )
        ax.set_xlabel(text)
        tidy(ax)
    axes[0].set_ylabel(f"missing {label}")
    axes[0].legend(fontsize=8, loc="best")
    return figure, name


def swing_picture(swing: Swing, findings: Findings) -> Figure:
    """Show what is left in the loudest balance of the first recording, and how it swings."""
    name = findings.speaking or ""
    label, factor = SHOWN[name]
    first = slice(findings.evidence.windows_of_first)
    residual = findings.residuals["after"][first, list(BALANCES).index(name)]
    time = findings.evidence.time[first]
    signals = findings.evidence.signals()
    values = signals[swing.predictor][1][first] if swing.predictor else np.zeros_like(time)
    figure = new_figure(2.4)
    ax = figure.subplots()
    ax.plot(time, factor * residual, ".", ms=3, color=MEASURED, label="left over")
    swung = by_swing(swing, residual, time, values)
    ax.plot(time, factor * swung, color=FINAL, lw=1.0, label="as it swings")
    ax.set_xlabel("time, s")
    ax.set_ylabel(f"missing {label}")
    ax.legend(fontsize=8, loc="best")
    tidy(ax)
    return figure


def curve_picture(curve: Curve) -> Figure:
    """Show what has no name over the signal that it depends on."""
    label, factor = PART[curve.part_unit]
    text, scale = AGAINST[curve.over]
    figure = new_figure(2.8)
    ax = figure.subplots()
    for (name, points), colour in zip(curve.parts.items(), (LIFTING, LOWERING), strict=False):
        at, size = scale * np.array(curve.signal), factor * np.array(points)
        ax.plot(at, size, ".-", ms=4, lw=1.0, color=colour, label=CURVE_PARTS[name])
    ax.set_xlabel(text)
    ax.set_ylabel(label)
    ax.legend(fontsize=8, loc="best")
    tidy(ax)
    return figure


def _added(findings: Findings) -> str:
    """Return what the final machine has more than the re-fitted one."""
    if findings.misstated:
        return f"with another {findings.misstated[0].unknowns.members[-1].path}"
    if findings.curve is None or findings.verdict == "found":
        return findings.chosen.name
    return "with the curve"

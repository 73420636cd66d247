"""What the judge recordings say of a verdict, in words."""

import math

import numpy as np

from emir_analysis.diagnosis.curves import CURVE_PARTS, Curve, visited_by
from emir_analysis.diagnosis.diagnose import Findings
from emir_analysis.diagnosis.experiment import OUTPUTS
from emir_analysis.diagnosis.judged import (
    NOMINAL,
    REFITTED,
    STAGES,
    Judged,
    carries,
    loudest_signal,
)
from emir_analysis.diagnosis.load_course import has_course
from emir_analysis.diagnosis.loads import LOAD
from emir_analysis.diagnosis.select import EXPLAINED

ANOTHER = 100.0  # times the noise: so far off what was learned is hardly of that machine
BEYOND = 0.05  # share of the judge recordings
CHAMBERS = {"lifting", "lowering"}
PLACES = 3  # of the outputs: stroke and pressures, where a machine was


def judgement(findings: Findings, judged: Judged) -> str:
    """Return what the judge recordings say of a verdict, to follow it; empty where they agree."""
    if findings.verdict == "found" and has_course(findings.chosen):
        return _elsewhere_loaded(judged) if judged.surprising else ""
    if findings.curve is not None:
        return _measured(findings.curve, findings, judged)
    if findings.misstated:
        return f", that of {judged.evidence.name} {judged.off(STAGES[-1]):.2f}"
    if findings.verdict == "unexplained":
        return _foreseen(findings, judged) + _further(findings, judged)
    if not judged.surprising:
        return ""
    off, judge = judged.off(STAGES[-1]), judged.evidence.name
    more = f"shows more{_elsewhere(findings, judged)}"
    if judged.reconciled and findings.chosen.effects:
        more += (
            ", which the same effects and other parameters inside the tolerances explain as well"
        )
    elif judged.reconciled:
        more += ", which other parameters inside the tolerances explain as well"
    if LOAD in findings.chosen.effects:
        more += "; a load from outside may have come at other times there"
    advice = "diagnose from that too"
    if off > ANOTHER and not judged.reconciled:
        advice = "see whether it is of the same machine, then " + advice
    left = _off(findings, judged) + _no_better(findings, judged)
    return f"; but {judge}, {left}, {more}: {advice}"


def _elsewhere_loaded(judged: Judged) -> str:
    """Return how far off recordings are whose load from outside nobody knows."""
    off, judge = judged.off(STAGES[-1]), judged.evidence.name
    return f"; {judge}, whose load nobody knows, is {off:.1f} times the noise off without one"


def _no_better(findings: Findings, judged: Judged) -> str:
    """Return that parameters alone do as well there, if they do."""
    off, alone = judged.off(STAGES[-1]), judged.off(REFITTED)
    if findings.chosen.effects and off > alone:
        return f", more than parameters alone ({alone:.1f})"
    return "" if carries(findings, judged) else f", hardly less than parameters alone ({alone:.1f})"


def _foreseen(findings: Findings, judged: Judged) -> str:
    """Return how far off other recordings are, and that the data sheet as it came does better."""
    off, stated = judged.off(REFITTED), judged.off(NOMINAL)
    if judged.evidence.name == findings.evidence.name or not off > EXPLAINED:
        return ""
    better = f", more than by the data sheet as it came ({stated:.1f})" if stated < off else ""
    together = f"all signals of {judged.evidence.name} together"
    return f"; {together} are {off:.1f} times the noise off{better}"


def _further(findings: Findings, judged: Judged) -> str:
    elsewhere = _elsewhere(findings, judged)
    return f"; {judged.evidence.name} goes further{elsewhere}" if elsewhere else ""


def _off(findings: Findings, judged: Judged) -> str:
    """Return how far off the judge recordings are, and in which signal most."""
    off = judged.off(STAGES[-1])
    if math.isnan(off):
        return "where it cannot even rest"
    name, alone = loudest_signal(findings.chosen.machine, judged.evidence)
    if off <= EXPLAINED:  # in one signal alone, then
        return f"where {name} is {alone:.1f} times its noise off"
    return f"all signals together {off:.1f} times the noise off, {name} {alone:.1f}"


def _elsewhere(findings: Findings, judged: Judged) -> str:
    """Return at which strokes and pressures only the judge recordings were, if at many."""
    known, shown = (
        np.concatenate([e.outputs for e in evidence.experiments])
        for evidence in (findings.evidence, judged.evidence)
    )
    found = []
    for k, name in enumerate(list(OUTPUTS)[:PLACES]):
        low, high = np.nanmin(known[:, k], initial=np.inf), np.nanmax(known[:, k], initial=-np.inf)
        outside = float(np.mean((shown[:, k] < low) | (shown[:, k] > high)))
        if outside >= BEYOND:
            found.append(f"{name} for {100 * outside:.0f} % of it")
    return f" (beyond what was learned from: {', '.join(found)})" if found else ""


def _measured(curve: Curve, findings: Findings, judged: Judged) -> str:
    effects = findings.chosen.machine.effects
    rejected = () if findings.rejected is None else findings.rejected.effects
    on = [name for name in rejected if getattr(effects, name).is_on]
    beside = f" beside {' and '.join(on)}" if on else ""
    sizes = " and ".join(_furthest(curve, name) for name in curve.parts)
    return (
        f"; measured as a curve{beside}, {curve.name} over {curve.over}, {sizes}, the free run of"
        f" {judged.evidence.name} is {judged.off(STAGES[-1]):.2f} times the noise off"
        f"{_beyond(curve, findings, judged)}"
    )


def _furthest(curve: Curve, name: str) -> str:
    """Return the point of a curve that is furthest from zero, with its sign.

    A compliance less than the vessels have, say, is not that chamber's: another has more.
    """
    furthest = int(np.nanargmax(np.abs(curve.parts[name])))
    at, value = curve.signal[furthest], curve.parts[name][furthest]
    part_unit, unit = ("" if u == "1" else f" {u}" for u in (curve.part_unit, curve.unit))
    comes_in = curve.name == "unnamed_leakage" and name in CHAMBERS and value < 0.0
    which = f"{CURVE_PARTS[name]}{', into which oil comes,' if comes_in else ''}"
    return f"as far as {value:.3g}{part_unit} {which} at {at:.3g}{unit}"


def _beyond(curve: Curve, findings: Findings, judged: Judged) -> str:
    """Return that the judge recordings go where nothing was measured, if they do."""
    parts = zip(
        visited_by(curve, findings.evidence), visited_by(curve, judged.evidence), strict=True
    )
    outside = max(float(np.mean((s < np.nanmin(k)) | (s > np.nanmax(k)))) for k, s in parts)
    if outside < BEYOND:
        return ""
    return f", of which {100 * outside:.0f} % lie beyond what it was measured at"

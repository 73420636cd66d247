"""The course of a diagnosis: balances, parameters, effects, verdict - from recordings."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from emir_analysis.diagnosis.balances import BALANCES, level
from emir_analysis.diagnosis.curves import Curve, as_far_as_recorded, curve
from emir_analysis.diagnosis.drift import Drift
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.experiment import Experiment
from emir_analysis.diagnosis.fitting import fit_balances, with_spread
from emir_analysis.diagnosis.foresight import explained
from emir_analysis.diagnosis.friction_laws import sticks
from emir_analysis.diagnosis.load_course import has_course
from emir_analysis.diagnosis.loads import LOAD
from emir_analysis.diagnosis.mounting import spring_in_series
from emir_analysis.diagnosis.search import Search
from emir_analysis.diagnosis.select import LEFT, at_noise, beyond, excess, limits, quiet
from emir_analysis.diagnosis.shape import Shape, best_shape
from emir_analysis.diagnosis.swing import Swing, swing
from emir_analysis.diagnosis.telling import open_shares
from emir_analysis.diagnosis.time_limit import TimeLimit
from emir_analysis.diagnosis.trial import Trial
from emir_analysis.diagnosis.tried import Tried
from emir_analysis.diagnosis.unnamed import Curves
from emir_analysis.diagnosis.where import Where, where
from emir_analysis.diagnosis.whole import Progress
from emir_analysis.signals import Array
from emir_common.parameter_tree import with_values
from emir_plant.parameters import Machine
from emir_plant.sheet import Sheet

SEVERAL = 3  # effects: more likely one thing that none of them is
# Times the noise: more, and an effect is only like the truth. Not of what sticks, or of a load
# whose course is told by quarters of a second.
LIKE = 1.5
FAR_LOUDER = 3.0  # times: a missing force makes the bending no louder than the force balance


@dataclass(frozen=True)
class Findings:
    """What recordings say about the machine.

    verdict: nothing_missing, found, ambiguous or unexplained. balanced: parameters only, fitted to
    the balances, refitted: to the free run of the whole recordings, chosen: likewise, with the
    effects named. rejected: the trial whose effects were best among all and yet leave too much.
    tried: all trials. rivals: those as good as the chosen one, undecided: likewise, itself with a
    share at the other end, by the share's path. residuals: (w, 5) of each balance for the machine
    as stated (`before`), `refitted` and `after`; floor: (5,) the sensors' share, limit: (5,) from
    which on a balance speaks. speaking: the balance that no effect takes down to the noise, the
    loudest or that which swings with time, shape: of its residual, swing: how that swings, where:
    most of it lies. misstated: parameters with one value of the sheet replaced, their last unknown,
    where that explains what no effect does, the best first; curve: what has no name, with either of
    which `chosen` and `after` then are, or a load's course over time. drift: of a size, where that
    makes most of what is left. stopped: s, after which the search was over before its end, None
    where it was not.
    """

    evidence: Evidence
    sheet: Sheet
    verdict: str
    balanced: Trial
    refitted: Trial
    chosen: Trial
    rejected: Trial | None
    tried: tuple[Tried, ...]
    rivals: tuple[Trial, ...]
    undecided: dict[str, Trial]
    residuals: dict[str, Array]
    floor: Array
    limit: Array
    speaking: str | None
    shape: Shape | None
    swing: Swing | None
    where: Where | None
    misstated: tuple[Trial, ...]
    curve: Curve | None
    drift: Drift | None
    stopped: float | None


def _known(experiments: Sequence[Experiment], machine: Machine) -> dict[str, float]:
    """Return what recordings say of the machine beforehand, by dotted name.

    An error of the linkage is looked for about the middle of the strokes: about an end its terms
    would be large and make up for each other.
    """
    known: dict[str, float] = {}
    if all(e.own_stroke for e in experiments):
        known["sensors.own_stroke"] = 1
    strokes = np.concatenate([e.outputs[:, 0] for e in experiments])
    if np.any(np.isfinite(strokes)) and not machine.effects.linkage_error.is_on:
        middle = 0.5 * (np.nanmin(strokes) + np.nanmax(strokes))
        known["effects.linkage_error.about"] = float(np.round(middle, 2))
    return known


def diagnose(
    experiments: Sequence[Experiment],
    sheet: Sheet,
    progress: Progress,
    time_limit: float = math.inf,
) -> Findings:
    """Find out from recordings of one machine what its data sheet lacks.

    time_limit: s, after which the search ends with the best that was found.
    """
    sheet = replace(sheet, machine=with_values(sheet.machine, _known(experiments, sheet.machine)))
    evidence = Evidence(experiments, sheet.machine, TimeLimit(time_limit))
    search = Search(evidence, sheet, progress)
    best = search.run()
    before, unaided = evidence.residuals([sheet.machine, search.balanced.machine])
    named, after = _named(best[0], unaided, search, evidence)
    rivals = [] if has_course(named) else best[1:]
    verdict = _verdict(named, after, evidence, rivals=len(rivals))
    curves = Curves(search.balanced, evidence, search.floor)
    doubts = _doubts(named, verdict, curves, search, evidence, progress)
    if doubts.any:
        verdict = "unexplained"
    final = _settled(named, verdict, search, evidence)
    if verdict == "unexplained":
        after = unaided
    floor, limit = evidence.floor(final.machine), limits(final.machine, evidence)
    speaking, shape, swings = _shape(evidence, after, loud(after, floor, limit))
    lies = None if speaking is None else _where(evidence, after, floor, speaking)
    instead = doubts.instead
    if verdict == "unexplained" and instead is None and speaking and not _drifts(named, search):
        instead = _measured(curves, best[0], search, evidence, progress)
    asked = verdict == "unexplained" and instead is None
    refitted = final if verdict == "nothing_missing" else search.refitted
    if instead is not None:
        final, after = instead, evidence.residuals([instead.machine])[0]
    return Findings(
        evidence=evidence,
        sheet=sheet,
        verdict=verdict,
        balanced=search.balanced,
        refitted=refitted,
        chosen=final,
        rejected=named if verdict == "unexplained" and named.effects else None,
        tried=tuple(search.tried),
        rivals=tuple(rivals),
        undecided={} if has_course(final) else open_shares(final, evidence),
        residuals={"before": before, "refitted": unaided, "after": after},
        floor=floor,
        limit=limit,
        speaking=speaking,
        shape=shape,
        swing=swings,
        where=lies,
        misstated=doubts.misstated,
        curve=None if doubts.misstated else _curve(final, evidence),
        drift=search.drifting if asked else None,
        stopped=evidence.limit.seconds if evidence.limit.is_over else None,
    )


def _curve(final: Trial, evidence: Evidence) -> Curve | None:
    """Return what has no name in a final machine, as far as recordings tell it."""
    found = curve(final.machine)
    return None if found is None else as_far_as_recorded(found, evidence)


def _named(best: Trial, unaided: Array, search: Search, evidence: Evidence) -> tuple[Trial, Array]:
    """Return the effects that a search ends with, fitted to the whole, and what the balances lack.

    That is (w, 5). Parameters alone where there are no effects, with which they lack `unaided`.
    """
    if search.loaded is not None:
        return search.loaded, evidence.residuals([search.loaded.machine])[0]
    if not best.effects:
        return search.refitted, unaided
    named = search.named(best)
    balanced = fit_balances(named, evidence, search.floor)
    return named, evidence.residuals([balanced.machine])[0]


def _settled(named: Trial, verdict: str, search: Search, evidence: Evidence) -> Trial:
    """Return the machine that a verdict ends with, and how sure its parameters are."""
    if verdict == "unexplained":
        return search.refitted
    final = search.whole.fitted(named) if verdict == "nothing_missing" else named
    rough = sticks(final)  # in the free run
    return final if rough or has_course(final) else with_spread(final, evidence)


class _Doubts(NamedTuple):
    """What speaks against a verdict, if there is any.

    misstated: values of the data sheet one of which says it better, curve: what else does.
    """

    any: bool = False
    misstated: tuple[Trial, ...] = ()
    curve: Trial | None = None

    @property
    def instead(self) -> Trial | None:
        """Return the trial that says it better, if there is one."""
        return next(iter(self.misstated), self.curve)


def _doubts(  # noqa: PLR0913, PLR0917 (what is asked, of what)
    named: Trial,
    verdict: str,
    curves: Curves,
    search: Search,
    evidence: Evidence,
    progress: Progress,
) -> _Doubts:
    """Ask whether a value of the sheet, a curve or a drift says better what a verdict says.

    Or play is a spring: no effect explains that, but a value of the sheet may.
    """
    is_spring = verdict != "unexplained" and spring_in_series(named, evidence) is not None
    replaced = _misstated(named, "unexplained" if is_spring else verdict, search, evidence)
    if replaced or is_spring:
        return _Doubts(any=True, misstated=tuple(replaced))
    if verdict != "found" or has_course(named) or excess(named, evidence) <= beyond(LEFT):
        return _Doubts()
    if _drifts(named, search):
        return _Doubts(any=True)
    return _Doubts() if at_noise(named, evidence) else _said_better(named, curves, progress)


def _said_better(named: Trial, curves: Curves, progress: Progress) -> _Doubts:
    """Ask whether a curve, or friction that differs with the direction, says what is left."""
    if sticks(named):
        progress("asking whether its friction differs with the direction")
        return _Doubts(any=curves.uneven(named))
    progress("asking whether a curve says it better")
    instead = curves.measured_instead(named)
    return _Doubts(any=instead is not None, curve=instead)


def _misstated(named: Trial, verdict: str, search: Search, evidence: Evidence) -> list[Trial]:
    """Return the values of the sheet one of which says clearly better what is left.

    named: the effects, and the verdict on them. Of three none alone is like what is missing.
    """
    enough = excess(named, evidence) <= beyond(LEFT) and len(named.effects) < SEVERAL
    if verdict == "nothing_missing" or (verdict != "unexplained" and enough):
        return []
    rival = search.refitted if verdict == "unexplained" else named
    return search.misstated.better_than(rival)


def _drifts(named: Trial, search: Search) -> bool:
    """Tell whether a load that leaves something in the free run may be a size that drifts.

    In the balances one that comes slowly is the same as a gauge that drifts.
    """
    return LOAD in named.effects and search.drifting is not None


def _measured(
    curves: Curves, closest: Trial, search: Search, evidence: Evidence, progress: Progress
) -> Trial | None:
    """Return what no effect explains as a curve, beside the closest effects if need be.

    None after a search that was stopped where that takes long, too.
    """

    def measured() -> Trial | None:
        progress("measuring what has no name")
        found = curves.measured()
        if found is None and closest.effects:
            progress(f"measuring what has no name beside: {closest.name}")
            found = curves.measured(fit_balances(closest, evidence, search.floor))
        return found

    return evidence.limit.afterwards(measured, lambda: progress("that takes too long: left out"))


def _verdict(final: Trial, after: Array, evidence: Evidence, *, rivals: int) -> str:
    """Return the verdict on a trial that leaves residuals, (w, 5), with so many as good as it."""
    if not quiet(level(after), limits(final.machine, evidence)) or not explained(final, evidence):
        return "unexplained"
    if not final.effects:
        return "nothing_missing"
    exact = not (sticks(final) or has_course(final))
    if exact and excess(final, evidence) > beyond(LIKE):
        return "unexplained"
    return "ambiguous" if rivals else "found"


def loudest(residual: Array, floor: Array, limit: Array) -> str | None:
    """Return the balance that is furthest above its noise, (5,), if one speaks: limit, (5,)."""
    return next(iter(loud(residual, floor, limit)), None)


def loud(residual: Array, floor: Array, limit: Array) -> list[str]:
    """Return the balances that speak, that furthest above its noise first.

    A missing force bends the boom too, so the bending counts only where nothing else speaks, or
    it is far louder than any force makes it.
    """
    left = level(residual)
    loudness = dict(zip(BALANCES, left / floor, strict=True))
    speaking = [name for name, over in zip(BALANCES, left > limit, strict=True) if over]
    first = [name for name in speaking if name != "bending"]
    if loudness["bending"] > FAR_LOUDER * max(map(loudness.__getitem__, first), default=0.0):
        first = speaking
    return sorted(first or speaking, key=loudness.__getitem__, reverse=True)


def _shape(
    evidence: Evidence, residual: Array, speaking: Sequence[str]
) -> tuple[str | None, Shape | None, Swing | None]:
    """Return the balance that says most of what is missing, against what, and how it swings.

    The first of those that speak that swings with time, else the loudest. Swings are the first
    recording's: how long there was between two of them nobody knows.
    """
    signals = evidence.signals()
    time = signals.pop("time")[1]
    first = slice(evidence.windows_of_first)
    own = {name: (unit, values[first]) for name, (unit, values) in signals.items()}
    found: list[tuple[str, Shape, Swing | None]] = []
    for name in speaking:
        left = residual[:, list(BALANCES).index(name)]
        shape = best_shape(left, signals["piston_velocity"][1], signals)
        found.append((name, shape, swing(left[first], time[first], own, shape)))
    swinging = [each for each in found if each[2] is not None]
    return next(iter([*swinging, *found]), (None, None, None))


def _where(evidence: Evidence, residual: Array, floor: Array, speaking: str) -> Where:
    column = list(BALANCES).index(speaking)
    signals = evidence.signals()
    del signals["time"]
    return where(residual[:, column], float(floor[column]), evidence.time, signals)

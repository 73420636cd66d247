"""What no effect explains, measured: the missing force on the piston as a curve in the machine.

The balance says what is missing over windows of a second; the free run, begun from there, knows
the curve as finely as the piston goes over it.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.optimize import lsq_linear

from emir_analysis.diagnosis.balances import FORCE, FORCE_WINDOW
from emir_analysis.diagnosis.candidates import ACCURACY, GROWING, Trial, free_run_problem
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.fit import Problem, fit
from emir_analysis.diagnosis.select import SEEN, STRONG, free_run_score
from emir_analysis.diagnosis.unknowns import ROUNDING, Unknown, Unknowns
from emir_analysis.signals import Array
from emir_common.parameter_tree import with_values
from emir_common.quantity import quantities
from emir_plant.parameters import Machine
from emir_plant.unnamed_force import NOTHING, POINTS, STROKE, VELOCITY

BALANCE = "force"
OVER = {"piston_stroke": STROKE, "piston_velocity": VELOCITY}  # what a curve can run over
UNITS = {"piston_stroke": "m", "piston_velocity": "m/s"}
TOLD = 0.5  # share of the balance's variance from which on a curve is measured
BENT = 0.1  # standard deviation of a curve's second differences, in units of its size
MOST = 5.0  # times the size of what the balance shows: a curve goes no further
ALONG, FRICTION = "along", "friction"  # whatever the direction of motion, against it
FORMS = {
    "piston_stroke": ((ALONG,), (FRICTION,), (ALONG, FRICTION)),
    "piston_velocity": ((ALONG,),),  # what turns round with the velocity is in it
}


@dataclass(frozen=True)
class Curve:
    """A missing force on the piston, N, over a signal, (p,) each.

    along: whatever the direction, positive where it lifts. friction: against the motion.
    """

    over: str
    unit: str
    signal: tuple[float, ...]
    along: tuple[float, ...]
    friction: tuple[float, ...]


def measured(known: Trial, evidence: Evidence, floor: Array) -> Trial | None:
    """Return a trial without effects, and the missing force as a curve in its machine.

    known: without it, fitted to the free run of the whole recordings. floor: (5,) of the balances.
    None where no curve makes most of what the balance lacks, or where the free run behind what
    the fit has seen is no nearer for it.
    """
    begun = [_begun(known, over, evidence, floor) for over in OVER]
    best = min(begun, key=lambda b: b.criterion)
    if best.share < TOLD:
        return None
    part = _fitted(best.trial, evidence.head(SEEN), (*GROWING, 1.0))
    # no point of the curve was fitted to that part, so they do not count as parameters
    score = partial(free_run_score, evidence=evidence, unknowns=0)
    if score(part) > score(known) - STRONG:
        return None
    return _fitted(part, evidence, (1.0,))


def curve(machine: Machine) -> Curve | None:
    """Return the curve that a machine has, if it has one."""
    force = machine.unnamed_force
    if force.curve_over == NOTHING:
        return None
    over = next(name for name, code in OVER.items() if code == force.curve_over)
    signal = np.linspace(force.curve_first, force.curve_last, POINTS)
    points = tuple(map(float, signal))
    return Curve(over, UNITS[over], points, force.curve_along, force.curve_friction)


def _fitted(start: Trial, evidence: Evidence, shares: Sequence[float]) -> Trial:
    """Return a trial fitted to the free run of shares of the recordings, one after the other.

    Where that tells the curves no more than the balance does, they stay smooth.
    """
    x, trial = np.append(start.x, np.zeros(2 * len(evidence.experiments))), start
    for share in shares:
        solution = fit(_smoothly(free_run_problem(trial, evidence, x, share), trial), ACCURACY)
        x, trial = solution.x, trial.continued(solution)
    return trial


def _smoothly(problem: Problem, trial: Trial) -> Problem:
    """Return a problem in which the curves' second differences are errors, too."""
    paths = [unknown.path for unknown in trial.unknowns.members]
    bending = [
        np.diff(
            np.eye(problem.start.size)[[k for k, p in enumerate(paths) if form in p]], 2, axis=0
        )
        for form in (f"curve_{ALONG}.", f"curve_{FRICTION}.")
    ]
    rows = np.vstack(bending) / BENT

    def smooth(model: Callable[[Array], Array]) -> Callable[[Array], Array]:
        return lambda points: np.hstack([model(points), points @ rows.T])

    coarse = problem.coarse or problem.model
    return replace(problem, model=smooth(problem.model), coarse=smooth(coarse))


class _Begun(NamedTuple):
    """A trial with a curve as the balance has it.

    criterion: Bayesian, smaller is better. share: of the variance that the curve explains.
    """

    trial: Trial
    criterion: float
    share: float


class _Smooth(NamedTuple):
    """Points of curves, (c p,), with a criterion and a share as in `_Begun`."""

    points: Array
    criterion: float
    share: float


def _begun(known: Trial, over: str, evidence: Evidence, floor: Array) -> _Begun:
    """Return the trial with the smoothest curves that the force balance allows."""
    first, last = _ends(over, evidence)
    values = {"curve_over": OVER[over], "curve_first": first, "curve_last": last}
    named = {f"unnamed_force.{name}": value for name, value in values.items()}
    machine = with_values(known.machine, named)
    left = evidence.residuals([machine])[0, :, FORCE] / floor[FORCE]
    size = float(np.sqrt(np.mean(left**2)) * floor[FORCE])
    members = {form: _points(form, size) for form in (ALONG, FRICTION)}
    both = Unknowns(machine, tuple(u for form in members.values() for u in form))
    # what is missing is linear in the curves' points
    moved = evidence.residuals([both.at(x) for x in np.eye(len(both.members))])
    slopes = (moved[:, :, FORCE] / floor[FORCE] - left).T
    each = dict(zip(members, np.split(slopes, len(members), axis=1), strict=True))
    independent = evidence.duration(1.0) / FORCE_WINDOW
    fits = {
        form: _smoothest(left, np.hstack([each[f] for f in form]), len(form), independent)
        for form in FORMS[over]
    }
    form = min(fits, key=lambda f: fits[f].criterion)
    chosen = tuple(u for f in form for u in members[f])
    x = np.append(known.x, np.clip(fits[form].points, *Unknowns(machine, chosen).bounds))
    if FRICTION in form:
        chosen, x = (*chosen, _smoothing(machine)), np.append(x, 0.0)
    everything = Unknowns(machine, (*known.unknowns.members, *chosen))
    trial = Trial((), everything, x, np.full((x.size, x.size), np.nan))
    return _Begun(trial, fits[form].criterion, fits[form].share)


def _points(form: str, size: float) -> tuple[Unknown, ...]:
    """Return a curve's points as unknowns in units of what the balance shows, N."""
    least = 0.0 if form == FRICTION else -MOST
    return tuple(
        Unknown(f"unnamed_force.curve_{form}.{k}", "N", 0.0, size, least, MOST, 0.0, False)
        for k in range(POINTS)
    )


def _smoothing(machine: Machine) -> Unknown:
    """Return the speed at which friction turns round, between two windows of the balance."""
    name = "curve_smoothing_speed"
    about = quantities(machine.unnamed_force)[name]
    usual = machine.unnamed_force.curve_smoothing_speed
    low, high = math.log(about.low / usual) + ROUNDING, math.log(about.high / usual) - ROUNDING
    return Unknown(f"unnamed_force.{name}", about.unit, usual, 1.0, low, high, 0.0, False, True)


def _ends(over: str, evidence: Evidence) -> tuple[float, float]:
    """Return the least and the greatest value, SI unit, that a curve's signal takes."""
    if OVER[over] == STROKE:
        strokes = np.concatenate([e.outputs[:, 0] for e in evidence.experiments])
        return float(strokes.min()), float(strokes.max())
    return -evidence.fastest, evidence.fastest


def _smoothest(missing: Array, slopes: Array, curves: int, independent: float) -> _Smooth:
    """Return the curves' points by least squares.

    missing: (w,), slopes: (w, c p), in units of the noise. A curve's second differences are
    expected to be small beside its size, and count as errors; parameters are those that the
    balance tells in spite of that (the trace of the hat matrix). independent: windows.
    """
    bending = np.diff(np.eye(POINTS), 2, axis=0) / BENT
    rows = np.vstack([slopes, np.kron(np.eye(curves), bending)])
    wanted = np.append(-missing, np.zeros(len(rows) - missing.size))
    x = np.asarray(lsq_linear(rows, wanted).x)
    told = np.trace(np.linalg.pinv(rows.T @ rows) @ (slopes.T @ slopes))
    left, before = float(np.mean((missing + slopes @ x) ** 2)), float(np.mean(missing**2))
    criterion = independent * math.log(left) + float(told) * math.log(independent)
    return _Smooth(x, criterion, 1.0 - left / before)

"""What no effect explains, measured: as a curve in the machine over one of its signals.

The balances say what is missing over windows of half a second and more; the free run, begun from
there, knows the curve as finely as the machine goes over it.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import lsq_linear

from emir_analysis.diagnosis.balances import BALANCES, FORCE_WINDOW
from emir_analysis.diagnosis.candidates import ACCURACY, GROWING, Trial, free_run_problem
from emir_analysis.diagnosis.curves import CHAMBERS, KINDS, Kind, ends, told_forms
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.fit import STEP, TOLERANCE_SPREAD, Problem, fit
from emir_analysis.diagnosis.select import EXPLAINED, STRONG, excess, free_run_score
from emir_analysis.diagnosis.unknowns import ROUNDING, Unknown, Unknowns
from emir_analysis.signals import Array
from emir_common.parameter_tree import with_values
from emir_common.quantity import quantities
from emir_plant.curve import POINTS
from emir_plant.parameters import Machine
from emir_plant.unnamed import UNNAMED

TOLD = 0.5  # share of the balances' squares above the noise from which on a curve is measured
BENT = 0.1  # standard deviation of a curve's second differences, in units of its size
MOST = 10.0  # times its size: a curve goes no further
BENDING: Array = np.diff(np.eye(POINTS), 2, axis=0) / BENT  # (p - 2, p), of a curve over its size
SMOOTHING = "smoothing_speed"


def measured(balanced: Trial, evidence: Evidence, floor: Array) -> Trial | None:
    """Return a trial that names no effects, and what is missing as a curve in its machine.

    balanced: without it, fitted to the balances of the whole recordings; effects that it has stay
    in the machine. floor: (5,) of the balances. None where no curve makes most of what they lack,
    or where with it the free run is not explained.
    """
    best = _Balances(balanced, evidence, floor).best()
    if best is None or best.share < TOLD:
        return None
    found = _fitted(best.trial, evidence)
    return found if excess(found, evidence) <= EXPLAINED**2 - 1.0 else None


def measured_instead(
    named: Trial, balanced: Trial, evidence: Evidence, floor: Array
) -> Trial | None:
    """Return the same where a curve says clearly what effects only come near, each point counted.

    named: with effects. balanced: without. A leak through a hole is near one in proportion to the
    pressure in every balance, but not in the free run, which adds up what they hardly know of.
    """
    best = _Balances(balanced, evidence, floor).best()
    if best is None:
        return None
    found = _fitted(best.trial, evidence)
    limit = free_run_score(named, evidence, seen=0.0) - STRONG
    return found if free_run_score(found, evidence, seen=0.0) < limit else None


def _fitted(start: Trial, evidence: Evidence) -> Trial:
    """Return a trial fitted to the free run of the recordings, first of their beginning.

    That is left out where the balances' curve explains the whole. What the free run tells less
    than they do stays as they say.
    """
    begin = np.append(start.x, np.zeros(2 * len(evidence.experiments)))
    x, trial = begin, start
    near = excess(start, evidence) <= EXPLAINED**2 - 1.0
    for share in (1.0,) if near else (*GROWING, 1.0):
        problem = free_run_problem(trial, evidence, x, share)
        solution = fit(_smoothly(problem, trial, begin), ACCURACY)
        x, trial = solution.x, trial.continued(solution)
    return trial


def _smoothly(problem: Problem, trial: Trial, begin: Array) -> Problem:
    """Return a problem in which second differences of the curves' changes are errors, too.

    begin: (k,) from where they change.
    """
    lists = [u.path.rpartition(".")[0] for u in trial.unknowns.members]
    each = [np.flatnonzero(np.array(lists) == name) for name in dict.fromkeys(lists)]
    unit = np.eye(begin.size)
    rows = np.vstack([BENDING @ unit[k] for k in each if k.size == POINTS])

    def smooth(model: Callable[[Array], Array]) -> Callable[[Array], Array]:
        return lambda points: np.hstack([model(points), (points - begin) @ rows.T])

    coarse = problem.coarse or problem.model
    return replace(problem, model=smooth(problem.model), coarse=smooth(coarse))


class _Begun(NamedTuple):
    """A trial with curves as the balances have them.

    criterion: Bayesian, smaller is better. share: of the squares that the curves explain.
    """

    trial: Trial
    criterion: float
    share: float


class _Balances:
    """What the balances lack, linear in parameters and curves about a fitted trial."""

    def __init__(self, known: Trial, evidence: Evidence, floor: Array) -> None:
        self._known, self._evidence, self._floor = known, evidence, floor
        steps = np.where(known.x + STEP > known.unknowns.bounds[1], -STEP, STEP)
        moved = map(known.unknowns.at, known.x + np.diag(steps))
        left = evidence.residuals([known.machine, *moved])
        self._rms = dict(zip(BALANCES, np.sqrt(np.mean(left[0] ** 2, axis=0)), strict=True))
        missing = self._in_noise(left)
        self._missing = missing[0]
        self._slopes = np.nan_to_num(((missing[1:] - missing[0]) / steps[:, None]).T)
        self._independent = evidence.duration(1.0) / FORCE_WINDOW

    def _in_noise(self, left: Array) -> Array:
        """Return what is missing in each balance, (m, w, 5), as (m, n) in units of the noise."""
        fitted = (left / self._floor)[:, :, self._evidence.fitted]
        return np.asarray(fitted.reshape(len(left), -1))

    def best(self) -> _Begun | None:
        """Return the trial with a curve that the balances prefer, if there is any."""
        begun = [start for kind in KINDS for start in self._begun(kind)]
        return min(begun, key=lambda b: b.criterion, default=None)

    def _begun(self, kind: Kind) -> list[_Begun]:
        """Return trials with the smoothest curves that the balances allow, one for each form."""
        forms = told_forms(kind, self._evidence)
        if not forms:
            return []
        first, last = ends(kind, self._evidence)
        values = {"over": kind.code, "first": first, "last": last}
        named = {f"{kind.group}.{name}": value for name, value in values.items()}
        machine = with_values(self._known.machine, named)
        names = dict.fromkeys(name for form in forms for name in form)
        members = {name: _points(kind, name, self._size(kind)) for name in names}
        slopes = {name: self._of_points(machine, points) for name, points in members.items()}
        found = []
        for form in forms:
            points = tuple(u for name in form for u in members[name])
            found.append(self._smoothest(machine, points, [slopes[n] for n in form]))
        return found

    def _size(self, kind: Kind) -> float:
        """Return the size of what is missing, in the unit of a kind's curves."""
        if kind.group == "unnamed_force":
            return float(self._rms["force"])
        flow = max(f for name, f in self._rms.items() if name in CHAMBERS and np.isfinite(f))
        if kind.group == "unnamed_leakage":
            return float(flow)
        if kind.group == "unnamed_compliance":
            cylinder = self._known.machine.cylinder
            return cylinder.volume_lifting_0 / cylinder.beta
        speed = self._evidence.signals()["piston_velocity"][1]
        swept = self._known.machine.cylinder.area_lifting * np.sqrt(np.mean(speed**2))
        return float(flow / swept)

    def _of_points(self, machine: Machine, points: tuple[Unknown, ...]) -> Array:
        """Return the slopes, (n, p), of what is missing by a curve's points."""
        alone = Unknowns(machine, points)
        moved = self._evidence.residuals([alone.at(x) for x in np.eye(len(points))])
        return np.asarray(np.nan_to_num((self._in_noise(moved) - self._missing).T))

    def _smoothest(
        self, machine: Machine, points: tuple[Unknown, ...], slopes: list[Array]
    ) -> _Begun:
        """Return the trial by least squares, parameters and points inside their bounds.

        slopes: (n, p) of each curve. Curves' second differences are expected to be small beside
        their size, parameters to be as stated.
        """
        known, curves = self._known, np.hstack(slopes)
        stated = np.diag(np.where(known.unknowns.toleranced, 1.0 / TOLERANCE_SPREAD, 0.0))
        bending = np.asarray(np.kron(np.eye(len(slopes)), BENDING), dtype=np.float64)
        straight = np.hstack([self._slopes, curves])
        rows = np.vstack([straight, block_diag(stated, bending)])
        wanted = np.concatenate([-self._missing, -stated @ known.x, np.zeros(len(bending))])
        everything = Unknowns(machine, (*known.unknowns.members, *points))
        begin, (low, high) = np.append(known.x, np.zeros(len(points))), everything.bounds
        room = low - begin - ROUNDING, high - begin + ROUNDING  # the solver wants some
        x = np.clip(begin + lsq_linear(rows, wanted, room).x, low, high)
        left = self._missing + straight @ (x - begin)
        share = 1.0 - _above_noise(left) / _above_noise(self._missing)
        criterion = self._criterion(left, curves, bending)
        return _Begun(_with_smoothing(everything, x), criterion, share)

    def _criterion(self, left: Array, curves: Array, bending: Array) -> float:
        """Return a Bayesian criterion of what is left, (n,), in units of the noise.

        curves: (n, c p) slopes by the points of c curves, bending: their second differences.
        The points count as the parameters that the balances tell in spite of what is expected of
        the second differences: the trace of the hat matrix.
        """
        balances = left.reshape(-1, np.count_nonzero(self._evidence.fitted))
        squares = np.maximum(np.mean(balances**2, axis=0), 1.0)
        misfit = self._independent * float(np.sum(np.log(squares)))
        told = curves.T @ curves
        count = float(np.trace(np.linalg.pinv(told + bending.T @ bending) @ told))
        return misfit + count * math.log(self._independent * squares.size)


def _above_noise(left: Array) -> float:
    """Return the squares of what is left, (n,), in units of the noise, above those of the noise."""
    return max(float(np.sum(left**2 - 1.0)), 1.0)


def _with_smoothing(unknowns: Unknowns, x: Array) -> Trial:
    """Return the trial of a curve, where it is friction with the speed at which it turns round.

    That lies between two windows of the balances.
    """
    if any(u.path.startswith("unnamed_force.friction.") for u in unknowns.members):
        members = (*unknowns.members, _smoothing(unknowns.machine))
        unknowns, x = Unknowns(unknowns.machine, members), np.append(x, 0.0)
    return Trial((), unknowns, x, np.full((x.size, x.size), np.nan))


def _smoothing(machine: Machine) -> Unknown:
    about = quantities(machine.unnamed_force)[SMOOTHING]
    usual = machine.unnamed_force.smoothing_speed
    low, high = math.log(about.low / usual) + ROUNDING, math.log(about.high / usual) - ROUNDING
    path = f"unnamed_force.{SMOOTHING}"
    return Unknown(path, about.unit, usual, 1.0, low, high, 0.0, False, True)


def _points(kind: Kind, name: str, size: float) -> tuple[Unknown, ...]:
    """Return a curve's points as unknowns in units of a size."""
    about = quantities(UNNAMED[kind.group])[name]
    low, high = max(about.low / size, -MOST), min(about.high / size, MOST)
    return tuple(
        Unknown(f"{kind.group}.{name}.{k}", about.unit, 0.0, size, low, high, 0.0, False)
        for k in range(POINTS)
    )

"""What no effect explains, measured: as a curve in the machine over one of its signals.

The balances say what is missing over windows of half a second and more; the free run, begun from
there, knows the curve as finely as the machine goes over it.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from emir_analysis.diagnosis.balances import BALANCES, FORCE, FORCE_WINDOW, level
from emir_analysis.diagnosis.curves import BY_VELOCITY, CHAMBERS, KINDS, Kind, ends, told_forms
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.fit import DIFFERENCE_STEP, Problem, fit
from emir_analysis.diagnosis.fitting import GLIMPSE, GROWING, fit_balances, free_run_problem
from emir_analysis.diagnosis.missing import in_balances
from emir_analysis.diagnosis.run_errors import FREE_RUN_ACCURACY
from emir_analysis.diagnosis.select import (
    EXPLAINED,
    HOPELESS,
    STRONG,
    beyond,
    excess,
    free_run_score,
    limits,
    quiet,
    score,
)
from emir_analysis.diagnosis.straight import Straight
from emir_analysis.diagnosis.trial import Trial
from emir_analysis.diagnosis.unknowns import ROUNDING, Unknown, Unknowns
from emir_analysis.root_mean_square import column_rms
from emir_analysis.signals import Array
from emir_common.parameter_tree import with_values
from emir_common.quantity import quantities
from emir_plant.curve import POINTS
from emir_plant.parameters import Machine
from emir_plant.unnamed import UNNAMED

MEASURED_SHARE = 0.5  # of the balances' squares above the noise, from which on it is measured
BENT = 0.1  # standard deviation of a curve's second differences, in units of its size
LARGEST_SIZE = 10.0  # times its size: a curve goes no further
SMOOTHING = "smoothing_speed"
FRICTION = "_friction"  # how all of it is called


class Curves:
    """The curves that a machine may be given for what no effect explains.

    balanced: without effects, fitted to the balances of the whole recordings. floor: (5,) of the
    balances. What they lack by the points of each curve is found once, beside `balanced`, and
    taken to be the same beside effects.
    """

    def __init__(self, balanced: Trial, evidence: Evidence, floor: Array) -> None:
        self._balanced, self._evidence, self._floor = balanced, evidence, floor

    @cached_property
    def _balances(self) -> "_Balances":
        return self._about(self._balanced)

    def _about(self, known: Trial) -> "_Balances":
        return _Balances(known, self._evidence, self._floor)

    @cached_property
    def _forms(self) -> list["_Form"]:
        return [form for kind in KINDS for form in self._balances.forms(kind)]

    def measured(self, beside: Trial | None = None) -> Trial | None:
        """Return a trial that names no effects, and what is missing as a curve in its machine.

        beside: a trial fitted to the balances, whose effects stay in the machine. None where no
        curve makes most of what they lack, or where with it the free run is not explained or a
        balance still speaks.
        """
        balances = self._balances if beside is None else self._about(beside)
        best = balances.best(self._forms)
        if best is None or best.share < MEASURED_SHARE:
            return None
        found = fitted_smoothly(best.trial, self._evidence)
        if not excess(found, self._evidence) <= beyond(EXPLAINED):  # NaN of a run out of bounds
            return None
        left = level(self._evidence.residuals([found.machine])[0])
        return found if quiet(left, limits(found.machine, self._evidence)) else None

    def uneven(self, named: Trial) -> bool:
        """Tell whether friction that differs with the direction says the balances clearly better.

        named: with dry friction, and maybe effects beside it, of which a sensor's bias comes near
        that: such friction is an even one and a constant force that acts in motion alone, beside
        those effects or without them. All as the balances have them: the free run of what sticks is
        rough. False where these do not tell a force.
        """
        if not self._evidence.told[FORCE]:
            return False
        friction = named
        for effect in named.effects:
            if not effect.endswith(FRICTION):
                friction = friction.without(effect)
        fitted = [fit_balances(each, self._evidence, self._floor) for each in (named, friction)]
        as_named, even = (self._about(each) for each in fitted)
        without = min(as_named.as_it_is(), even.as_it_is())
        pushed = min(even.with_force_in_motion(), as_named.with_force_in_motion())
        return pushed < without - STRONG

    def measured_instead(self, named: Trial) -> Trial | None:
        """Return the same where a curve says clearly what effects only come near.

        Each point counted. named: with effects. A leak through a hole is near one in proportion to
        the pressure in every balance, but not in the free run, which adds up what they hardly know.
        """
        best = self._balances.best(self._forms)
        if best is None:
            return None
        found = fitted_smoothly(best.trial, self._evidence)
        limit = free_run_score(named, self._evidence, seen=0.0) - STRONG
        return found if free_run_score(found, self._evidence, seen=0.0) < limit else None


def bending(points: int, bent: float = BENT) -> Array:
    """Return the second differences, (p - 2, p), of a curve over its size, in units of `bent`."""
    return np.asarray(np.diff(np.eye(points), 2, axis=0) / bent)


def fitted_smoothly(start: Trial, evidence: Evidence, bent: float = BENT) -> Trial:
    """Return a trial with curves fitted to the free run of recordings, first of their beginning.

    That is left out where the balances' curve explains the whole. What the free run tells less
    than they do stays as they say. A curve that leaves more in a part than the whole may have left
    stays as fitted to that, and one that is hopeless after a few steps is not polished. bent: what
    is expected of the curves, as for `bending`.
    """
    begin = np.append(start.x, np.zeros(2 * len(evidence.experiments)))
    x, trial = begin, start
    near = excess(start, evidence) <= beyond(EXPLAINED)
    for share in (1.0,) if near else (*GROWING, 1.0):
        problem = _smoothly(free_run_problem(trial, evidence, x, share), trial, begin, bent)
        solution = fit(problem, FREE_RUN_ACCURACY, evaluations=GLIMPSE)
        if solution.misfit <= HOPELESS:
            solution = fit(replace(problem, start=solution.x), FREE_RUN_ACCURACY)
        x, trial = solution.x, trial.continued(solution)
        if share * (solution.misfit**2 - 1.0) > beyond(EXPLAINED):
            break
    return trial


def _smoothly(problem: Problem, trial: Trial, begin: Array, bent: float) -> Problem:
    """Return a problem in which second differences of the curves' changes are errors, too.

    begin: (k,) from where they change.
    """
    lists = [u.path.rpartition(".")[0] for u in trial.unknowns.members if is_point(u.path)]
    paths = np.array([u.path.rpartition(".")[0] for u in trial.unknowns.members])
    each = [np.flatnonzero(paths == name) for name in dict.fromkeys(lists)]
    unit = np.eye(begin.size)
    rows = np.vstack([bending(k.size, bent) @ unit[k] for k in each])

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


class _Form(NamedTuple):
    """One or two curves over a signal.

    named: what else a machine then has. points: of all curves. slopes: (n, c p) of what the
    balances lack, in units of the noise, by the points of c curves.
    """

    named: dict[str, float]
    points: tuple[Unknown, ...]
    slopes: Array


class _Balances:
    """What the balances lack, linear in parameters and curves about a fitted trial."""

    def __init__(self, known: Trial, evidence: Evidence, floor: Array) -> None:
        self._known, self._evidence, self._floor = known, evidence, floor
        self._straight = Straight(known, in_balances(evidence, floor), DIFFERENCE_STEP)
        left = evidence.residuals([known.machine])[0]
        self._rms = dict(zip(BALANCES, column_rms(left), strict=True))
        self._independent = evidence.duration(1.0) / FORCE_WINDOW

    def as_it_is(self) -> float:
        """Return the criterion of the known trial."""
        return self._score(self._straight.left, self._known.x.size)

    def with_force_in_motion(self) -> float:
        """Return the criterion with a force beside that is the same at any velocity but none."""
        kind = next(k for k in KINDS if k.over == BY_VELOCITY)
        first, last = ends(kind, self._evidence)
        moving = np.abs(np.linspace(first, last, POINTS)) > 0.5 * (last - first) / (POINTS - 1)
        size = self._size(kind)
        values = {f"{kind.group}.along.{k}": size * on for k, on in enumerate(moving)}
        machine = with_values(self._known.machine, self._named(kind) | values)
        pushed = self._evidence.in_noise(self._evidence.residuals([machine]), self._floor)[0]
        slope = np.nan_to_num(pushed - self._straight.left)
        force = Unknown(f"{kind.group}.along", "N", 0.0, size, -np.inf, np.inf, 0.0, False)
        x, left = self._straight.least([(force, slope)])
        return self._score(left, x.size)

    def best(self, forms: Sequence[_Form]) -> _Begun | None:
        """Return the trial with the curves that the balances prefer, if there is any."""
        return min(map(self._smoothest, forms), key=lambda b: b.criterion, default=None)

    def forms(self, kind: Kind) -> list[_Form]:
        """Return the curves of a kind that the sensors allow."""
        told = told_forms(kind, self._evidence)
        if not told:
            return []
        named = self._named(kind)
        machine = with_values(self._known.machine, named)
        names = dict.fromkeys(name for form in told for name in form)
        points = {name: _points(kind, name, self._size(kind)) for name in names}
        slopes = {name: self._of_points(machine, points[name]) for name in names}
        return [
            _Form(
                named,
                tuple(u for name in form for u in points[name]),
                np.hstack([slopes[name] for name in form]),
            )
            for form in told
        ]

    def _named(self, kind: Kind) -> dict[str, float]:
        """Return over what a kind's curves run, by dotted path."""
        first, last = ends(kind, self._evidence)
        values = {"over": kind.code, "first": first, "last": last}
        return {f"{kind.group}.{name}": value for name, value in values.items()}

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
        missing = self._evidence.in_noise(moved, self._floor)
        return np.asarray(np.nan_to_num((missing - self._straight.left).T))

    def _smoothest(self, form: _Form) -> _Begun:
        """Return the trial whose curves' second differences are small beside their size."""
        known = self._known
        count = len(form.points) // POINTS
        bent = np.asarray(np.kron(np.eye(count), bending(POINTS)), dtype=np.float64)
        machine = with_values(known.machine, form.named)
        everything = Unknowns(machine, (*known.unknowns.members, *form.points))
        points = list(zip(form.points, form.slopes.T, strict=True))
        expected = np.hstack([np.zeros((len(bent), known.x.size)), bent])
        x, left = self._straight.least(points, expected)
        share = 1.0 - _above_noise(left) / _above_noise(self._straight.left)
        criterion = self._criterion(left, form.slopes, bent)
        return _Begun(_with_smoothing(everything, x), criterion, share)

    def _criterion(self, left: Array, curves: Array, bent: Array) -> float:
        """Return a Bayesian criterion of what is left, (n,), in units of the noise.

        curves: (n, c p) slopes by the points of c curves, bent: their second differences.
        The points count as the parameters that the balances tell in spite of what is expected of
        the second differences: the trace of the hat matrix.
        """
        told = curves.T @ curves
        return self._score(left, np.trace(np.linalg.pinv(told + bent.T @ bent) @ told))

    def _score(self, left: Array, count: float) -> float:
        """Return the criterion of what is left, (n,), in units of the noise, by so many numbers."""
        balances = left.reshape(-1, np.count_nonzero(self._evidence.fitted))
        return score(np.maximum(np.mean(balances**2, axis=0), 1.0), self._independent, count)


def is_point(path: str) -> bool:
    """Tell whether a parameter, by dotted path, is a point of a curve."""
    return path.partition(".")[0] in UNNAMED and path.rpartition(".")[2].isdecimal()


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
    low, high = max(about.low / size, -LARGEST_SIZE), min(about.high / size, LARGEST_SIZE)
    return tuple(
        Unknown(f"{kind.group}.{name}.{k}", about.unit, 0.0, size, low, high, 0.0, False)
        for k in range(POINTS)
    )

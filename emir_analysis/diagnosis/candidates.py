"""What is tried: the machine as it is, and with effects of the registry.

Every trial is fitted twice: on the balances, which is quick and finds its way from anywhere,
and from there on the free run.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import product

import numpy as np
from numpy.typing import NDArray

from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.experiment import Experiment
from emir_analysis.diagnosis.fit import (
    DIFFERENCE_STEP,
    STRAIGHT_STEP,
    Problem,
    Solution,
    covariance,
    fit,
    mean_squares,
)
from emir_analysis.diagnosis.free_run import COMPARED, free_runs
from emir_analysis.diagnosis.starts import Starts
from emir_analysis.diagnosis.unknowns import Unknown, Unknowns, unknowns
from emir_analysis.signals import Array
from emir_common.parameter_tree import with_values
from emir_plant import integration
from emir_plant.effects import REGISTRY
from emir_plant.parameters import Machine
from emir_plant.sheet import Sheet

SCREENING_ACCURACY = 1e-3  # relative; the free run continues from there
FREE_RUN_ACCURACY = 1e-3  # relative, of the free run's squared error: 0.05 % of the error
FINE_ACCURACY = 1e-5  # the same of the last fit: flat directions still matter on another recording
BEGINNING_ACCURACY = 3e-2  # the same where only the way to the optimum is wanted
POLISHED = 2.0  # RMS error in units of the noise beyond which flat directions do not matter yet
HOPELESS = 5.0  # RMS error in units of the noise beyond which a model is not near the truth
HOPELESS_ACCURACY = 0.1  # relative
BEHIND = 1.5  # times the error of what a trial has to beat: further off, a fine fit changes nothing
GLIMPSE = 8  # evaluations of a fit that may lead nowhere
GROWING = (0.08, 0.25)  # shares of a recording to which the free run is fitted before the whole
FREE_RUN_STEP = 3e-2  # as fit.DIFFERENCE_STEP, of a free run: sticking makes it rough
MOST_SHAPING = 3  # fields of an effect, beside its sizes, that are tried in all combinations
SHAPE_STEP = math.log(4.0)  # between those that are tried of a field that is fitted as its log
SHORTEST_FOLLOWED, FOLLOWED_GROWTH = 5.0, 1.5  # s, and times, of a beginning that grows
BEGINNING_EXPLAINED = 1.15  # RMS error in units of the noise, the most
DRY = ("coulomb_friction", "stribeck_friction", "pressure_dependent_friction")
STOPPING = {*DRY, "backlash"}  # under which the piston stops or seats: coarse steps do not follow
SETTLING = 5.0  # s from the start in which the state at rest is found
RESTS = 21  # pressures at rest, from the least to the most, that are tried where none is shown


@dataclass(frozen=True)
class Trial:
    """A set of effects with fitted parameters.

    x: (k,). covariance: (k, k) of x, from the curvature of the last fit; NaN before.
    """

    effects: tuple[str, ...]
    unknowns: Unknowns
    x: Array
    covariance: Array

    @property
    def name(self) -> str:
        """The effects' names."""
        return " + ".join(self.effects) or "parameters only"

    @property
    def machine(self) -> Machine:
        """The machine with the fitted parameters."""
        return self.unknowns.at(self.x)

    @property
    def spread(self) -> Array:
        """Standard deviations of x, (k,)."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))

    def at(self, x: Array) -> "Trial":
        """Return the trial with other parameters, (k,)."""
        return Trial(self.effects, self.unknowns, x, self.covariance)

    def without(self, effect: str) -> "Trial":
        """Return the trial with one effect less."""
        others = tuple(name for name in self.effects if name != effect)
        gone = [u.path for u in self.unknowns.members if u.path.startswith(f"effects.{effect}.")]
        return replace(self._less(gone), effects=others)

    def cost_without(self, effect: str) -> float:
        """Return by how much leaving an effect out adds to the squared errors, to first order.

        In units of the noise, all else doing its best. 0 where that is not told, and where a size
        is fitted by its logarithm, since that is never 0.
        """
        members, own = self.unknowns.members, f"effects.{effect}."
        sizes = [k for k, u in enumerate(members) if u.path.startswith(own) and not u.shapes]
        if any(members[k].logarithmic for k in sizes):
            return 0.0
        spread = self.covariance[np.ix_(sizes, sizes)]
        if not np.all(np.isfinite(spread)):
            return 0.0
        off = self.x[sizes] - [members[k].at(0.0) for k in sizes]
        return float(off @ np.linalg.pinv(spread) @ off)

    def with_one_size(self, effect: str, size: str) -> "Trial":
        """Return the trial with the other sizes of an effect at 0, no longer to be fitted."""
        return self._less([f"effects.{effect}.{s}" for s in REGISTRY[effect].sizes if s != size])

    def with_each_size(self, effect: str) -> "list[Trial]":
        """Return the trial with each size of an effect alone, if it has several."""
        sizes = self._sizes(effect)
        return [self.with_one_size(effect, s) for s in sizes] if len(sizes) > 1 else []

    def with_a_term_less(self, effect: str) -> "Trial | None":
        """Return the trial without the last size of an effect, if there are others before it.

        What else is fitted is where it is most probable then, to first order.
        """
        sizes = self._sizes(effect)
        if len(sizes) == 1:
            return None
        path = f"effects.{effect}.{sizes[-1]}"
        last = [unknown.path for unknown in self.unknowns.members].index(path)
        along = self.covariance[:, last] / self.covariance[last, last]
        x = self.x - self.x[last] * np.where(np.isfinite(along), along, 0.0)
        return self._less([path]).at(np.delete(np.clip(x, *self.unknowns.bounds), last))

    def _sizes(self, effect: str) -> list[str]:
        paths = [unknown.path for unknown in self.unknowns.members]
        return [s for s in REGISTRY[effect].sizes if f"effects.{effect}.{s}" in paths]

    def fixed(self, path: str, value: float) -> "Trial":
        """Return the trial with a parameter at a value, SI unit, no longer to be fitted."""
        less = self._less([path])
        machine = with_values(less.unknowns.machine, {path: value})
        return replace(less, unknowns=replace(less.unknowns, machine=machine))

    def also(self, unknown: Unknown) -> "Trial":
        """Return the trial with one parameter more to be fitted, begun at its start."""
        members = Unknowns(self.unknowns.machine, (*self.unknowns.members, unknown))
        covariance = np.pad(self.covariance, (0, 1), constant_values=np.nan)
        return Trial(self.effects, members, np.append(self.x, unknown.start), covariance)

    def _less(self, paths: Sequence[str]) -> "Trial":
        kept = np.array([u.path not in paths for u in self.unknowns.members], dtype=bool)
        members = tuple(u for u, stays in zip(self.unknowns.members, kept, strict=True) if stays)
        left = Unknowns(self.unknowns.machine, members)
        return Trial(self.effects, left, self.x[kept], _given(self.covariance, kept))

    def continued(self, solution: Solution) -> "Trial":
        """Return the trial with the parameters of a further fit."""
        k = len(self.unknowns.members)
        return Trial(self.effects, self.unknowns, solution.x[:k], solution.covariance[:k, :k])


def _given(covariance: Array, kept: NDArray[np.bool_]) -> Array:
    """Return the covariance of what is kept, (j, j), the others being known.

    covariance: (k, k); of what the data do not tell it is infinite, before any fit NaN. kept: (k,).
    """
    left = covariance[np.ix_(kept, kept)]
    known = ~kept & np.isfinite(np.diag(covariance))
    shared = covariance[np.ix_(kept, known)]
    return np.asarray(left - shared @ np.linalg.pinv(covariance[np.ix_(known, known)]) @ shared.T)


def trial(sheet: Sheet, effects: tuple[str, ...], known: Trial | None = None) -> Trial:
    """Return a trial at its starting values, or a trial fitted before with the further effects."""
    if known is None:
        members = unknowns(sheet, effects)
        x = members.start
    else:
        new = unknowns(replace(sheet, tolerances={}), effects[len(known.effects) :])
        members = Unknowns(known.unknowns.machine, (*known.unknowns.members, *new.members))
        x = np.append(known.x, new.start)
    return Trial(effects, members, x, np.full((x.size, x.size), np.nan))


def fit_balances(start: Trial, evidence: Evidence, floor: Array) -> Trial:
    """Fit a trial to the balances of recordings. floor: (5,) what the sensors leave in each.

    Nothing is fitted of a machine without tolerances and effects.
    """
    if not start.x.size:
        return start

    def model(points: Array) -> Array:
        missing = evidence.residuals([start.unknowns.at(x) for x in points])
        return evidence.in_noise(missing, floor)

    low, high = start.unknowns.bounds
    problem = Problem(model, start.x, low, high, start.unknowns.toleranced)
    return start.continued(fit(problem, SCREENING_ACCURACY, robust=True))


def fit_free_run(start: Trial, evidence: Evidence) -> Trial:
    """Fit a trial to the free run of recordings.

    First to their beginning, then further: over a short run parameters that are still off drift
    less, a piston that sticks at another instant does not decide, and it costs less. What shapes
    an effect near standstill, between two windows of the balances, they tell badly: the best of a
    few such shapes is where the fit begins. A trial that cannot follow the beginning is not
    polished. The state at rest at each recording's start (see `Starts`) is fitted along and then
    forgotten: it belongs to the recording, not to the machine.
    """
    x = np.append(shaped(start, evidence).x, np.zeros(2 * len(evidence.experiments)))
    begins = [x]
    for share in GROWING:
        begun = fit(free_run_problem(start, evidence, begins[-1], share), BEGINNING_ACCURACY)
        begins.append(begun.x)
    accuracy = FREE_RUN_ACCURACY if begun.misfit < HOPELESS else HOPELESS_ACCURACY
    # what acts late is not told by the beginning, and may have been led astray there
    whole = free_run_problem(start, evidence, x)
    best = begins[int(np.argmin(mean_squares(whole.model(np.array(begins)))))]
    return start.continued(fit(replace(whole, start=best), accuracy))


def shaped(start: Trial, evidence: Evidence) -> Trial:
    """Return the trial with those shapes of its effects whose free run is best."""
    for effect in start.effects:
        start = shapes(start, effect, evidence)[0]
    return start


def shapes(start: Trial, effect: str, evidence: Evidence) -> list[Trial]:
    """Return the trial with other shapes of an effect, those first whose free run is best."""
    points = _shapes(start, effect)
    errors = coarse_errors([start.unknowns.at(x) for x in points], evidence)
    return [start.at(points[k]) for k in np.argsort(mean_squares(errors))]


def _shapes(start: Trial, effect: str) -> Array:
    """Return vectors, (m, k), that differ in those fields of an effect that are no sizes.

    The trial's own is the first; of more than MOST_SHAPING such fields it is the only one. In
    shares they differ one at a time, in the others in all combinations.
    """
    members = start.unknowns.members
    shaping = [
        k for k, u in enumerate(members) if u.shapes and u.path.startswith(f"effects.{effect}.")
    ]
    shares = [k for k in shaping if members[k].is_share]
    others = [k for k in shaping if not members[k].is_share]
    if len(others) > MOST_SHAPING:
        return start.x[None]
    points = [moved(start.x, others, at) for at in product(*(_levels(start, k) for k in others))]
    points += [moved(start.x, [k], (at,)) for k in shares for at in _shares(members[k])]
    return np.array(points)


def _levels(start: Trial, k: int) -> list[float]:
    """Return the values of an unknown that are tried, its own first."""
    x, u = float(start.x[k]), start.unknowns.members[k]
    others = [x - SHAPE_STEP, x + SHAPE_STEP] if u.logarithmic else []
    others = [float(np.clip(v, u.low, u.high)) for v in others]
    return list(dict.fromkeys([x, u.start, *others]))


def _shares(share: Unknown) -> tuple[float, float, float]:
    """Return the values of a share that are tried: none, what a search starts at, all."""
    return share.low, share.start, share.high


def moved(x: Array, places: Sequence[int], values: Sequence[float]) -> Array:
    """Return a vector, (k,), with other values at some places."""
    point = x.copy()
    point[list(places)] = values
    return point


def refine_free_run(known: Trial, evidence: Evidence, rival: Trial | None = None) -> Trial:
    """Fit a trial that was fitted to a part of the recordings' free run to the whole.

    In the end with slopes over short steps: near the optimum those of the way there point a little
    beside it. A hopeless trial is not polished, nor one far behind its rival.
    """
    problem = _whole_problem(known, evidence)
    near = fit(problem, FREE_RUN_ACCURACY)
    behind = math.inf if rival is None else BEHIND * math.sqrt(mean_square(rival, evidence))
    if near.misfit > min(HOPELESS, behind):
        return known.continued(near)
    fine = replace(problem, start=near.x, step=DIFFERENCE_STEP)
    if STOPPING.intersection(known.effects):
        fine = replace(fine, coarse=None)
    accuracy = FINE_ACCURACY if near.misfit <= POLISHED else FREE_RUN_ACCURACY
    return known.continued(fit(fine, accuracy))


def with_spread(known: Trial, evidence: Evidence) -> Trial:
    """Return a trial fitted to the whole with the covariance that short steps tell.

    Over a shorter time than an integration step a load that sets in at once does not change.
    """
    problem = _whole_problem(known, evidence)
    k = known.x.size
    steps = np.full(problem.start.size, STRAIGHT_STEP)
    for i, unknown in enumerate(known.unknowns.members):
        if unknown.shapes and unknown.unit == "s":
            steps[i] = unknown.at(unknown.value(known.x[i]) + integration.STEP) - known.x[i]
    return replace(known, covariance=covariance(problem, steps)[:k, :k])


def following(known: Trial, evidence: Evidence) -> Trial:
    """Fit a trial to the longest beginning of the free run that it explains; as it was, if none."""
    end = max(float(e.time[-1]) for e in evidence.experiments)
    time = SHORTEST_FOLLOWED
    while time < end:
        begin = evidence.until(time)
        longer = refine_free_run(known, begin)
        if mean_square(longer, begin) > BEGINNING_EXPLAINED**2:
            break
        known, time = longer, FOLLOWED_GROWTH * time
    return known


def glimpsed(known: Trial, evidence: Evidence) -> Trial:
    """Fit a trial to the free run of the whole for so long as tells whether that leads anywhere."""
    problem = _whole_problem(known, evidence)
    return known.continued(fit(problem, FREE_RUN_ACCURACY, evaluations=GLIMPSE))


def _whole_problem(known: Trial, evidence: Evidence) -> Problem:
    """Return the free run of whole recordings as a problem, begun where a trial is at rest.

    That is where its errors are told from. Begun elsewhere inside a step of the resolver, a fit may
    stay there where something switches, and make up for it by parameters.
    """
    rest = [settled(known.machine, e, evidence) for e in evidence.experiments]
    return free_run_problem(known, evidence, np.concatenate([known.x, *rest]))


def with_all_terms(known: Trial, effect: str, sheet: Sheet) -> Trial:
    """Return a trial with all terms of a series to be fitted, begun at 0 where they were not."""
    paths = [unknown.path for unknown in known.unknowns.members]
    all_of_it = unknowns(replace(sheet, tolerances={}), (effect,)).members
    more = tuple(unknown for unknown in all_of_it if unknown.path not in paths)
    members = Unknowns(known.unknowns.machine, (*known.unknowns.members, *more))
    x = np.append(known.x, np.zeros(len(more)))
    return Trial(known.effects, members, x, np.full((x.size, x.size), np.nan))


def with_fewer_terms(full: Trial, effect: str, evidence: Evidence) -> list[Trial]:
    """Return a trial with fewer and fewer terms of a series, each fitted to the free run."""
    found, fewer = [], full.with_a_term_less(effect)
    while fewer is not None:
        found.append(refine_free_run(fewer, evidence, full))
        fewer = found[-1].with_a_term_less(effect)
    return found


def free_run_problem(start: Trial, evidence: Evidence, x: Array, share: float = 1.0) -> Problem:
    """Return the free run of the first part of recordings as a problem.

    x: start, (k + 2 r,), the trial's and two numbers for the state at rest in each recording.
    """
    own, states = start.x.size, x.size - start.x.size
    experiments = [e.head(share) for e in evidence.experiments]
    starts = [Starts(e, evidence) for e in experiments]

    def model(points: Array, *, coarse: bool = False) -> Array:
        machines = [start.unknowns.at(x[:own]) for x in points]
        parts = []
        for k, (experiment, begin) in enumerate(zip(experiments, starts, strict=True)):
            at = begin.at(points[:, own + 2 * k : own + 2 * k + 2], machines)
            parts.append(_free_run_errors(machines, experiment, evidence, at, coarse=coarse))
        return np.concatenate(parts, axis=1)

    low, high = start.unknowns.bounds
    return Problem(
        model,
        x,
        np.append(low, -np.ones(states)),
        np.append(high, np.ones(states)),
        np.append(start.unknowns.toleranced, np.zeros(states, dtype=bool)),
        partial(model, coarse=True),
        FREE_RUN_STEP,
    )


def free_run(machine: Machine, experiment: Experiment, evidence: Evidence) -> Array:
    """Return the free run's outputs, (n, 4), SI units, from the state `at_rest`."""
    start = at_rest(machine, experiment, evidence)
    return free_runs([machine], experiment, [start])[0, :, COMPARED]


@lru_cache(maxsize=16)  # several criteria ask for those of one machine
def free_run_errors(machine: Machine, evidence: Evidence) -> list[Array]:
    """Return simulated minus measured in units of the noise, (n, outputs), for each recording."""
    found = []
    for experiment in evidence.experiments:
        error = (free_run(machine, experiment, evidence) - experiment.outputs) / evidence.sensors
        found.append(error[:, evidence.shown])
    return found


def mean_square(tried: Trial, evidence: Evidence) -> float:
    """Return the mean square of all signals' free-run errors in units of the noise."""
    errors = np.concatenate(free_run_errors(tried.machine, evidence))
    with np.errstate(over="ignore"):  # of a run out of all bounds
        return float(np.mean(errors**2))


def coarse_errors(
    machines: Sequence[Machine],
    evidence: Evidence,
    rest: Sequence[Array] | None = None,
) -> Array:
    """Return weighted errors in units of the noise, (m, n), of coarse free runs of all recordings.

    rest: the two numbers of `Starts` in each recording; as the sensors show when not given.
    """
    count = len(machines)
    rest = [np.zeros(2)] * len(evidence.experiments) if rest is None else rest
    errors = []
    for experiment, point in zip(evidence.experiments, rest, strict=True):
        at = Starts(experiment, evidence).at(np.tile(point, (count, 1)), machines)
        errors.append(_free_run_errors(machines, experiment, evidence, at, coarse=True))
    return np.concatenate(errors, axis=1)


def at_rest(machine: Machine, experiment: Experiment, evidence: Evidence) -> tuple[float, float]:
    """Return the angle, rad, and p_S, Pa, from which a machine's free run starts.

    Inside what the sensors leave open at rest, those with the least error over the first seconds;
    the machine is left as it is.
    """
    point = settled(machine, experiment, evidence)
    return Starts(experiment, evidence).at(point[None], [machine])[0]


def settled(machine: Machine, experiment: Experiment, evidence: Evidence) -> Array:
    """Return the state `at_rest` as the two numbers of `Starts`.

    Where no sensor tells p_S it may be anywhere, so the fit begins at the best of several.
    """
    early, starts = experiment.until(SETTLING), Starts(experiment, evidence)

    def model(points: Array) -> Array:
        machines = [machine] * len(points)
        return _free_run_errors(machines, early, evidence, starts.at(points, machines))

    points = np.zeros((1, 2))
    if not starts.is_told:
        points = np.column_stack([np.zeros(RESTS), np.linspace(-1.0, 1.0, RESTS)])
    with np.errstate(over="ignore"):  # of a run out of all bounds
        cost = np.nan_to_num(np.sum(np.square(model(points)), axis=1), nan=np.inf)
    best: Array = points[int(np.argmin(cost))]
    if not np.isfinite(np.min(cost)):
        return best
    none = np.zeros(2, dtype=bool)
    return fit(Problem(model, best, -np.ones(2), np.ones(2), none), FREE_RUN_ACCURACY).x


def _free_run_errors(
    machines: Sequence[Machine],
    experiment: Experiment,
    evidence: Evidence,
    starts: Sequence[tuple[float, float]],
    *,
    coarse: bool = False,
) -> Array:
    """Return weighted errors in units of the noise, one row for each machine."""
    runs = free_runs(machines, experiment, starts, coarse=coarse)[:, :, COMPARED]
    error = (runs - experiment.outputs) * experiment.weights / evidence.sensors
    return np.asarray(error[:, :, evidence.shown].reshape(len(machines), -1))

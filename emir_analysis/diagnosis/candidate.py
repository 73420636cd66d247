"""An effect begun beside a known trial: what both leave when they do their best.

Near a fitted trial its parameters move what is left along straight lines. With that Jacobian, found
once, they are eliminated (variable projection, Golub and Pereyra 1973), and of each effect only its
own few fields remain to be fitted. Where those are fitted, the parameters stay inside their
tolerances.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from emir_analysis.diagnosis.fit import HELD, TOLERANCE_SPREAD, Problem, fit, steps_inside
from emir_analysis.diagnosis.loads import LOAD, Load
from emir_analysis.diagnosis.missing import Missing
from emir_analysis.diagnosis.straight import Straight
from emir_analysis.diagnosis.trial import Trial, moved
from emir_analysis.diagnosis.unknowns import Unknown
from emir_analysis.signals import Array
from emir_plant.effects import REGISTRY
from emir_plant.parameters import Machine

OWN_FIELDS_ACCURACY = 1e-2  # relative; what is promising is fitted again with all parameters
SIZES_TRIED = (1.0, -1.0, 4.0, -4.0, 16.0, -16.0)  # times the trial sizes; a fit starts at the best
# the same of a size that acts only beyond some value
STEPS = tuple(float(s) for s in range(-24, 25) if s)
FINER = tuple(s / 5.0 for s in range(-4, 5))  # steps about the best of these
SMALL = 0.1  # trial sizes, at which a machine is near enough to the known one
SHARES = (1.0, 0.5, 0.25)  # of a first-order step on the free run that are simulated
COST_DECIMALS = 6  # decimals of the cost, to which what leaves the same is told from rounding
RUNAWAY = 1e100  # times the noise: what a machine leaves that does not run; its square overflows
SOFT_NOISE = 0.354  # mean of sqrt(1 + z^2) - 1, a soft square, of noise z
AT_TIP, ON_PISTON = 0.0, 1.0  # share of a load on the piston


@dataclass(frozen=True)
class Screened:
    """A trial with one effect more and what it leaves: half the sum of soft squares, and size."""

    trial: Trial
    cost: float


class Left:
    """What a trial and an effect leave when parameters do their best, in units of the noise.

    missing: trials -> (m, n), what they leave with their own parameters. step: of its slopes.
    nothing: (n,), what is left without an effect.
    """

    def __init__(self, known: Trial, missing: Missing, step: float) -> None:
        self.step_size = step
        self._missing = missing
        self._costs = dict[Machine, float]()  # of what was simulated
        # what shapes an effect stays: an onset leads nowhere along a straight line
        free = np.array([not unknown.shapes for unknown in known.unknowns.members], dtype=bool)
        stated, x = known.unknowns.toleranced[free], known.x[free]
        prior = np.diag(np.where(stated, 1.0 / TOLERANCE_SPREAD, HELD))
        self._drawn = np.where(stated, x, 0.0) / TOLERANCE_SPREAD
        low, high = (bound[free] for bound in known.unknowns.bounds)
        self._known, self._free = known.x, free
        self._bounds, self._room = (low, high), (low - x, high - x)
        slopes = Straight(known, missing, step, free).slopes
        self._basis, self._triangle = np.linalg.qr(np.vstack([slopes, prior]))
        self.nothing = self.inside([known])[0][0]

    def __call__(self, trials: list[Trial]) -> Array:
        """Return what is left, (m, n), for trials with the known x."""
        residual = self._augmented(trials)
        return np.asarray(residual - (residual @ self._basis) @ self._basis.T)

    def inside(self, trials: list[Trial]) -> tuple[Array, Array]:
        """Return the same, (m, n), and the known x, (m, k), with x inside its bounds."""
        residuals = self._augmented(trials)
        runs = np.max(np.abs(residuals), axis=1, keepdims=True) < RUNAWAY
        wanted = np.where(runs, -residuals @ self._basis, 0.0)  # else no change leads anywhere
        changes = np.linalg.solve(self._triangle, wanted.T).T
        beyond = np.any((changes < self._room[0]) | (changes > self._room[1]), axis=1)
        for k in np.flatnonzero(beyond):
            changes[k] = lsq_linear(self._triangle, wanted[k], self._room, method="bvls").x
        x = np.tile(self._known, (len(trials), 1))
        # rounding leads beyond them
        x[:, self._free] = np.clip(self._known[self._free] + changes, *self._bounds)
        return residuals + changes @ self._triangle.T @ self._basis.T, x

    def costs(self, trials: list[Trial]) -> list[float]:
        """Return what trials leave with their own parameters: half the sum of soft squares."""
        new = [t for t in trials if t.machine not in self._costs]
        if new:
            self._left_by(new)
        return [self._costs[t.machine] for t in trials]

    def runs(self, one: Trial) -> bool:
        """Tell whether a trial's machine can rest where the recordings begin, and be simulated."""
        return bool(np.all(np.isfinite(self._left_by([one]))))

    def _left_by(self, trials: list[Trial]) -> Array:
        residuals = self._missing(trials)
        self._costs |= {t.machine: soft(row) for t, row in zip(trials, residuals, strict=True)}
        return residuals

    def _augmented(self, trials: list[Trial]) -> Array:
        drawn = np.tile(self._drawn, (len(trials), 1))
        return np.column_stack([self._left_by(trials), drawn])


class Candidate:
    """Effects more, begun at the best of their starts; the known parameters stay in `start`.

    effect: the last of them. form: of all. x: (k,) their fields, bounds: of x.
    at_best, slopes: what is left there, (n,), and its slopes, (k, n).
    expected: cost, to first order, when they do their best.
    """

    def __init__(self, start: Trial, known: int, starts: list[Array], left: Left) -> None:
        self._start, self._known, self._left = start, known, left
        self.effect, self.form = start.effects[-1], start.form
        self._further = start.unknowns.members[known:]
        low, high = (bound[known:] for bound in start.unknowns.bounds)
        self.bounds = (low, high)
        self.x, self.at_best = self._best(starts)
        for unit in self._steps():
            self.x, self.at_best = self._best([self.x + s * unit for s in FINER])
        if soft(self.at_best) > soft(left.nothing):
            self.x, self.at_best = self._best([self.x, self._smaller(self.x)])
        steps = steps_inside(self.x, left.step_size, high)
        self.slopes = (self._inside(self.x + np.diag(steps)) - self.at_best) / steps[:, None]
        change, self.expected = best_change(self.at_best, self.slopes, low - self.x, high - self.x)
        self._reached = self.x + change

    def _best(self, starts: list[Array]) -> tuple[Array, Array]:
        """Return the best of some fields, (k,), inside their bounds, and what is left there."""
        inside = np.clip(starts, *self.bounds)
        points = np.array(list(dict.fromkeys(map(tuple, inside))))  # bounds make some of them one
        residuals = self._inside(points)
        best = int(np.argmin([soft(row) for row in residuals]))
        return points[best], residuals[best]

    def _smaller(self, x: Array) -> Array:
        """Return fields, (k,), with smaller sizes.

        What explains nothing alone may do so beside another, and slopes say so near the machine
        that is known, not where it makes all worse.
        """
        sizes = self._sizes()[self._known :]
        return np.where(sizes, SMALL * x, x)

    def _steps(self) -> list[Array]:
        """Return a step, (k,), of each field that is begun in steps."""
        found, members = [], self._further
        for k, name in enumerate(u.path.split(".") for u in members):
            if name[2] in REGISTRY[name[1]].stepwise:
                found.append(np.eye(len(members))[k] * members[k].start)
        return found

    def fitted(self) -> Screened:
        """Fit the effects' fields, from where they are best or from where they ought to be."""
        begin, _ = self._best([self.x, self._reached])
        return self._screened([self.x, *self._ends([begin])])

    def fitted_again(self, found: Screened) -> Screened:
        """Fit them from none and from all of each share as well; fits may stop in between.

        Not of what acts only beyond some value: there a share stands for a size that is off.
        """
        if REGISTRY[self.effect].stepwise:
            return found
        own = found.trial.x[self._known :]
        shares = [(k, u) for k, u in enumerate(self._further) if u.is_share]
        ends = [(k, end) for k, share in shares for end in (share.low, share.high)]
        others = [moved(own, [k], [end]) for k, end in ends if end != own[k]]
        _, *begins = self._different([own, *others])
        return self._screened([own, *self._ends(begins)]) if begins else found

    def _ends(self, begins: list[Array]) -> list[Array]:
        """Return where fits from some fields, (k,), end; none where nothing is foreseen."""
        if not np.isfinite(self.expected):
            return []
        nothing_held = np.zeros(self.x.size, dtype=bool)
        problem = Problem(self._inside, self.x, *self.bounds, nothing_held)
        return [fit(replace(problem, start=x), OWN_FIELDS_ACCURACY, robust=True).x for x in begins]

    def _screened(self, points: list[Array]) -> Screened:
        """Return the trial at the best of some fields, (k,), with its parameters at their best."""
        best, left = self._best(points)
        return Screened(self._with_parameters(best), soft(left))

    def _different(self, points: list[Array]) -> list[Array]:
        """Return fields, (k,), but those that leave what others before them do.

        The direction of a load counts for nothing where all of it is on the piston.
        """
        costs = np.round([soft(row) for row in self._inside(np.array(points))], COST_DECIMALS)
        first = np.unique(costs, return_index=True)[1]
        return [points[k] for k in sorted(first)]

    def stepped(self) -> Screened:
        """Return the trial where it is best on the way to what is best to first order.

        Or at one of the sizes that are usual for it: first order says nothing of a large one.
        """
        goal = self._with_parameters(self._reached)
        low, high = self._start.unknowns.bounds
        off = self._start.x.copy()  # the effects' shapes as in the goal, their sizes 0
        off[self._known :] = self._reached
        off[self._sizes()] = 0.0
        points = [off + s * (goal.x - off) for s in SHARES]
        known = self._start.x[: self._known]
        starts = starting_fields(self.effect, self._further, [], 1.0)
        points += [np.append(known, own) for own in starts]
        ways = [self._start.at(np.clip(point, low, high)) for point in points]
        costs = self._left.costs(ways)
        best = int(np.argmin(costs))
        return Screened(ways[best], costs[best])

    def _sizes(self) -> NDArray[np.bool_]:
        """Tell which unknowns are sizes of the further effects, (n,)."""
        return np.array([False] * self._known + [not unknown.shapes for unknown in self._further])

    def _with_parameters(self, own: Array) -> Trial:
        """Return the trial with fields, (k,), and the known parameters where they do their best.

        That is by straight lines, which may lead far: to no machine that runs, they stay.
        """
        as_they_are = self._trials(own[None])
        known = self._left.inside(as_they_are)[1][0]
        best = self._start.at(np.append(known, own))
        return best if self._left.runs(best) else as_they_are[0]

    def _inside(self, points: Array) -> Array:
        return self._left.inside(self._trials(points))[0]

    def _trials(self, points: Array) -> list[Trial]:
        known = self._start.x[: self._known]
        return [self._start.at(np.append(known, x)) for x in points]


def best_change(residual: Array, slopes: Array, low: Array, high: Array) -> tuple[Array, float]:
    """Return a linear model's best change within bounds, (k,), or none, and its cost."""
    none, cost = np.zeros(len(slopes)), soft(residual)
    if not np.all(np.isfinite(slopes)) or not np.all(np.isfinite(residual)):
        return none, cost
    change = np.clip(np.linalg.lstsq(slopes.T, -residual, rcond=1e-9)[0], low, high)
    changed = soft(residual + change @ slopes)
    return (change, changed) if changed < cost else (none, cost)


def starting_fields(
    effect: str, members: tuple[Unknown, ...], loads: list[Load], size: float
) -> list[Array]:
    """Return vectors, (k,), of the effect's fields from which a fit may start.

    Of several sizes all together, and each alone: together one may hide what another explains.
    One that acts only beyond some value in steps of its trial size, with what is usual for shares:
    by another law such a step is another one.
    loads: at the TCP, that explain much. size: of the effect, in trial sizes.
    """
    x = np.array([unknown.start for unknown in members])
    if REGISTRY[effect].stepwise:
        x = np.array([u.at(u.usual) if u.is_share else u.start for u in members])
    if effect == LOAD:
        return [
            x,
            *(load_fields(members, load, at) for load in loads for at in (AT_TIP, ON_PISTON)),
        ]
    sizes = np.array([not unknown.shapes for unknown in members])
    negative = any(u.low < 0.0 for u, size in zip(members, sizes, strict=True) if size)
    allowed = [s for s in SIZES_TRIED if s > 0.0 or negative]
    switched_on = np.vstack([sizes, np.eye(x.size)[sizes]]) if np.sum(sizes) > 1 else sizes[None]
    starts = [np.where(sizes, s * size * x * on, x) for on in switched_on for s in allowed]
    for stepwise in REGISTRY[effect].stepwise:
        on = np.array([u.path.endswith(f".{stepwise}") for u in members])
        starts += [np.where(sizes, s * x * on, x) for s in STEPS]
    return starts


def load_fields(members: tuple[Unknown, ...], load: Load, piston_share: float) -> Array:
    """Return a load, across the boom where not on the piston, as its effect's fields, (11,)."""
    values = (*load, piston_share, 0.0, 0.0)
    return np.array([unknown.at(value) for unknown, value in zip(members, values, strict=True)])


def soft(residual: Array) -> float:
    """Return half the sum of soft squares, which count large errors by their size."""
    with np.errstate(over="ignore"):  # of a machine that leaves every bound
        cost = float(np.sum(np.sqrt(1.0 + residual**2) - 1.0))
    return cost if np.isfinite(cost) else float("inf")

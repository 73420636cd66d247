"""Which effects could explain what a fitted trial leaves in the balances: all are tried.

Near a fitted trial its parameters move the balances along straight lines. With that Jacobian,
found once, they are eliminated (variable projection, Golub and Pereyra 1973), and of each effect
only its own few fields remain to be fitted: cheap enough for every effect of the registry.
"""

from dataclasses import dataclass

import numpy as np

from emir_analysis.diagnosis.candidates import Trial, trial
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.fit import STEP, TOLERANCE_SPREAD, Problem, fit
from emir_analysis.diagnosis.unknowns import Unknown
from emir_analysis.signals import Array
from emir_common.quantity import quantities
from emir_plant.effects import REGISTRY
from emir_plant.sheet import Sheet

ACCURACY = 1e-2  # relative; what is promising is fitted again with all parameters
STARTS = (1.0, -1.0, 4.0, -4.0)  # times the trial sizes, from the best of which a fit starts
MOST_FITTED = 8  # effects whose own fields are fitted
HARMONICS = 3  # frequencies from which the fit of a load over time starts


@dataclass(frozen=True)
class Screened:
    """A trial with one effect more and what it leaves: half the sum of soft squares, and size."""

    trial: Trial
    cost: float


def screen(known: Trial, sheet: Sheet, evidence: Evidence, floor: Array) -> list[Screened]:
    """Return the known trial with each further effect of the registry, the best first.

    An effect that cannot be simulated, or that does not stay on, is not in the list.
    """
    left = _Left(known, evidence, floor)
    others = [name for name in REGISTRY if name not in known.effects]
    begun = [
        _Candidate(trial(sheet, (*known.effects, name), known), left, evidence) for name in others
    ]
    promising = sorted(begun, key=lambda c: c.expected)[:MOST_FITTED]
    return sorted((c.fitted() for c in promising), key=lambda s: s.cost)


class _Left:
    """What a trial and an effect leave in the balances when parameters do their best."""

    def __init__(self, known: Trial, evidence: Evidence, floor: Array) -> None:
        self._known, self._evidence, self._floor = known, evidence, floor
        held = known.unknowns.toleranced
        prior = np.diag(np.where(held, 1.0, 0.0)) / TOLERANCE_SPREAD
        self._drawn = np.where(held, known.x, 0.0) / TOLERANCE_SPREAD
        _, high = known.unknowns.bounds
        steps = np.where(known.x + STEP > high, -STEP, STEP)
        values = self._missing([known, *(known.at(x) for x in known.x + np.diag(steps))])
        slopes = np.nan_to_num((values[1:] - values[0]) / steps[:, None])
        jacobian = np.vstack([slopes.T, prior])
        self._basis, self._triangle = np.linalg.qr(jacobian)

    def __call__(self, trials: list[Trial]) -> Array:
        """Return what is left, (m, n), in units of the floor, for trials with the known x."""
        return self._projected(self._augmented(trials))

    def force(self) -> Array:
        """Return the force that the known trial misses in the first recording, (w,) N."""
        missing: Array = self._evidence.residuals([self._known.machine])[0]
        force: Array = missing[: self._evidence.windows_of_first, 0]
        return force

    def step(self, final: Trial) -> Array:
        """Return the known parameters' best change, (k,), beside an effect."""
        residual = self._augmented([final])[0]
        step = np.linalg.lstsq(self._triangle, self._basis.T @ residual, rcond=1e-9)[0]
        return np.asarray(-step)

    def _augmented(self, trials: list[Trial]) -> Array:
        missing = self._missing(trials)
        return np.column_stack([missing, np.tile(self._drawn, (len(trials), 1))])

    def _projected(self, residual: Array) -> Array:
        return np.asarray(residual - (residual @ self._basis) @ self._basis.T)

    def _missing(self, trials: list[Trial]) -> Array:
        missing = self._evidence.residuals([t.machine for t in trials]) / self._floor
        return np.asarray(missing[:, :, self._evidence.fitted].reshape(len(trials), -1))


class _Candidate:
    """One effect more, begun at the best of its starts.

    expected: cost, to first order, when its fields do their best from there.
    """

    def __init__(self, start: Trial, left: _Left, evidence: Evidence) -> None:
        self._start, self._left = start, left
        effect = start.effects[-1]
        self._base = start.x.size - len(quantities(REGISTRY[effect]))
        members = start.unknowns.members[self._base :]
        self._low, self._high = (bound[self._base :] for bound in start.unknowns.bounds)
        starts = _starts(effect, members, left, evidence)
        points = np.clip(starts, self._low, self._high)
        residuals = self._model(points)
        best = int(np.argmin([_soft(row) for row in residuals]))
        self._x, at_best = points[best], residuals[best]
        steps = np.where(self._x + STEP > self._high, -STEP, STEP)
        slopes = (self._model(self._x + np.diag(steps)) - at_best) / steps[:, None]
        if np.all(np.isfinite(slopes)):
            change = np.linalg.lstsq(slopes.T, -at_best, rcond=1e-9)[0]
            reached = np.clip(self._x + change, self._low, self._high) - self._x
            self.expected = min(_soft(at_best), _soft(at_best + reached @ slopes))
        else:
            self.expected = _soft(at_best)

    def fitted(self) -> Screened:
        """Fit the effect's fields."""
        nothing_held = np.zeros(self._x.size, dtype=bool)
        problem = Problem(self._model, self._x, self._low, self._high, nothing_held)
        own = fit(problem, ACCURACY, robust=True).x if np.isfinite(self.expected) else self._x
        final = self._start.at(np.append(self._start.x[: self._base], own))
        low, high = (bound[: self._base] for bound in self._start.unknowns.bounds)
        moved = np.clip(self._start.x[: self._base] + self._left.step(final), low, high)
        cost = _soft(self._model(own[None])[0])
        return Screened(self._start.at(np.append(moved, own)), cost)

    def _model(self, points: Array) -> Array:
        known = self._start.x[: self._base]
        return self._left([self._start.at(np.append(known, x)) for x in points])


def _starts(
    effect: str, members: tuple[Unknown, ...], left: _Left, evidence: Evidence
) -> list[Array]:
    """Return vectors, (k,), of the effect's fields from which a fit may start."""
    x = np.array([unknown.start for unknown in members])
    if effect == "external_load":
        return [x, *_loads_over_time(members, left.force(), evidence)]
    sizes = [u.path.rsplit(".", 1)[1] in REGISTRY[effect].sizes for u in members]
    allowed = [s for s in STARTS if s > 0.0 or any(u.low < 0.0 for u in members)]
    return [np.where(sizes, s * x, x) for s in allowed]


def _loads_over_time(members: tuple[Unknown, ...], force: Array, evidence: Evidence) -> list[Array]:
    """Return starts for a load that depends on time, from the force missing on the piston, N.

    The strongest harmonics, and the stretch of time over which the force is most unlike the rest.
    """
    time = evidence.time[: force.size]
    geometry = evidence.stated.geometry
    at_tip = geometry.triangle_b / geometry.boom_length  # order of magnitude of the lever ratio
    spectrum = np.fft.rfft(force - force.mean())
    frequency = np.fft.rfftfreq(force.size, float(time[1] - time[0]))
    loads = []
    for k in np.argsort(-np.abs(spectrum[1:]))[:HARMONICS] + 1:
        size = 2.0 * np.abs(spectrum[k]) / force.size * at_tip
        begin = -2.0 * np.pi * frequency[k] * float(time[0])
        phase = float(np.angle(np.exp(1j * (np.angle(spectrum[k]) + begin))))
        loads.append((size, frequency[k], phase, 0.0, 1e6))
    total = np.concatenate([[0.0], np.cumsum(force - force.mean())])
    first, last = np.triu_indices(total.size, 4)
    unlike = (total[last] - total[first]) ** 2 / (last - first)
    best = int(np.argmax(unlike))
    i, j = int(first[best]), int(last[best]) - 1
    outside = np.delete(force, np.arange(i, j + 1))
    size = (force[i : j + 1].mean() - (outside.mean() if outside.size else 0.0)) * at_tip
    loads.append((size, 0.0, 0.0, float(time[i]), float(time[j] - time[i])))
    return [
        np.array(
            [
                (v - u.origin) / u.scale if not u.logarithmic else np.log(v / u.origin)
                for u, v in zip(members, load, strict=True)
            ]
        )
        for load in loads
    ]


def _soft(residual: Array) -> float:
    """Return half the sum of soft squares, which count large errors by their size."""
    cost = float(np.sum(np.sqrt(1.0 + residual**2) - 1.0))
    return cost if np.isfinite(cost) else float("inf")

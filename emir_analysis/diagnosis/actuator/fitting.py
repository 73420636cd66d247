"""Fitting an actuator's parameters and those of effects to the free run of its pressure.

What is known beforehand counts, too: a fit is the most probable one (maximum a posteriori) with
normally distributed parameters, around the data sheet's values, a quarter of the range wide, and
around the trial values of effects. A short recording leaves some of many parameters nearly open;
this keeps them where machines have them, and makes a set's evidence a number: how probable the
recording is under it (MacKay 1992, Neural Computation 4, 415).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, least_squares

from emir_analysis.diagnosis.actuator.record import ActuatorRecord
from emir_analysis.diagnosis.actuator.unknowns import (
    ActuatorUnknown,
    is_without,
    place_of,
    starts,
    unknowns,
    ways,
)
from emir_analysis.diagnosis.fit import steps_inside
from emir_analysis.signals import Array
from emir_common.parameter_tree import with_values
from emir_plant.actuator import Actuator, ActuatorSheet, simulate
from emir_plant.actuator.model import column, run_each
from emir_plant.actuator.model import record as flat_record

DIFFERENCE_STEP = 1e-3  # of the finite differences, in units of the trial value or the logarithm
EVALUATIONS = 40  # of the model in one fit, beside those for the Jacobian
SHORT = 5  # evaluations, after which the best of several fits are told
ENDED = 2  # of them, which go on to the end
ACCURACY = 1e-5  # relative, of cost and vector
INDEPENDENT = 4.0  # errors in a slow period that count as independent
GUESSED = 0.1  # rms error before the first fit, in spreads of the pressure
EXACT = 1e-4  # of the spread: an rms error below is none, integrators differ by as much
ROUNDS = 2  # of fits with the rms error that the one before has left
PLACES = 60  # drawn at random; the best of them are further starts

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Fitted:
    """A machine fitted with effects: x (k,) at the optimum, its covariance (k, k), rms error.

    evidence: logarithm of the recording's probability under these effects, whatever their sizes
    (Laplace's approximation), likelihood: with these sizes, both up to a constant of the recording.
    """

    effects: tuple[str, ...]
    unknowns: tuple[ActuatorUnknown, ...]
    machine: Actuator
    x: Array
    covariance: Array
    rms: float
    evidence: float
    likelihood: float

    @property
    def name(self) -> str:
        """Return what it is called in reports."""
        return " and ".join(self.effects) or "parameters only"


class _Surplus:
    """Errors, and what the parameters deviate from what is expected, in units of both.

    Half the square of it all is minus the logarithm of the machine's probability.
    """

    def __init__(
        self,
        sheet: ActuatorSheet,
        members: tuple[ActuatorUnknown, ...],
        record: ActuatorRecord,
        noise: float,
        seen: Mask | None,
    ) -> None:
        self.members = members
        self.low, self.high, self.expected, self.deviation = (
            np.array([getattr(member, name) for member in members])
            for name in ("low", "high", "expected", "deviation")
        )
        self._record = record
        self._part = slice(None) if seen is None else seen
        self._measured = record.pressure[self._part]
        slow = 2.0 * math.pi / sheet.machine.load.frequency / record.period
        spread = float(np.std(record.pressure))
        self.guessed, self.exact = GUESSED * spread, EXACT * spread
        self._noise = noise
        # how many samples a model's error takes to be another one
        self._lasting = max(1.0, slow / INDEPENDENT)
        self._stated = flat_record(sheet.machine)
        self._start = record.start

    def _errors(self, points: Array) -> Array:
        """Return simulated minus measured pressure, (m, n), at places, (m, k)."""
        machines = np.repeat(self._stated, len(points))
        for member, place in zip(self.members, points.T, strict=True):
            column(machines, member.path)[:] = [member.value(float(x)) for x in place]
        r = self._record
        simulated = run_each(machines, r.opening, r.period, self._start)
        return np.asarray(simulated[:, self._part] - self._measured)

    def rms(self, x: Array) -> float:
        """Return the rms error."""
        return math.sqrt(float(np.mean(self._errors(x[None]) ** 2)))

    def unexpected(self, x: Array) -> float:
        """Return minus the logarithm of how probable a place, (k,), is beforehand."""
        return 0.5 * float(np.sum(((x - self.expected) / self.deviation) ** 2))

    def independent(self, rms: float) -> float:
        """Return how many errors count as independent at an rms error.

        All of the noise do, of what a model lacks one in a while; of both together those of a
        correlation that the noise makes smaller (Bartlett 1935).
        """
        correlated = 1.0 - min(self._noise / rms, 1.0) ** 2
        return self._measured.size / (1.0 + (self._lasting - 1.0) * correlated**2)

    def improbable(self, rms: float) -> float:
        """Return minus the logarithm of the errors' probability, but for a constant.

        Its slope over the logarithm of the rms error is the number of independent errors.
        """
        few, more = self._measured.size / self._lasting, math.sqrt(self._lasting - 1.0)
        least = max(rms, self._noise)
        apart = more * (1.0 - (self._noise / least) ** 2)
        slow = math.log(least) + 0.5 * more * math.atan(apart) + 0.25 * math.log1p(apart**2)
        return few * slow + self._measured.size * math.log(rms / least)

    def at(self, x: Array, rms: float) -> Array:
        """Return deviations and errors; rms: the error that is expected."""
        return np.asarray(self._each_at(x[None], rms)[0])

    def _each_at(self, points: Array, rms: float) -> Array:
        weight = math.sqrt(self.independent(rms) / self._measured.size) / rms
        deviations = (points - self.expected) / self.deviation
        return np.hstack([deviations, weight * self._errors(points)])

    def _jacobian(self, x: Array, rms: float) -> Array:
        steps = steps_inside(x, DIFFERENCE_STEP, self.high)
        here, *moved = self._each_at(np.vstack([x, x + np.diag(steps)]), rms)
        return np.stack([(there - here) / s for there, s in zip(moved, steps, strict=True)], 1)

    def _inside(self, x: Array) -> Array:
        margin = 1e-6 * (self.high - self.low)
        return np.clip(x, self.low + margin, self.high - margin)

    def drawn(self, rms: float) -> list[Array]:
        """Return places drawn from what is expected, the same every time, the best first."""
        random = np.random.default_rng(0).standard_normal((PLACES, self.expected.size))
        places = self._inside(self.expected + self.deviation * random)
        cost = np.sum(self._each_at(places, rms) ** 2, axis=1)
        return [places[k] for k in np.argsort(cost, kind="stable")]

    def least(self, start: Array, rms: float, evaluations: int = EVALUATIONS) -> OptimizeResult:
        """Return the minimum that is reached from a place, or how far so many evaluations lead."""
        return least_squares(
            self.at, self._inside(start), jac=self._jacobian, args=(rms,),
            bounds=(self.low, self.high), xtol=ACCURACY, ftol=ACCURACY, max_nfev=evaluations,
        )  # fmt: skip


@dataclass(frozen=True)
class Begin:
    """Where fits begin: at each known machine, at what is expected without any.

    Effects that a known machine lacks begin at their trial values, or with `levels` at all LEVELS
    of them. drawn: how many places drawn from what is expected, the best of them, besides.
    thorough: the fits go on to the end from all, not from the best ENDED after some steps alone.
    """

    known: Sequence[Actuator] = ()
    drawn: int = 0
    levels: bool = False
    thorough: bool = False


@dataclass(frozen=True)
class Fitting:
    """Fits to a recording of a machine with a data sheet; noise: of the pressure, in its unit."""

    sheet: ActuatorSheet
    record: ActuatorRecord
    noise: float

    def fit(
        self,
        effects: tuple[str, ...],
        begin: Begin,
        *,
        seen: Mask | None = None,
        without: Sequence[str] = (),
    ) -> Fitted:
        """Return the most probable machine by the free run of the pressure, or the part seen, (n,).

        What in an effect is none or above some value is fitted both ways. With it fits begin where
        the effect is new or has it, `thorough` from every machine; places are drawn without it.
        without: parameters, by dotted path, that stay as the sheet's machine has them.
        """
        members = tuple(m for m in unknowns(self.sheet, effects) if m.path not in without)
        if not members:
            return _as_stated(self.sheet, self._surplus(members, seen))
        begun = []
        each_way = ways(members)
        for way in each_way:
            surplus = self._surplus(way, seen)
            uncertain, drawn = way is members, way is each_way[0] or not begin.known
            begun += [
                (surplus, surplus.least(x, surplus.guessed, SHORT))
                for x in self._starts(surplus, begin, uncertain=uncertain, drawn=drawn)
            ]
        begun.sort(key=lambda each: float(each[1].cost))
        ended = begun if begin.thorough else begun[:ENDED]
        fits = [_ended(self.sheet, effects, surplus, found.x) for surplus, found in ended]
        return max(fits, key=lambda fitted: fitted.evidence)

    def _surplus(self, members: tuple[ActuatorUnknown, ...], seen: Mask | None) -> _Surplus:
        return _Surplus(self.sheet, members, self.record, self.noise, seen)

    def _starts(
        self, surplus: _Surplus, begin: Begin, *, uncertain: bool, drawn: bool
    ) -> list[Array]:
        """Return where fits of one way begin, (k,) each.

        uncertain: it has what may be none. drawn: places are drawn for it.
        """
        members = surplus.members
        found = [] if begin.known else [surplus.expected]
        for machine in begin.known:
            if uncertain and not begin.thorough and is_without(members, machine):
                continue
            if begin.levels:
                found += starts(self.sheet, members, machine)
            else:
                found.append(place_of(members, machine))
        if begin.drawn and drawn:
            found += surplus.drawn(surplus.guessed)[: begin.drawn]
        return found


def _as_stated(sheet: ActuatorSheet, surplus: _Surplus) -> Fitted:
    """Return the machine of a data sheet that leaves nothing open."""
    nothing = np.zeros(0)
    rms = max(surplus.rms(nothing), surplus.exact)
    likely = -surplus.improbable(rms)
    return Fitted((), (), sheet.machine, nothing, np.zeros((0, 0)), rms, likely, likely)


def _ended(
    sheet: ActuatorSheet, effects: tuple[str, ...], surplus: _Surplus, start: Array
) -> Fitted:
    """Return the machine of the minimum that is reached from a place, (k,)."""
    best, rms = surplus.least(start, surplus.guessed), surplus.guessed
    for _ in range(ROUNDS):
        rms = max(surplus.rms(best.x), surplus.exact)
        best = surplus.least(best.x, rms)
    curvature = best.jac.T @ best.jac  # of the logarithm of the probability
    values = {m.path: m.value(float(v)) for m, v in zip(surplus.members, best.x, strict=True)}
    return Fitted(
        effects,
        surplus.members,
        with_values(sheet.machine, values),
        np.asarray(best.x),
        np.linalg.pinv(curvature, hermitian=True),
        surplus.rms(best.x),
        -surplus.unexpected(best.x)
        - surplus.improbable(rms)
        - narrowed(best.jac, surplus.deviation),
        -surplus.improbable(max(surplus.rms(best.x), surplus.exact)),
    )


def narrowed(jacobian: Array, deviation: Array) -> float:
    """Return the logarithm of by how much data narrow what is known beforehand.

    jacobian: (n + k, k) of `_Surplus`, deviation: (k,). By singular values: beside a run out of
    all bounds the determinant of the square is 0 in rounding.
    """
    return float(np.sum(np.log(np.linalg.svd(jacobian * deviation, compute_uv=False))))


def free_run(machine: Actuator, record: ActuatorRecord) -> Array:
    """Return the simulated pressure (n,), from standstill at the measured pressure."""
    return simulate(machine, record.opening, record.period, record.start)


def free_run_error(machine: Actuator, record: ActuatorRecord) -> Array:
    """Return simulated minus measured pressure, (n,)."""
    return free_run(machine, record) - record.pressure

"""Fitting an actuator's parameters and those of effects to the free run of its pressure.

What is known beforehand counts, too: a fit is the most probable one (maximum a posteriori) with
normally distributed parameters, around the data sheet's values, a quarter of the range wide, and
around the trial values of effects. A short recording leaves some of many parameters nearly open;
this keeps them where machines have them, and makes a set's evidence a number: how probable the
recording is under it (MacKay 1992, Neural Computation 4, 415).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, least_squares

from emir_analysis.diagnosis.actuator.record import ActuatorRecord
from emir_analysis.diagnosis.fit import steps_inside
from emir_analysis.signals import Array
from emir_common.parameter_tree import declared, with_values
from emir_common.quantity import quantities
from emir_plant.actuator import Actuator, ActuatorSheet, simulate
from emir_plant.actuator.effects import KNOWN
from emir_plant.actuator.model import column, run_each
from emir_plant.actuator.model import record as flat_record

DIFFERENCE_STEP = 1e-3  # of the finite differences, in units of the trial value or the logarithm
EVALUATIONS = 40  # of the model in one fit, beside those for the Jacobian
SHORT = 5  # evaluations, after which the best of several fits are told
ENDED = 2  # of them, which go on to the end
ACCURACY = 1e-5  # relative, of cost and vector
WIDE = 20.0  # a parameter whose range spans more than this factor is fitted as its logarithm
RANGE_DEVIATIONS = 4.0  # standard deviations in the range of a data sheet's entry
TYPICAL = 2.0  # deviation of an effect's parameter from its trial value, in trial values
TYPICAL_FACTOR = 4.0  # the same where it is fitted as its logarithm
INDEPENDENT = 4.0  # errors in a slow period that count as independent
GUESSED = 0.1  # rms error before the first fit, in spreads of the pressure
EXACT = 1e-4  # of the spread: an rms error below is none, integrators differ by as much
ROUNDS = 2  # of fits with the rms error that the one before has left
PLACES = 60  # drawn at random; the best of them are further starts
LEVELS = (1.0, 0.125, 0.18, 0.25, 0.35, 0.5, 0.7, 1.4, 2.0)  # of trial values: where fits start

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Unknown:
    """One parameter: value = scale x, or scale exp(x) when logarithmic; low, high: bounds of x.

    expected, deviation: of x, before anything is measured.
    """

    path: str
    unit: str
    scale: float
    low: float
    high: float
    logarithmic: bool
    expected: float
    deviation: float

    def value(self, x: float) -> float:
        """Return the parameter's value."""
        return self.scale * math.exp(x) if self.logarithmic else self.scale * x

    def position(self, value: float) -> float:
        """Return x at a value, inside the bounds."""
        x = math.log(value / self.scale) if self.logarithmic else value / self.scale
        return min(max(x, self.low), self.high)


@dataclass(frozen=True)
class Fitted:
    """A machine fitted with effects: x (k,) at the optimum, its covariance (k, k), rms error.

    evidence: logarithm of the recording's probability under these effects, whatever their sizes
    (Laplace's approximation), likelihood: with these sizes, both up to a constant of the recording.
    """

    effects: tuple[str, ...]
    unknowns: tuple[Unknown, ...]
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


def sizes(effects: Sequence[str]) -> list[str]:
    """Return the sizes, by dotted path, of those effects that have several."""
    several = [name for name in effects if len(KNOWN[name].sizes) > 1]
    return [f"effects.{name}.{size}" for name in several for size in KNOWN[name].sizes]


def unknowns(sheet: ActuatorSheet, effects: Sequence[str]) -> tuple[Unknown, ...]:
    """Return what a data sheet leaves open and all parameters of the named effects."""
    stated = declared(sheet.machine)
    found = [
        _stated(path, stated[path][0].unit, float(stated[path][1]), low, high)
        for path, (low, high) in sheet.ranges.items()
    ]
    for effect in effects:
        kind = KNOWN[effect]
        for name, trial in kind.trial.items():
            about = quantities(kind)[name]
            low = kind.none_or_above.get(name, about.low)
            for place in [f".{k}" for k in range(about.count)] or [""]:
                path = f"effects.{effect}.{name}{place}"
                found.append(_unknown(path, about.unit, trial, low, about.high))
    return tuple(found)


def _ways(members: tuple[Unknown, ...]) -> list[tuple[Unknown, ...]]:
    """Return what is fitted, with and without what is either none or above some value."""
    certain = tuple(member for member in members if not _may_be_none(member.path))
    return [members] if len(certain) == len(members) else [certain, members]


def _is_without(members: tuple[Unknown, ...], machine: Actuator) -> bool:
    """Tell whether a machine has an effect, but none of what in it may be none."""
    stated = flat_record(machine)
    return any(
        getattr(machine.effects, member.path.split(".")[1]).is_on
        and column(stated, member.path)[0] == 0.0
        for member in members
        if _may_be_none(member.path)
    )


def _may_be_none(path: str) -> bool:
    group, effect, *name = path.split(".")
    return group == "effects" and name[0] in KNOWN[effect].none_or_above


class _Surplus:
    """Errors, and what the parameters deviate from what is expected, in units of both.

    Half the square of it all is minus the logarithm of the machine's probability.
    """

    def __init__(
        self,
        sheet: ActuatorSheet,
        members: tuple[Unknown, ...],
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


def fit(  # noqa: PLR0913 - what is fitted, to what, from where, and how hard
    sheet: ActuatorSheet,
    effects: tuple[str, ...],
    record: ActuatorRecord,
    noise: float,
    known: Sequence[Actuator] = (),
    *,
    seen: Mask | None = None,
    drawn: int = 0,
    levels: bool = False,
    thorough: bool = False,
    without: Sequence[str] = (),
) -> Fitted:
    """Return the most probable machine by the free run of the pressure, or the part `seen` (n,).

    noise: of the pressure. Starts are each known machine, effects that it lacks at their trial
    values, or with `levels` at all LEVELS of them; without any what is expected; and the best
    `drawn` of places drawn from what is expected. The best ENDED after some steps are gone on from
    to the end, `thorough` all.

    What in an effect is none or above some value is fitted both ways. With it fits begin where the
    effect is new or has it, `thorough` from every machine; places are drawn without it.
    without: parameters, by dotted path, that stay as the sheet's machine has them.
    """
    begun = []
    members = tuple(m for m in unknowns(sheet, effects) if m.path not in without)
    if not members:
        return _as_stated(sheet, _Surplus(sheet, members, record, noise, seen))
    ways = _ways(members)
    for way in ways:
        surplus = _Surplus(sheet, way, record, noise, seen)
        starts = [] if known else [surplus.expected]
        for machine in known:
            if way is members and not thorough and _is_without(members, machine):
                continue
            starts += _starts(sheet, way, machine) if levels else [_place(way, machine)]
        if drawn and (way is ways[0] or not known):
            starts += surplus.drawn(surplus.guessed)[:drawn]
        begun += [(surplus, surplus.least(x, surplus.guessed, SHORT)) for x in starts]
    begun.sort(key=lambda each: float(each[1].cost))
    ended = begun if thorough else begun[:ENDED]
    fits = [_ended(sheet, effects, surplus, found.x) for surplus, found in ended]
    return max(fits, key=lambda fitted: fitted.evidence)


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


def _stated(path: str, unit: str, value: float, low: float, high: float) -> Unknown:
    """Return an entry of the data sheet with its range."""
    found = _unknown(path, unit, value, low, high)
    at = found.position(value)
    return replace(found, expected=at, deviation=(found.high - found.low) / RANGE_DEVIATIONS)


def _unknown(path: str, unit: str, value: float, low: float, high: float) -> Unknown:
    """Return a parameter near a trial value; one of either sign is expected to be zero."""
    if low * high > 0.0 and max(high / low, low / high) > WIDE:
        least, most = sorted((math.log(low / value), math.log(high / value)))
        width = math.log(TYPICAL_FACTOR)
        return Unknown(path, unit, value, least, most, True, 0.0, width)
    scale = abs(value) or max(abs(low), abs(high))
    expected = 0.0 if low < 0.0 < high else value / scale
    return Unknown(path, unit, scale, low / scale, high / scale, False, expected, TYPICAL)


def _starts(sheet: ActuatorSheet, members: Sequence[Unknown], known: Actuator) -> list[Array]:
    """Return places, (k,), with what a known machine lacks at all LEVELS of its trial values.

    Beyond a threshold, or far from a mode, an effect changes nothing: no slope leads there. And
    the machine may be what it is for want of the effect: also with the sheet's own parameters.
    """
    stated = declared(sheet.machine)
    as_stated = with_values(known, {path: stated[path][1] for path in sheet.ranges})
    bases = dict.fromkeys([known, as_stated])
    return [_place(members, base, level) for base in bases for level in LEVELS]


def _place(members: Sequence[Unknown], known: Actuator, level: float = 1.0) -> Array:
    """Return a known machine's place, (k,), what it lacks at a level of its trial values."""
    stated = flat_record(known)

    def position(member: Unknown) -> float:
        group, effect, *_ = member.path.split(".")
        if group == "effects" and not getattr(known.effects, effect).is_on:
            return member.position(level * _trial(member.path))
        return member.position(float(column(stated, member.path)[0]))

    return np.array([position(member) for member in members])


def _trial(path: str) -> float:
    _, effect, name, *_ = path.split(".")
    return KNOWN[effect].trial[name]

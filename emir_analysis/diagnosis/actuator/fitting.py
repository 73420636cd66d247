"""Fitting an actuator's parameters and those of effects to the free run of its pressure."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from emir_analysis.diagnosis.actuator.record import ActuatorRecord
from emir_analysis.signals import Array
from emir_common.parameter_tree import declared, with_values
from emir_common.quantity import quantities
from emir_plant.actuator import REGISTRY, Actuator, ActuatorSheet, simulate
from emir_plant.actuator.model import field, run
from emir_plant.actuator.model import record as flat_record

STEP = 1e-3  # of the finite differences, in units of the trial value or the logarithm
EVALUATIONS = 40  # of the model in one fit, beside those for the Jacobian
ACCURACY = 1e-5  # relative, of cost and vector
WIDE = 20.0  # a parameter whose range spans more than this factor is fitted as its logarithm
SPREAD = math.log(4.0)  # of further starts: up to this factor from a known or a trial value
DRAWN = 60  # places that are looked at for each further start; the best one is taken

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Unknown:
    """One parameter: value = scale x, or scale exp(x) when logarithmic; low, high: bounds of x."""

    path: str
    unit: str
    scale: float
    low: float
    high: float
    logarithmic: bool

    def value(self, x: float) -> float:
        """Return the parameter's value."""
        return self.scale * math.exp(x) if self.logarithmic else self.scale * x

    def position(self, value: float) -> float:
        """Return x at a value, inside the bounds."""
        x = math.log(value / self.scale) if self.logarithmic else value / self.scale
        return min(max(x, self.low), self.high)

    def near(self, x: float, random: float) -> float:
        """Return a place up to a factor away; random: -1 ... 1."""
        moved = x + SPREAD * random if self.logarithmic else x * math.exp(SPREAD * random)
        return min(max(moved, self.low), self.high)


@dataclass(frozen=True)
class Fitted:
    """A machine fitted with effects: x (k,) at the optimum, its covariance (k, k), rms error."""

    effects: tuple[str, ...]
    unknowns: tuple[Unknown, ...]
    machine: Actuator
    x: Array
    covariance: Array
    rms: float

    @property
    def name(self) -> str:
        """Return what it is called in reports."""
        return " and ".join(self.effects) or "parameters only"


def unknowns(sheet: ActuatorSheet, effects: Sequence[str]) -> tuple[Unknown, ...]:
    """Return what a data sheet leaves open and all parameters of the named effects."""
    stated = declared(sheet.machine)
    found = [
        _unknown(path, stated[path][0].unit, float(stated[path][1]), low, high)
        for path, (low, high) in sheet.ranges.items()
    ]
    for effect in effects:
        kind = REGISTRY[effect]
        for name, about in quantities(kind).items():
            path = f"effects.{effect}.{name}"
            found.append(_unknown(path, about.unit, kind.trial[name], about.low, about.high))
    return tuple(found)


def fit(  # noqa: PLR0913 - what is fitted, to what, from where, and how hard
    sheet: ActuatorSheet,
    effects: tuple[str, ...],
    record: ActuatorRecord,
    known: Actuator,
    *,
    seen: Mask | None = None,
    restarts: int = 0,
) -> Fitted:
    """Minimise the free-run error of the pressure, or of the part `seen` (n,) of it.

    known: machine at which the search starts; effects that it lacks start at their trial values.
    restarts: further starts, each the best of some places anywhere in the data sheet's ranges or
    around that machine in turn, the same every time.
    """
    members = unknowns(sheet, effects)
    low = np.array([member.low for member in members])
    high = np.array([member.high for member in members])
    part = slice(None) if seen is None else seen

    def machine(x: Array) -> Actuator:
        values = {m.path: m.value(float(v)) for m, v in zip(members, x, strict=True)}
        return with_values(sheet.machine, values)

    parameters = flat_record(sheet.machine)
    places = [field(member.path) for member in members]

    def error(x: Array) -> Array:
        for place, member, v in zip(places, members, x, strict=True):
            parameters[place] = member.value(float(v))
        simulated = run(parameters, record.opening, record.period, float(record.pressure[0]))
        return np.asarray((simulated - record.pressure)[part])

    def jacobian(x: Array) -> Array:
        here = error(x)
        steps = np.where(x + STEP > high, -STEP, STEP)
        moved = x + np.diag(steps)
        return np.stack([(error(row) - here) / s for row, s in zip(moved, steps, strict=True)], 1)

    first = _start(members, effects, known)
    random = np.random.default_rng(0)

    def near() -> Array:
        signs = random.uniform(-1.0, 1.0, first.size)
        return np.array([m.near(x, r) for m, x, r in zip(members, first, signs, strict=True)])

    def anywhere() -> Array:
        stated = len(sheet.ranges)
        return np.append(random.uniform(low, high)[:stated], near()[stated:])

    def size(x: Array) -> float:
        return float(np.mean(error(x) ** 2))

    starts = [first]
    for k in range(restarts):
        draw = near if k % 2 else anywhere
        starts.append(min((draw() for _ in range(DRAWN)), key=size))
    margin = 1e-6 * (high - low)
    found = [
        least_squares(
            error, np.clip(start, low + margin, high - margin), jac=jacobian, bounds=(low, high),
            xtol=ACCURACY, ftol=ACCURACY, max_nfev=EVALUATIONS,
        )
        for start in starts
    ]  # fmt: skip
    best = min(found, key=lambda result: float(result.cost))
    x = np.asarray(best.x)
    return Fitted(
        effects,
        members,
        machine(x),
        x,
        _covariance(np.asarray(best.jac), np.asarray(best.fun)),
        math.sqrt(2.0 * float(best.cost) / best.fun.size),
    )


def free_run(machine: Actuator, record: ActuatorRecord) -> Array:
    """Return the simulated pressure (n,), from standstill at the first measured pressure."""
    return simulate(machine, record.opening, record.period, float(record.pressure[0]))


def free_run_error(machine: Actuator, record: ActuatorRecord) -> Array:
    """Return simulated minus measured pressure, (n,)."""
    return free_run(machine, record) - record.pressure


def _unknown(path: str, unit: str, value: float, low: float, high: float) -> Unknown:
    if low * high > 0.0 and max(high / low, low / high) > WIDE:
        ends = sorted((math.log(low / value), math.log(high / value)))
        return Unknown(path, unit, value, ends[0], ends[1], logarithmic=True)
    scale = abs(value) or max(abs(low), abs(high))
    return Unknown(path, unit, scale, low / scale, high / scale, logarithmic=False)


def _start(members: Sequence[Unknown], effects: Sequence[str], known: Actuator) -> Array:
    stated = declared(known)
    present = {e for e in effects if _is_on(known, e)}
    start = []
    for member in members:
        group, effect, *_ = member.path.split(".")
        new = group == "effects" and effect not in present
        value = _trial(member.path) if new else float(stated[member.path][1])
        start.append(member.position(value))
    return np.array(start)


def _trial(path: str) -> float:
    _, effect, name = path.split(".")
    return REGISTRY[effect].trial[name]


def _is_on(machine: Actuator, effect: str) -> bool:
    members = getattr(machine.effects, effect)
    return any(getattr(members, size) != 0.0 for size in members.sizes)


def _covariance(jacobian: Array, error: Array) -> Array:
    """Return the covariance (k, k) from the curvature; errors in a row count as one.

    The number of independent errors follows from their correlation (Bartlett 1946).
    """
    centred = error - error.mean()
    size = error.size
    if not np.any(centred):
        return np.zeros((jacobian.shape[1], jacobian.shape[1]))
    correlation = np.correlate(centred, centred, "full")[size - 1 :] / (centred @ centred)
    repeated = float(1.0 + 2.0 * np.sum(correlation[1 : size // 4] ** 2))
    inverse = np.linalg.pinv(jacobian.T @ jacobian)
    return np.asarray(inverse * np.mean(error**2) * repeated)

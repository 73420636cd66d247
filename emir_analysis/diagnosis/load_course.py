"""A load from outside of any course: a force over time that no state of the machine foretells.

A wind or pushes that come when they come follow no formula. What tells them from all that has no
name is that nothing in the machine foretells the force that is missing; that they are loads, that
one force over time at the TCP or about the joint explains the pressures, the way and the bending.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize_scalar

from emir_analysis.diagnosis.balances import BALANCES, FORCE, level
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.fit import DIFFERENCE_STEP
from emir_analysis.diagnosis.loads import LOAD
from emir_analysis.diagnosis.missing import in_balances
from emir_analysis.diagnosis.select import EXPLAINED, beyond, excess, limits, quiet
from emir_analysis.diagnosis.shape import best_shape
from emir_analysis.diagnosis.straight import Straight
from emir_analysis.diagnosis.trial import Trial
from emir_analysis.diagnosis.unknowns import Unknown, Unknowns
from emir_analysis.diagnosis.unnamed import bending, fitted_smoothly
from emir_analysis.diagnosis.whole import Progress
from emir_analysis.root_mean_square import rms
from emir_analysis.signals import Array
from emir_common.parameter_tree import with_values
from emir_plant.parameters import Machine
from emir_plant.unnamed import load

FORETOLD = 0.3  # share of a missing force: signals that foretell more say that it is no such load
LOUD = 2.0  # times the noise, from which on there is enough of a force to ask what foretells it
FOLDS = 5  # parts of a recording, each foretold from the others
RIDGE = 1.0  # expected size of a signal's share in it, in standard deviations of both
COURSE = "unnamed_load.course."  # begin of its points' paths
SHARE = "unnamed_load.joint_share"
SHARES = tuple(np.linspace(0.0, 1.0, 6))  # at which it is looked for
BENT = 1.0  # standard deviation of the course's second differences, in units of its size
LARGEST = 30.0  # times the size of what is missing: a load goes no further
INSIDE = 0.7  # of a load about the joint: more, and it may as well be a force in the cylinder
MOVED = np.array([name in {"force", "bending"} for name in BALANCES])  # balances, by any load


def load_course(known: Trial, evidence: Evidence, floor: Array, progress: Progress) -> Trial | None:
    """Return a trial with a load over time, fitted to the free run of one recording.

    known: fitted to the balances, with effects that act elsewhere. None where these tell no force
    and no bending, another of them speaks, the machine's own signals foretell what is missing, or
    where the load does not explain all or does not bend the boom. floor: (5,) of the balances.
    """
    if not may_be_loaded(known, evidence):
        return None
    progress(f"a load of any course beside: {known.name}")
    begun = _begun(known, evidence, floor)
    if _may_be_inside(begun):
        return None
    found = fitted_smoothly(begun, evidence, BENT)
    if _may_be_inside(found) or not excess(found, evidence) <= beyond(EXPLAINED):
        return None  # NaN of a run out of bounds
    left = level(evidence.residuals([found.machine])[0])
    return found if quiet(left, limits(found.machine, evidence)) else None


def may_be_loaded(known: Trial, evidence: Evidence) -> bool:
    """Tell whether a force alone is missing, in one recording, that no signal foretells."""
    if len(evidence.experiments) > 1 or not np.all(evidence.told[MOVED]):
        return False
    residuals = evidence.residuals([known.machine])[0]
    left, limit = level(residuals), limits(known.machine, evidence)
    noise = float(evidence.floor(known.machine)[FORCE])
    if not quiet(np.where(MOVED, np.nan, left), limit) or left[FORCE] < LOUD * noise:
        return False
    return foretold(residuals[:, FORCE], evidence, noise) <= FORETOLD


def _may_be_inside(loaded: Trial) -> bool:
    """Tell whether a load acts where friction of the piston does, which bends no arm either."""
    return loaded.machine.unnamed_load.joint_share > INSIDE


def has_course(known: Trial) -> bool:
    """Tell whether a trial's machine has a load of any course."""
    return known.unknowns.machine.unnamed_load.over != 0


def elsewhere(known: Trial) -> Trial:
    """Return a trial without the course of its load, which is another in each recording."""
    machine = with_values(known.unknowns.machine, {"unnamed_load.over": 0})
    return replace(known, unknowns=replace(known.unknowns, machine=machine))


def sizes(known: Trial) -> dict[str, tuple[float, float, str]]:
    """Return a load's mean and what of its course is furthest from that: N, spread, meaning."""
    own = [k for k, u in enumerate(known.unknowns.members) if u.path.startswith(COURSE)]
    size, x, spread = known.unknowns.members[own[0]].scale, known.x[own], known.spread[own]
    mean, furthest = float(np.mean(x)), int(np.argmax(np.abs(x - np.mean(x))))
    of_mean = math.sqrt(max(float(np.mean(known.covariance[np.ix_(own, own)])), 0.0))
    return {
        "mean": (size * mean, size * of_mean, "of its course, as at the TCP"),
        "force": (
            size * (float(x[furthest]) - mean),
            size * float(spread[furthest]),
            "furthest from the mean",
        ),
    }


def foretold(force: Array, evidence: Evidence, noise: float) -> float:
    """Return the share of a missing force, (w,) N, that the machine's signals foretell.

    Of what changes in it, since a constant is foretold by no signal: pushes of one direction have a
    mean. In parts of the recording left out: by a function of one signal, or all of them times a
    constant each, the direction of the motion among them. noise: N, which nothing foretells.
    """
    force = force - np.mean(force)
    signals = evidence.signals()
    del signals["time"]
    velocity = signals["piston_velocity"][1]
    single = best_shape(force, velocity, signals).share
    known = [values for _, values in signals.values()]
    together = _together(force, np.column_stack([*known, np.sign(velocity)]))
    above = max(1.0 - noise**2 / float(np.mean(force**2)), np.finfo(float).tiny)
    return max(single, together) / above


def _together(missing: Array, signals: Array) -> float:
    """Return the share of what is missing, (w,), that signals, (w, s), foretell by constants."""
    scaled = (signals - signals.mean(axis=0)) / np.maximum(
        signals.std(axis=0), np.finfo(float).tiny
    )
    rows = np.column_stack([np.ones(missing.size), scaled])
    expected = np.diag([0.0, *np.full(scaled.shape[1], 1.0 / RIDGE**2)])
    part = np.arange(missing.size) * FOLDS // missing.size
    told = np.zeros_like(missing)
    for k in range(FOLDS):
        seen = part != k
        normal = rows[seen].T @ rows[seen] + expected
        told[~seen] = rows[~seen] @ np.linalg.solve(normal, rows[seen].T @ missing[seen])
    return 1.0 - float(np.mean((missing - told) ** 2) / np.var(missing))


def _begun(known: Trial, evidence: Evidence, floor: Array) -> Trial:
    """Return a trial with a load as the balances have it."""
    force = rms(evidence.residuals([known.machine])[0][:, FORCE])
    straight = Straight(known, in_balances(evidence, floor), DIFFERENCE_STEP)
    geometry = known.machine.geometry
    points = _points(force * geometry.triangle_b / geometry.boom_length)
    end = float(evidence.experiments[0].time[-1])
    named = {"unnamed_load.over": load.TIME, "unnamed_load.last": end}
    machine = with_values(known.unknowns.machine, named)
    tip, joint = (_slopes(known, machine, share, points, evidence, floor) for share in (0.0, 1.0))
    expected = np.hstack([np.zeros((load.COURSE - 2, known.x.size)), bending(load.COURSE, BENT)])

    def least(share: float) -> tuple[Array, Array]:
        slopes = (1.0 - share) * tip + share * joint
        return straight.least(list(zip(points, slopes.T, strict=True)), expected)

    share = _lowest(lambda share: float(np.sum(least(share)[1] ** 2)))
    members = (
        *known.unknowns.members,
        *points,
        Unknown(SHARE, "1", 0.0, 1.0, 0.0, 1.0, 0.0, False),
    )
    x = np.append(least(share)[0], share)
    untold = np.full((x.size, x.size), np.nan)
    return Trial((*known.effects, LOAD), Unknowns(machine, members), x, untold)


def _lowest(cost: Callable[[float], float]) -> float:
    """Return the share at which a cost is lowest; it may have several minima."""
    best = min(SHARES, key=cost)
    bounds = max(best - SHARES[1], 0.0), min(best + SHARES[1], 1.0)
    return float(minimize_scalar(cost, bounds=bounds, method="bounded").x)


def _points(size: float) -> tuple[Unknown, ...]:
    """Return the course's points as unknowns in units of a size, N at the TCP."""
    paths = [f"{COURSE}{k}" for k in range(load.COURSE)]
    return tuple(Unknown(p, "N", 0.0, size, -LARGEST, LARGEST, 0.0, False) for p in paths)


def _slopes(  # noqa: PLR0913, PLR0917 (what is asked, of what)
    known: Trial,
    machine: Machine,
    share: float,
    points: tuple[Unknown, ...],
    evidence: Evidence,
    floor: Array,
) -> Array:
    """Return the slopes, (n, p), of what the balances lack by the points of a load's course."""
    there = Unknowns(with_values(machine, {SHARE: share}), known.unknowns.members).at(known.x)
    moved = evidence.residuals([there, *map(Unknowns(there, points).at, np.eye(len(points)))])
    missing = evidence.in_noise(moved, floor)
    return np.asarray(np.nan_to_num((missing[1:] - missing[0]).T))

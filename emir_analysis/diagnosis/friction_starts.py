"""Where a fit of friction begins: many shapes near standstill, all else by the balances.

The balances' windows tell how much friction there is, but hardly how it falls behind the
break-away: that lies between two of them. With a shape given, how much it is and what else is
fitted is a nearly linear problem, and the whole recordings answer it. Its weak point is how much
of the friction is viscous, which a wrong shape makes up for: each shape also begins without.
"""

from itertools import product

import numpy as np
from scipy.optimize import least_squares

from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.fit import DIFFERENCE_STEP, TOLERANCE_SPREAD, mean_squares
from emir_analysis.diagnosis.friction_laws import viscous_is_heard
from emir_analysis.diagnosis.missing import in_balances
from emir_analysis.diagnosis.run_errors import coarse_errors
from emir_analysis.diagnosis.straight import Straight
from emir_analysis.diagnosis.trial import Trial
from emir_analysis.signals import Array

SHAPES = {  # that are tried in all combinations
    "effects.stribeck_friction.breakaway": (1.15, 1.4, 1.7, 2.2),  # 1
    "effects.stribeck_friction.stribeck_speed": (2.5e-3, 5e-3, 1e-2, 2e-2),  # m/s
    "effects.stribeck_friction.smoothing_speed": (2e-4, 6e-4, 1.8e-3),  # m/s
    "effects.stribeck_friction.presliding": (1e-5, 3e-5, 1e-4),  # m, in its place
}
INSIDE = 1e-6  # in units of an unknown, of its bounds, as the solver demands
DRY = "effects.stribeck_friction.force"
VISCOUS = "effects.viscous_friction.coefficient"


def friction_starts(start: Trial, evidence: Evidence, floor: Array, first: float) -> list[Trial]:
    """Return a trial with other friction, that first whose free run begins best.

    start: with `stribeck_friction` and `viscous_friction`. floor: (5,) what the sensors leave in
    each balance. first: s, of the free run that is compared.
    """
    points = _by_balances(start, evidence, floor)
    errors = coarse_errors([start.unknowns.at(x) for x in points], evidence.until(first))
    return [start.at(points[k]) for k in np.argsort(mean_squares(errors))]


def _by_balances(start: Trial, evidence: Evidence, floor: Array) -> Array:
    """Return vectors, (m, k), of all shapes with what else the balances say beside each.

    Each with viscous friction and, where that is heard, without.
    """
    of_trials = in_balances(evidence, floor)

    def missing(points: Array) -> Array:
        return np.nan_to_num(of_trials([start.at(x) for x in points]))

    paths = [unknown.path for unknown in start.unknowns.members]
    shaping = [paths.index(path) for path in SHAPES if path in paths]
    dry, viscous = paths.index(DRY), paths.index(VISCOUS)
    others = np.array([k not in (*shaping, dry, viscous) for k in range(len(paths))])
    shapes, size = _grid(start), np.eye(start.x.size)
    points = np.tile(start.x, (len(shapes), 1))
    points[:, shaping] = shapes
    points[:, [dry, viscous]] = 0.0
    # without dry friction its shape makes no difference
    without, flowing = missing(points[0] + np.outer([0.0, 1.0], size[viscous]))
    # of the others found once for all friction
    acting = Straight(start, of_trials, DIFFERENCE_STEP, others).slopes.T
    acting = np.vstack([acting, flowing - without])
    free = np.append(np.flatnonzero(others), [viscous, dry])
    still = free != viscous
    found = []
    for point, sliding in zip(points, missing(points + size[dry]), strict=True):
        slopes = np.vstack([acting, sliding - without])
        found.append(_least(start, point, free, without, slopes))
        if viscous_is_heard(start.at(found[-1]), evidence, floor):
            found.append(_least(start, point, free[still], without, slopes[still]))
    return np.array(found)


def _grid(start: Trial) -> Array:
    """Return all shapes as the trial's unknowns, (m, 3)."""
    members = {unknown.path: unknown for unknown in start.unknowns.members}
    tried = {path: values for path, values in SHAPES.items() if path in members}
    levels = [[members[path].at(v) for v in values] for path, values in tried.items()]
    return np.array(list(product(*levels)))


def _least(start: Trial, point: Array, free: Array, left: Array, slopes: Array) -> Array:
    """Return the point, (k,), with those free unknowns, (f,), that leave least of a linear model.

    left: (n,) at the point, slopes: (f, n). Each of the maker's is held to what he states.
    """
    held = start.unknowns.toleranced[free] / TOLERANCE_SPREAD
    low, high = (bound[free] for bound in start.unknowns.bounds)
    origin = point[free]

    def residuals(x: Array) -> Array:
        return np.append(left + (x - origin) @ slopes, held * x)

    def jacobian(_: Array) -> Array:
        return np.vstack([slopes.T, np.diag(held)])

    begin = np.clip(origin, low + INSIDE, high - INSIDE)
    found = least_squares(residuals, begin, jacobian, bounds=(low, high), loss="soft_l1")
    moved = point.copy()
    moved[free] = found.x
    return moved

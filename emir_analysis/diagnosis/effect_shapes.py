"""Where fits of an effect begin in what is none of its sizes, such as an onset or a share."""

import math
from itertools import product

import numpy as np

from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.fit import mean_squares
from emir_analysis.diagnosis.loads import LOAD
from emir_analysis.diagnosis.run_errors import coarse_errors
from emir_analysis.diagnosis.trial import Trial, moved
from emir_analysis.diagnosis.unknowns import Unknown
from emir_analysis.signals import Array

SAME = 0.05  # of a share, within which it was led to an end
MOST_SHAPING = 3  # fields of an effect, beside its sizes, that are tried in all combinations
SHAPE_STEP = math.log(4.0)  # between those that are tried of a field that is fitted as its log


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


def at_other_ends(known: Trial, told: Trial) -> list[Trial]:
    """Return a trial with each share set to none and to all, but to where it was led already.

    A load's shares are told by where it is begun. told: the trial fitted further.
    """
    return [
        known.fixed(unknown.path, end)
        for unknown, x in zip(known.unknowns.members, told.x, strict=True)
        if unknown.is_share and not unknown.path.startswith(f"effects.{LOAD}.")
        for end in (0.0, 1.0)
        if abs(x - unknown.at(end)) > SAME * abs(unknown.at(1.0))
    ]


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

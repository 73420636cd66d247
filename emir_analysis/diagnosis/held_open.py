"""A logic block that shuts below where it opens, begun from one with a single threshold.

Slopes say nothing of what switches: both thresholds are looked for in steps about the single one,
which was fitted to lie between them.
"""

from itertools import product

import numpy as np

from emir_analysis.diagnosis.trial import Trial, moved
from emir_analysis.diagnosis.unknowns import first_tried, in_proportion

BLOCK = "logic_block_fault"
THRESHOLD, HYSTERESIS = f"effects.{BLOCK}.threshold", f"effects.{BLOCK}.hysteresis"
STEPS = tuple(range(1, 13))  # of the size that is tried first
ABOVE = (0.0, 0.5, 1.0)  # of the hysteresis: where it opens, above the single threshold


def held_open(known: Trial) -> list[Trial]:
    """Return trials whose logic block shuts below where it opens, with all else as stated or not.

    None without a fault of its threshold, or where it may already.
    """
    paths = [unknown.path for unknown in known.unknowns.members]
    if THRESHOLD not in paths or HYSTERESIS in paths:
        return []
    scale = first_tried(BLOCK, "hysteresis", known.machine)
    begun = known.also(in_proportion(BLOCK, "hysteresis", scale, 0.0))
    members, at = begun.unknowns.members, paths.index(THRESHOLD)
    threshold = members[at]
    others = [
        k
        for k, unknown in enumerate(members[:-1])
        if unknown.path.startswith(f"effects.{BLOCK}.") and k != at
    ]
    low, high = begun.unknowns.bounds
    single = threshold.value(begun.x[at])
    bases = [begun.x, moved(begun.x, others, [0.0] * len(others))] if others else [begun.x]
    ways = [
        moved(base, [at, -1], [threshold.at(single + above * step * scale), step])
        for base, step, above in product(bases, STEPS, ABOVE)
    ]
    return [begun.at(np.clip(x, low, high)) for x in ways]

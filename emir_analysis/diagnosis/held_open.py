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
    """Return trials whose logic block shuts below where it opens, and is as stated in all else.

    None without a fault of its threshold, or where it may already.
    """
    begun = known.with_sizes(BLOCK, ["threshold"])
    paths = [unknown.path for unknown in begun.unknowns.members]
    if THRESHOLD not in paths or HYSTERESIS in known.unknowns.values(known.x):
        return []
    at, scale = paths.index(THRESHOLD), first_tried(BLOCK, "hysteresis", known.machine)
    begun = begun.also(in_proportion(BLOCK, "hysteresis", scale, 0.0))
    threshold, (low, high) = begun.unknowns.members[at], begun.unknowns.bounds
    single = threshold.value(float(begun.x[at]))
    ways = [
        moved(begun.x, [at, -1], [threshold.at(single + above * step * scale), step])
        for step, above in product(STEPS, ABOVE)
    ]
    return [begun.at(np.clip(x, low, high)) for x in ways]

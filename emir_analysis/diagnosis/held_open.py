"""A logic block that shuts below where it opens, begun from one with a single threshold."""

from emir_analysis.diagnosis.trial import Trial
from emir_analysis.diagnosis.unknowns import first_tried, in_proportion

BLOCK = "logic_block_fault"


def held_open(known: Trial) -> Trial | None:
    """Return a trial whose logic block may shut below where it opens, and is as stated in all else.

    None without a fault of its threshold, or where it may already.
    """
    sizes = known.sizes(BLOCK)
    if "threshold" not in sizes or "hysteresis" in sizes:
        return None
    scale = first_tried(BLOCK, "hysteresis", known.machine)
    hysteresis = in_proportion(BLOCK, "hysteresis", scale, 1.0)
    return known.with_sizes(BLOCK, ["threshold"]).also(hysteresis)

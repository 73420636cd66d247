"""An effect of another law begun at the size that it needs.

What goes with the square of a flow is another number than what goes with the flow.
"""

from collections.abc import Iterator

import numpy as np

from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.fit import mean_squares
from emir_analysis.diagnosis.missing import in_free_run
from emir_analysis.diagnosis.trial import Trial, moved

# times as large, in steps of a tenth: between coarser ones what acts beyond some flow does nothing,
# and then far too much
TIMES = np.geomspace(0.15, 7.0, 40)


def resized(known: Trial, share: str, evidence: Evidence) -> Trial:
    """Return a trial with the size at which an effect explains the free run best, or as it is.

    share: the parameter that says which law the effect has, by dotted path. Of an effect with
    several sizes one alone is changed.
    """
    ways = [known, *_other_sizes(known, share.rpartition(".")[0])]
    left = mean_squares(in_free_run(known, evidence)(ways))
    return ways[int(np.argmin(left))]


def _other_sizes(known: Trial, effect: str) -> Iterator[Trial]:
    """Yield a trial with each size of an effect, by dotted path, larger and smaller."""
    for k, unknown in enumerate(known.unknowns.members):
        if unknown.path.rpartition(".")[0] == effect and not unknown.shapes:
            size = unknown.value(float(known.x[k]))
            for other in TIMES * size if size else ():
                x = float(np.clip(unknown.at(float(other)), unknown.low, unknown.high))
                yield known.at(moved(known.x, [k], [x]))

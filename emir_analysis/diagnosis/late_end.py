"""A load that ends in the part of a recording that no fit has seen."""

import numpy as np

from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.fit import mean_squares
from emir_analysis.diagnosis.loads import LOAD
from emir_analysis.diagnosis.run_errors import coarse_errors
from emir_analysis.diagnosis.trial import Trial

DURATION = f"effects.{LOAD}.duration"
END_STEP = 0.5  # s, between the ends that are tried


def with_a_late_end(loaded: Trial, evidence: Evidence, seen: float) -> Trial:
    """Return a trial whose load ends when that explains the whole recordings best.

    Nothing tells a fit to the beginning when a load ends that is still there where that beginning
    ends. seen: share of the recordings that the fit had. What else is fitted stays as it is.
    """
    paths = [unknown.path for unknown in loaded.unknowns.members]
    if DURATION not in paths:
        return loaded
    k, length = paths.index(DURATION), float(evidence.experiments[0].time[-1])
    load = loaded.machine.effects.external_load
    lasting = np.arange(seen * length, length, END_STEP) - load.start
    lasting = lasting[(lasting > 0.0) & (lasting < load.duration)]
    if not lasting.size:
        return loaded
    points = np.tile(loaded.x, (lasting.size + 1, 1))
    points[1:, k] = [loaded.unknowns.members[k].at(float(duration)) for duration in lasting]
    errors = coarse_errors([loaded.unknowns.at(x) for x in points], evidence)
    return loaded.at(points[int(np.argmin(mean_squares(errors)))])

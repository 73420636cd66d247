"""Whether a free run explains its recordings, as far as anybody could foresee them.

A piston that sticks multiplies what no sensor tells of its start: two runs of one machine that
begin within half a step of the resolver may part at a later stick. No model follows such a
machine to the end, and to be no nearer than those runs are to each other says nothing against it.
"""

from functools import lru_cache

import numpy as np

from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.experiment import Experiment
from emir_analysis.diagnosis.free_run import COMPARED, free_runs
from emir_analysis.diagnosis.friction_laws import sticks
from emir_analysis.diagnosis.run_errors import at_rest
from emir_analysis.diagnosis.select import EXPLAINED, at_noise, excess, leaves_quiet
from emir_analysis.diagnosis.stick_slip import DECIDED
from emir_analysis.diagnosis.trial import Trial
from emir_analysis.signals import Array
from emir_plant.parameters import Machine

STARTS = np.linspace(-1.0, 1.0, 5)  # angles at rest, in half steps of the resolver


def is_enough(known: Trial, evidence: Evidence) -> bool:
    """Tell whether a trial leaves no balance speaking and explains the free run."""
    return leaves_quiet(known, evidence) and explained(known, evidence)


def explained(known: Trial, evidence: Evidence) -> bool:
    """Tell whether a trial's free run explains recordings: all signals together, in their noise.

    To within EXPLAINED times what a right model leaves: the noise, and of one that sticks the
    difference of two runs that parted where no sensor could tell. A series, which has terms enough
    to stand for another effect, has to be at the noise.
    """
    if known.has_series and not sticks(known):
        return at_noise(known, evidence)
    error, right = 1.0 + excess(known, evidence), 1.0
    if error > EXPLAINED**2 and sticks(known):
        right += 2.0 * parting(known.machine, evidence)
    return error <= EXPLAINED**2 * right


@lru_cache(maxsize=4)  # asked again for the verdict
def parting(machine: Machine, evidence: Evidence) -> float:
    """Return the variance, in squares of the noise, among free runs that differ in their start.

    More than in the first DECIDED seconds: what the start itself makes stays as it is.
    """
    parts = [_apart(machine, e, evidence) for e in evidence.experiments]
    early = [
        part[: e.until(DECIDED).angle.size]
        for part, e in zip(parts, evidence.experiments, strict=True)
    ]
    return max(0.0, float(np.mean(np.concatenate(parts)) - np.mean(np.concatenate(early))))


def _apart(machine: Machine, experiment: Experiment, evidence: Evidence) -> Array:
    """Return the variance of the shown signals among the runs, (n, c), in squares of the noise."""
    angle, pressure = at_rest(machine, experiment, evidence)
    sensors = evidence.stated.sensors
    half_step = 0.5 * sensors.resolver_step
    starts = [(angle + half_step * start, pressure) for start in STARTS]
    runs = free_runs([machine] * len(starts), experiment, starts)[:, :, COMPARED]
    return np.asarray(np.var(runs / evidence.sensors, axis=0)[:, evidence.shown])

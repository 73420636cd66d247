"""Play that is none: a mount that yields in proportion to the force is a spring, not play."""

import numpy as np

from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.experiment import OUTPUTS, Experiment
from emir_analysis.diagnosis.run_errors import free_run
from emir_analysis.diagnosis.trial import Trial
from emir_analysis.root_mean_square import rms
from emir_analysis.signals import Array
from emir_plant.effects.backlash import flank
from emir_plant.parameters import Machine
from emir_plant.plant import Plant

BACKLASH = "backlash"
STRAIGHT = 0.1  # share of what the mount yields (RMS) that need not go with the force


def spring_in_series(named: Trial, evidence: Evidence) -> float | None:
    """Return the stiffness, N/m, of the spring that a trial's backlash is, if it is one.

    Over the forces of the recordings, as its free run has them.
    """
    if BACKLASH not in named.effects:
        return None
    force = np.concatenate([_force(named.machine, e, evidence) for e in evidence.experiments])
    yields = _offset(named.machine, force)
    slope, middle = np.polyfit(force, yields, 1)
    if rms(yields - middle - slope * force) > STRAIGHT * float(np.std(yields)):
        return None
    return float(1.0 / slope)


def _force(machine: Machine, experiment: Experiment, evidence: Evidence) -> Array:
    """Return the oil's force, (n,), N, of a recording's free run."""
    names = list(OUTPUTS)
    run = free_run(machine, experiment, evidence)
    lifting, lowering = (run[:, names.index(f"pressure_{way}")] for way in ("lifting", "lowering"))
    cylinder = machine.cylinder
    return np.asarray(cylinder.area_lifting * lifting - cylinder.area_lowering * lowering)


def _offset(machine: Machine, force: Array) -> Array:
    """Return where the piston rests against the joint, (n,), m, under forces, (n,), N."""
    p = Plant(machine).record[0]
    return np.array([flank(f, p) for f in force])

"""Machines that stick and slip: which friction it is, told by a beginning that grows.

Over a long run each instant of sticking shifts the next, and the error is a rough function of all
parameters: a fit ends close to where it began. Over a few seconds it is smooth, and from there on
the fit is led along. How friction falls behind the break-away and rises with speed lies between
two windows of the balances, so the fullest law is fitted, and what is not needed is left out.
"""

from dataclasses import replace

import numpy as np

from emir_analysis.diagnosis.candidates import Trial, free_run_problem, trial
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.fit import Solution, fit
from emir_analysis.signals import Array
from emir_plant.sheet import Sheet

FIRST = 3.0  # s, of the first beginning
GROWTH = 1.5  # of a beginning from one to the next
SLOPE_STEP = 3e-3  # as fit.STEP: over longer ones the piston sticks at other instants
ACCURACY = 1e-4  # relative, of the free run's squared error

COULOMB, STRIBECK, VISCOUS = "coulomb_friction", "stribeck_friction", "viscous_friction"
DRY = (COULOMB, STRIBECK, "pressure_dependent_friction")


def sticks(known: Trial) -> bool:
    """Tell whether a trial has dry friction."""
    return any(name in DRY for name in known.effects)


def fullest(known: Trial, sheet: Sheet) -> Trial:
    """Return a trial with the friction that has all others in it but the load's.

    The maker's parameters are as stated again: instants of sticking have led them astray.
    """
    for name in known.effects:
        if name in {*DRY, VISCOUS}:
            known = known.without(name)
    known = known.at(np.where(known.unknowns.toleranced, 0.0, known.x))
    return trial(sheet, (*known.effects, STRIBECK, VISCOUS), known)


def simpler(full: Trial, sheet: Sheet) -> list[Trial]:
    """Return trials with less friction, where it is not beyond doubt: not viscous, or Coulomb's."""
    found = []
    if VISCOUS in full.effects and not full.told(VISCOUS, "coefficient"):
        found.append(full.without(VISCOUS))
    if STRIBECK in full.effects and not full.told(STRIBECK, "breakaway", 1.0):
        found.append(_without_breakaway(full, sheet))
    return found


def grown(start: Trial, evidence: Evidence) -> Trial:
    """Fit a trial to the free run of a beginning that grows to the whole."""
    x = np.append(start.x, np.zeros(2 * len(evidence.experiments)))
    end, time = max(float(e.time[-1]) for e in evidence.experiments), FIRST
    while time < end:
        x = _fitted(start, evidence.until(time), x).x
        time *= GROWTH
    return start.continued(_fitted(start, evidence, x))


def further(known: Trial, evidence: Evidence) -> Trial:
    """Fit a trial that is near the optimum to the free run of the whole."""
    x = np.append(known.x, np.zeros(2 * len(evidence.experiments)))
    return known.continued(_fitted(known, evidence, x))


def _fitted(known: Trial, evidence: Evidence, x: Array) -> Solution:
    problem = free_run_problem(known, evidence, x)
    return fit(replace(problem, coarse=None, step=SLOPE_STEP), ACCURACY)


def _without_breakaway(full: Trial, sheet: Sheet) -> Trial:
    values, others = full.unknowns.values(full.x), full.without(STRIBECK)
    found = trial(sheet, (*others.effects, COULOMB), others)
    x = found.x.copy()
    for k, unknown in enumerate(found.unknowns.members):
        if unknown.path.startswith(f"effects.{COULOMB}."):
            x[k] = unknown.at(values[unknown.path.replace(COULOMB, STRIBECK)])
    return found.at(x)

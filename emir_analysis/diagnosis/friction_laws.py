"""The laws of friction among the effects, from the fullest to the simplest."""

import math

import numpy as np

from emir_analysis.diagnosis.balances import FORCE
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.trial import Trial, trial
from emir_analysis.diagnosis.unknowns import Unknown, first_tried, in_proportion
from emir_analysis.signals import Array
from emir_common.parameter_tree import declared
from emir_plant.sheet import Sheet

DRY = ("coulomb_friction", "stribeck_friction", "pressure_dependent_friction")
COULOMB, STRIBECK, VISCOUS = "coulomb_friction", "stribeck_friction", "viscous_friction"
BY_LOAD = "pressure_dependent_friction"
GIVE = 3e-5  # m, way on which seals give before they slide, at which a fit begins: 1e-5 ... 1e-4
LEAST_GIVE, MOST_GIVE = 5e-6, 3e-3  # m
DAMPED, MOST_DAMPED = 1e-3, 0.05  # s, by their damping: where a fit begins, and the most
ELASTIC = 0.8  # share of the friction up to which they spring back, about
UNEVEN = 0.2  # share by which friction differs with the direction, about
NEAR = 2.0  # standard deviations, within which a break-away may be none


def sticks(known: Trial) -> bool:
    """Tell whether a trial has dry friction."""
    return bool(_dry(known))


def nested(full: Trial, less: Trial) -> bool:
    """Tell whether one trial's friction is another's with a break-away of 1: Coulomb's."""
    without = {COULOMB if name == STRIBECK else name for name in full.effects}
    return full.effects != less.effects and without == set(less.effects)


def fullest(known: Trial, sheet: Sheet) -> Trial:
    """Return a trial with the friction that has all others in it but the load's.

    It comes by tanh. The maker's parameters are as stated again: instants of sticking have led them
    astray.
    """
    for name in known.effects:
        if name in {*DRY, VISCOUS}:
            known = known.without(name)
    known = known.at(np.where(known.unknowns.toleranced, 0.0, known.x))
    found = trial(sheet, (*known.effects, STRIBECK, VISCOUS), known)
    return found.fixed(_share(STRIBECK), 0.0)


def gradual(known: Trial) -> Trial:
    """Return a trial whose dry friction comes gradually in place of by tanh."""
    for name in _dry(known):
        known = known.fixed(_share(name), 1.0)
    return known


def with_sharper_friction(known: Trial, times: float) -> Trial:
    """Return a trial whose dry friction turns round at a multiple of the speed, inside bounds."""
    x = known.x.copy()
    speeds = {f"effects.{name}.smoothing_speed" for name in _dry(known)}
    for k, unknown in enumerate(known.unknowns.members):
        if unknown.path in speeds:
            x[k] = unknown.at(times * unknown.value(x[k]))
    return known.at(np.clip(x, *known.unknowns.bounds))


def along_the_way(known: Trial) -> Trial:
    """Return a trial whose dry friction comes along the way in place of with the velocity.

    The velocity at which it would turn round stays as it is. The balances go by that: no resolver
    shows so short a way. The same where all of it comes so already.
    """
    low, high = math.log(LEAST_GIVE / GIVE), math.log(MOST_GIVE / GIVE)
    most = MOST_DAMPED / DAMPED
    for name in [name for name in _dry(known) if not _gives(known, name)]:
        smoothing = f"effects.{name}.smoothing_speed"
        speed = declared(known.machine)[smoothing][1]
        known = known.fixed(smoothing, speed).fixed(_share(name), 0.0)
        way = f"effects.{name}.presliding"
        known = known.also(Unknown(way, "m", GIVE, 1.0, low, high, 0.0, False, logarithmic=True))
        known = known.also(Unknown(f"{way}_time", "s", 0.0, DAMPED, 0.0, most, 1.0, False))
    return known


def elastic(known: Trial) -> Trial:
    """Return a trial whose seals may spring back before they slide, where they give.

    The same where all that give may already.
    """
    for name in [name for name in _dry(known) if _gives(known, name)]:
        if not _springs(known, name):
            known = known.also(Unknown(_elastic(name), "1", 0.0, 1.0, 0.0, 1.0, ELASTIC, False))
    return known


def uneven(known: Trial) -> Trial:
    """Return a trial whose dry friction may differ with the direction of motion.

    Of several the first: how two differ is as hard to tell apart as their sizes.
    """
    dry = _dry(known)
    return known if is_uneven(known) or not dry else _uneven(known, dry[0])


def _uneven(known: Trial, name: str) -> Trial:
    return known.also(in_proportion(name, "asymmetry", UNEVEN, 0.0))


def even(known: Trial) -> Trial:
    """Return a trial whose dry friction is the same in both directions."""
    for name in _dry(known):
        known = known.fixed(_asymmetry(name), 0.0)
    return known


def is_uneven(known: Trial) -> bool:
    """Tell whether a trial's dry friction may differ with the direction."""
    paths = {unknown.path for unknown in known.unknowns.members}
    return any(_asymmetry(name) in paths for name in _dry(known))


def is_along_the_way(known: Trial) -> bool:
    """Tell whether a trial's dry friction comes along the way."""
    return any(_gives(known, name) for name in _dry(known))


def is_elastic(known: Trial) -> bool:
    """Tell whether a trial's seals may spring back before they slide."""
    return any(_springs(known, name) for name in _dry(known))


def is_gradual(known: Trial) -> bool:
    """Tell whether all of a trial's dry friction comes gradually."""
    shares = [getattr(known.machine.effects, name).gradual_share for name in _dry(known)]
    return all(share == 1.0 for share in shares)


def _dry(known: Trial) -> list[str]:
    return [name for name in known.effects if name in DRY]


def _gives(known: Trial, name: str) -> bool:
    """Tell whether a dry friction comes along the way."""
    return bool(getattr(known.machine.effects, name).presliding > 0.0)


def _springs(known: Trial, name: str) -> bool:
    """Tell whether a dry friction's seals may spring back before they slide."""
    return any(unknown.path == _elastic(name) for unknown in known.unknowns.members)


def simpler(full: Trial, sheet: Sheet) -> list[Trial]:
    """Return trials with less friction: an even one, without the viscous one or a break-away."""
    found = [even(full)] if is_uneven(full) else []
    if VISCOUS in full.effects:
        found.append(full.without(VISCOUS))
    if STRIBECK in full.effects:
        found.append(without_breakaway(full, sheet))
    return found


def viscous_is_heard(known: Trial, evidence: Evidence, floor: Array) -> bool:
    """Tell whether a trial's viscous friction at the fastest is above the force balance's noise.

    Where sensors are missing for that balance, any may be. floor: (5,) what the sensors leave in
    each balance, NaN where it is not told.
    """
    if VISCOUS not in known.effects:
        return False
    if not evidence.told[FORCE]:
        return True
    _, velocity = evidence.signals()["piston_velocity"]
    fastest = float(np.max(np.abs(velocity)))
    return known.machine.effects.viscous_friction.coefficient * fastest >= float(floor[FORCE])


def with_square(known: Trial) -> Trial | None:
    """Return a trial whose viscous friction may grow with the square of the speed, too.

    None without one, or where it may already.
    """
    path = f"effects.{VISCOUS}.square"
    if VISCOUS not in known.effects or path in known.unknowns.values(known.x):
        return None
    scale = first_tried(VISCOUS, "square", known.machine)
    return known.also(in_proportion(VISCOUS, "square", scale, 0.0))


def breakaway_may_be_none(known: Trial) -> bool:
    """Tell whether Stribeck's friction may be Coulomb's, by the curvature of a trial's fit."""
    for unknown, x, spread in zip(known.unknowns.members, known.x, known.spread, strict=True):
        if unknown.path == f"effects.{STRIBECK}.breakaway":
            return bool(x - NEAR * spread <= unknown.low)
    return False


def without_breakaway(full: Trial, sheet: Sheet) -> Trial:
    """Return a trial with Coulomb's friction in place of Stribeck's, of the same size."""
    values, others = full.unknowns.values(full.x), full.without(STRIBECK)
    found = trial(sheet, (*others.effects, COULOMB), others)
    found = found.fixed(_share(COULOMB), full.machine.effects.stribeck_friction.gradual_share)
    if is_along_the_way(full):
        found = along_the_way(found)
    if is_elastic(full):
        found = elastic(found)
    if _asymmetry(STRIBECK) in values:
        found = _uneven(found, COULOMB)
    x = found.x.copy()
    for k, unknown in enumerate(found.unknowns.members):
        if unknown.path.startswith(f"effects.{COULOMB}."):
            x[k] = unknown.at(values[unknown.path.replace(COULOMB, STRIBECK)])
    return found.at(x)


def _share(effect: str) -> str:
    return f"effects.{effect}.gradual_share"


def _elastic(effect: str) -> str:
    return f"effects.{effect}.elastic_share"


def _asymmetry(effect: str) -> str:
    return f"effects.{effect}.asymmetry"

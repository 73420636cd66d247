"""Which curves a machine may be given for what has no name, and over what they run."""

from dataclasses import dataclass, replace

import numpy as np

from emir_analysis.diagnosis.balances import BALANCES
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.signals import Array
from emir_common.quantity import quantities
from emir_plant.parameters import Machine
from emir_plant.unnamed import UNNAMED, compliance, force, leakage, load, opening

STROKE, H, S = range(3)  # columns of an experiment's outputs
DIFFERENCE = "pressure_difference"
CHAMBERS = {"lifting_chamber", "lowering_chamber"}
OWN = "own_pressure"  # of each chamber
ACTS_IN = {  # balances, by list; the others act in both chambers
    "along": {"force"},
    "friction": {"force"},
    "lifting": {"lifting_chamber"},
    "lowering": {"lowering_chamber"},
}
CURVE_PARTS = {  # the lists, in words
    "along": "whatever the direction",
    "friction": "against the motion",
    "change": "of the opening as stated",
    "lifting": "of the lifting chamber",
    "lowering": "of the lowering chamber",
    "across": "across the piston",
    "course": "as at the TCP",
}


@dataclass(frozen=True)
class Kind:
    """A curve, or several, that a machine may be given.

    group: of the machine's parameters. over: name of the signal, code: the group's number for it.
    forms: sets of the group's lists, of which the one is taken that the balances tell best.
    """

    group: str
    over: str
    unit: str
    code: int
    forms: tuple[tuple[str, ...], ...]


BY_VELOCITY = "piston_velocity"
FORCES = (("along",), ("friction",), ("along", "friction"))
EITHER_OR_BOTH = (("lifting",), ("lowering",), ("lifting", "lowering"))
KINDS = (
    Kind("unnamed_force", "piston_stroke", "m", force.STROKE, FORCES),
    # what turns round with the velocity is in a curve over it
    Kind("unnamed_force", BY_VELOCITY, "m/s", force.VELOCITY, (("along",),)),
    Kind("unnamed_opening", "piston_stroke", "m", opening.STROKE, (("change",),)),
    Kind("unnamed_opening", "valve_opening", "1", opening.OPENING, (("change",),)),
    Kind("unnamed_leakage", OWN, "Pa", leakage.PRESSURE, EITHER_OR_BOTH),
    Kind("unnamed_leakage", DIFFERENCE, "Pa", leakage.DIFFERENCE, (("across",),)),
    Kind("unnamed_compliance", OWN, "Pa", compliance.PRESSURE, EITHER_OR_BOTH),
)
BY_TIME = "time"
COURSE = Kind("unnamed_load", BY_TIME, "s", load.TIME, (("course",),))


@dataclass(frozen=True)
class Curve:
    """What has no name, over a signal, (p,), or a load's course over time.

    name: of the machine's parameter group. unit: of the signal. parts: the group's lists that are
    not zero, (p,) each, NaN at places beyond what was recorded, part_unit: theirs.
    """

    name: str
    over: str
    unit: str
    signal: tuple[float, ...]
    part_unit: str
    parts: dict[str, tuple[float, ...]]


def curve(machine: Machine) -> Curve | None:
    """Return the curve that a machine has, if it has one."""
    for kind in (*KINDS, COURSE):
        group = getattr(machine, kind.group)
        if group.over == kind.code:
            units = {name: about.unit for name, about in quantities(group).items() if about.count}
            parts = {name: getattr(group, name) for name in units if any(getattr(group, name))}
            points = next(about.count for about in quantities(group).values() if about.count)
            signal = tuple(map(float, np.linspace(group.first, group.last, points)))
            part_unit = next(iter(units.values()))
            return Curve(kind.group, kind.over, kind.unit, signal, part_unit, parts)
    return None


def as_far_as_recorded(whole: Curve, evidence: Evidence) -> Curve:
    """Return a curve without the places of each part to whose sides no recording was.

    One of two chambers may never have had the pressures of the other.
    """
    signal = np.array(whole.signal)
    spacing = signal[1] - signal[0]
    parts = {}
    each = visited_by(whole, evidence)
    for (name, points), seen in zip(whole.parts.items(), each, strict=True):
        low, high = np.nanmin(seen) - spacing, np.nanmax(seen) + spacing
        told = np.where((signal > low) & (signal < high), points, np.nan)
        parts[name] = tuple(map(float, told))
    return replace(whole, parts=parts)


def told_forms(kind: Kind, evidence: Evidence) -> list[tuple[str, ...]]:
    """Return a kind's forms whose signal sensors show, and all balances in which they act."""
    if not np.any(np.isfinite(visited(kind.over, evidence))) or not np.ptp(ends(kind, evidence)):
        return []
    told = {name for name, tells in zip(BALANCES, evidence.told, strict=True) if tells}
    return [
        form
        for form in kind.forms
        if set().union(*(ACTS_IN.get(name, CHAMBERS) for name in form)) <= told
    ]


def visited(over: str, evidence: Evidence) -> Array:
    """Return where recordings were on a curve's signal, SI unit.

    Of the opening the command tells, which is a little more.
    """
    if over == BY_TIME:
        return np.concatenate([e.time for e in evidence.experiments])
    if over == BY_VELOCITY:
        return evidence.velocity
    if over == "valve_opening":
        return np.concatenate([e.commands for e in evidence.experiments])
    outputs = np.concatenate([e.outputs for e in evidence.experiments])
    if over == DIFFERENCE:
        return np.asarray(outputs[:, H] - outputs[:, S])
    return outputs[:, [STROKE] if over == "piston_stroke" else [H, S]]


def visited_by(curve: Curve, evidence: Evidence) -> list[Array]:
    """Return where recordings were on the signal of each of a curve's parts, (n,), SI unit."""
    signal = visited(curve.over, evidence)
    if curve.over != OWN:
        return [signal for _ in curve.parts]
    return [signal[:, ("lifting", "lowering").index(part)] for part in curve.parts]


def ends(kind: Kind, evidence: Evidence) -> tuple[float, float]:
    """Return the least and the greatest value, SI unit, that a curve's signal takes."""
    signal, about = visited(kind.over, evidence), quantities(UNNAMED[kind.group])["first"]
    low, high = np.clip([np.nanmin(signal), np.nanmax(signal)], about.low, about.high)
    return float(low), float(high)

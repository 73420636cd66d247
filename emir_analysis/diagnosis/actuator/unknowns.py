"""What of an actuator is fitted: what its data sheet leaves open, and the parameters of effects."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from emir_analysis.signals import Array
from emir_common.parameter_tree import declared, with_values
from emir_common.quantity import quantities
from emir_plant.actuator import Actuator, ActuatorSheet
from emir_plant.actuator.effects import KNOWN
from emir_plant.actuator.model import column
from emir_plant.actuator.model import record as flat_record

WIDE = 20.0  # a parameter whose range spans more than this factor is fitted as its logarithm
RANGE_DEVIATIONS = 4.0  # standard deviations in the range of a data sheet's entry
TYPICAL = 2.0  # deviation of an effect's parameter from its trial value, in trial values
TYPICAL_FACTOR = 4.0  # the same where it is fitted as its logarithm
LEVELS = (1.0, 0.125, 0.18, 0.25, 0.35, 0.5, 0.7, 1.4, 2.0)  # of trial values: where fits start


@dataclass(frozen=True)
class ActuatorUnknown:
    """One parameter: value = scale x, or scale exp(x) when logarithmic; low, high: bounds of x.

    expected, deviation: of x, before anything is measured.
    """

    path: str
    unit: str
    scale: float
    low: float
    high: float
    logarithmic: bool
    expected: float
    deviation: float

    def value(self, x: float) -> float:
        """Return the parameter's value."""
        return self.scale * math.exp(x) if self.logarithmic else self.scale * x

    def position(self, value: float) -> float:
        """Return x at a value, inside the bounds."""
        x = math.log(value / self.scale) if self.logarithmic else value / self.scale
        return min(max(x, self.low), self.high)


def sizes(effects: Sequence[str]) -> list[str]:
    """Return the sizes, by dotted path, of those effects that have several."""
    several = [name for name in effects if len(KNOWN[name].sizes) > 1]
    return [f"effects.{name}.{size}" for name in several for size in KNOWN[name].sizes]


def unknowns(sheet: ActuatorSheet, effects: Sequence[str]) -> tuple[ActuatorUnknown, ...]:
    """Return what a data sheet leaves open and all parameters of the named effects."""
    stated = declared(sheet.machine)
    found = [
        _stated(path, stated[path][0].unit, float(stated[path][1]), low, high)
        for path, (low, high) in sheet.ranges.items()
    ]
    for effect in effects:
        kind = KNOWN[effect]
        for name, trial in kind.trial.items():
            about = quantities(kind)[name]
            low = kind.none_or_above.get(name, about.low)
            for place in [f".{k}" for k in range(about.count)] or [""]:
                path = f"effects.{effect}.{name}{place}"
                found.append(_unknown(path, about.unit, trial, low, about.high))
    return tuple(found)


def ways(members: tuple[ActuatorUnknown, ...]) -> list[tuple[ActuatorUnknown, ...]]:
    """Return what is fitted, with and without what is either none or above some value."""
    certain = tuple(member for member in members if not _may_be_none(member.path))
    return [members] if len(certain) == len(members) else [certain, members]


def is_without(members: tuple[ActuatorUnknown, ...], machine: Actuator) -> bool:
    """Tell whether a machine has an effect, but none of what in it may be none."""
    stated = flat_record(machine)
    return any(
        getattr(machine.effects, member.path.split(".")[1]).is_on
        and column(stated, member.path)[0] == 0.0
        for member in members
        if _may_be_none(member.path)
    )


def _may_be_none(path: str) -> bool:
    group, effect, *name = path.split(".")
    return group == "effects" and name[0] in KNOWN[effect].none_or_above


def _stated(path: str, unit: str, value: float, low: float, high: float) -> ActuatorUnknown:
    """Return an entry of the data sheet with its range."""
    found = _unknown(path, unit, value, low, high)
    at = found.position(value)
    return replace(found, expected=at, deviation=(found.high - found.low) / RANGE_DEVIATIONS)


def _unknown(path: str, unit: str, value: float, low: float, high: float) -> ActuatorUnknown:
    """Return a parameter near a trial value; one of either sign is expected to be zero."""
    if low * high > 0.0 and max(high / low, low / high) > WIDE:
        least, most = sorted((math.log(low / value), math.log(high / value)))
        width = math.log(TYPICAL_FACTOR)
        return ActuatorUnknown(path, unit, value, least, most, True, 0.0, width)
    scale = abs(value) or max(abs(low), abs(high))
    expected = 0.0 if low < 0.0 < high else value / scale
    return ActuatorUnknown(path, unit, scale, low / scale, high / scale, False, expected, TYPICAL)


def starts(
    sheet: ActuatorSheet, members: Sequence[ActuatorUnknown], known: Actuator
) -> list[Array]:
    """Return places, (k,), with what a known machine lacks at all LEVELS of its trial values.

    Beyond a threshold, or far from a mode, an effect changes nothing: no slope leads there. And
    the machine may be what it is for want of the effect: also with the sheet's own parameters.
    """
    stated = declared(sheet.machine)
    as_stated = with_values(known, {path: stated[path][1] for path in sheet.ranges})
    bases = dict.fromkeys([known, as_stated])
    return [place_of(members, base, level) for base in bases for level in LEVELS]


def place_of(members: Sequence[ActuatorUnknown], known: Actuator, level: float = 1.0) -> Array:
    """Return a known machine's place, (k,), what it lacks at a level of its trial values."""
    stated = flat_record(known)

    def position(member: ActuatorUnknown) -> float:
        group, effect, *_ = member.path.split(".")
        if group == "effects" and not getattr(known.effects, effect).is_on:
            return member.position(level * _trial(member.path))
        return member.position(float(column(stated, member.path)[0]))

    return np.array([position(member) for member in members])


def _trial(path: str) -> float:
    _, effect, name, *_ = path.split(".")
    return KNOWN[effect].trial[name]

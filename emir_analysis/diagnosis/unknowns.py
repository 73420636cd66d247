"""What a fit may change: the toleranced parameters and the parameters of effects, as a vector."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emir_analysis.diagnosis.proportions import proportion
from emir_analysis.signals import Array
from emir_common.parameter_tree import with_values
from emir_common.quantity import quantities
from emir_plant.effects import REGISTRY, Effect
from emir_plant.parameters import Machine, groups
from emir_plant.sheet import Sheet

WIDE = 20.0  # an effect's parameter whose range spans more than this factor is fitted as its log
END = 1e-3  # of its scale, within which a parameter stands at the end of what is allowed
STROKE = "stroke"  # field of what a sensor does to it
ROUNDING = 1e-9  # relative, by which x stays inside its bounds, so that its value does, too


@dataclass(frozen=True)
class Unknown:
    """One parameter and its scale: value = origin + scale x, or origin exp(x) when logarithmic.

    low, high: bounds of x. start: x at which a search starts. toleranced: stated by the maker
    with a tolerance, then x runs from -1 to 1 over it.
    """

    path: str
    unit: str
    origin: float
    scale: float
    low: float
    high: float
    start: float
    toleranced: bool
    logarithmic: bool = False

    def value(self, x: float) -> float:
        """Return the parameter's value, SI unit."""
        if self.logarithmic:
            return self.origin * math.exp(x)
        return self.origin + self.scale * x

    def at(self, value: float) -> float:
        """Return the x of a value, SI unit."""
        if self.logarithmic:
            return math.log(value / self.origin)
        return (value - self.origin) / self.scale

    def deviation(self, x: float, width: float) -> tuple[float, float]:
        """Return the values at x - width and x + width, inside the bounds."""
        return self.value(max(x - width, self.low)), self.value(min(x + width, self.high))

    @property
    def is_share(self) -> bool:
        """Tell whether it is a share, of which none and all are as likely as any other."""
        return is_share(self.path)

    @property
    def usual(self) -> float:
        """What a parameter of an effect is where nobody says otherwise, SI unit; NaN: of none."""
        if self._field is None:
            return math.nan
        kind, name = self._field
        return float(getattr(kind(), name))

    @property
    def _field(self) -> tuple[type[Effect], str] | None:
        return _effect_field(self.path)

    @property
    def is_stepwise(self) -> bool:
        """Tell whether it is an effect's parameter that acts in steps."""
        return self._field is not None and self._field[1] in self._field[0].stepwise

    @property
    def shapes(self) -> bool:
        """Tell whether it shapes an effect, as an onset or a time constant does: is no size."""
        return self._field is not None and self._field[1] not in self._field[0].sizes

    def at_end(self, x: float) -> bool:
        """Tell whether x was led to the end of what is allowed.

        None at all is no such end, and neither end of a share is.
        """
        led = abs(x - self.start) > END
        least = x - self.low < END and abs(self.value(self.low)) > ROUNDING * abs(self.scale)
        return led and not self.is_share and (least or self.high - x < END)


def is_share(path: str) -> bool:
    """Tell whether a parameter, by dotted path, shapes an effect and runs from none to all."""
    field = _effect_field(path)
    if field is None or field[1] in field[0].sizes:
        return False
    about = quantities(field[0])[field[1]]
    return about.unit == "1" and (about.low, about.high) == (0.0, 1.0)


def _effect_field(path: str) -> tuple[type[Effect], str] | None:
    """Return the effect of the registry whose field it is, and its name; a curve has none."""
    group, *names = path.split(".")
    known = group == "effects" and names[0] in REGISTRY
    return (REGISTRY[names[0]], names[1]) if known else None


@dataclass(frozen=True)
class Unknowns:
    """A machine and what may be changed in it, in the order of the fit's vector."""

    machine: Machine
    members: tuple[Unknown, ...]

    @property
    def start(self) -> Array:
        """Where a search starts, (k,)."""
        return np.array([unknown.start for unknown in self.members])

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest admissible vector, (k,) each."""
        low = [unknown.low for unknown in self.members]
        high = [unknown.high for unknown in self.members]
        return np.array(low), np.array(high)

    @property
    def toleranced(self) -> NDArray[np.bool_]:
        """Which unknowns the maker states with a tolerance, (k,)."""
        return np.array([unknown.toleranced for unknown in self.members], dtype=np.bool_)

    def values(self, x: Array) -> dict[str, float]:
        """Return the parameters' values by dotted path, SI units."""
        return {u.path: u.value(float(v)) for u, v in zip(self.members, x, strict=True)}

    def at(self, x: Array) -> Machine:
        """Return the machine with the parameters at x."""
        return self.machine_with(self.values(x))

    def machine_with(self, values: Mapping[str, float]) -> Machine:
        """Return the machine with parameters given by dotted path, SI units."""
        return with_values(self.machine, values)


def unknowns(sheet: Sheet, effects: Sequence[str] = ()) -> Unknowns:
    """Return the sheet's toleranced parameters and all parameters of the named effects.

    Without those of a stroke sensor that the machine does not have, and of another law.
    """
    stated = groups(sheet.machine)
    members = [_toleranced(stated, path, tol) for path, tol in sheet.tolerances.items()]
    for effect in effects:
        members += _of_effect(effect, sheet.machine)
    return Unknowns(sheet.machine, tuple(members))


def _toleranced(stated: Mapping[str, object], path: str, tolerance: float) -> Unknown:
    group, name = path.rsplit(".", 1)
    value = float(getattr(stated[group], name))
    about = quantities(stated[group])[name]
    spread = abs(value) * tolerance
    low, high = -1.0, 1.0
    if spread > 0.0:  # a tolerance may lead beyond what a machine can be built with
        low = max(low, (about.low - value) / spread + ROUNDING)
        high = min(high, (about.high - value) / spread - ROUNDING)
    return Unknown(path, about.unit, value, spread, low, high, 0.0, toleranced=True)


def _of_effect(effect: str, machine: Machine) -> list[Unknown]:
    kind = REGISTRY[effect]
    members = []
    for name, about in quantities(kind).items():
        unseen = name == STROKE and not machine.sensors.own_stroke
        if unseen or name in kind.other_law or name in kind.given:
            continue
        path = f"effects.{effect}.{name}"
        value = first_tried(effect, name, machine)
        if about.low > 0.0 and about.high / about.low > WIDE:
            low = math.log(about.low / value) + ROUNDING
            high = math.log(about.high / value) - ROUNDING
            members.append(Unknown(path, about.unit, value, 1.0, low, high, 0.0, False, True))
        else:
            members.append(in_proportion(effect, name, abs(value), 1.0))
    return members


def first_tried(effect: str, name: str, machine: Machine) -> float:
    """Return the value at which a search begins with a parameter of an effect, SI unit."""
    kind = REGISTRY[effect]
    about = quantities(kind)[name]
    value = float(kind.trial.get(name, getattr(kind(), name)))
    return min(value * proportion(about.unit, machine), about.high) if name in kind.sizes else value


def in_proportion(effect: str, name: str, scale: float, start: float) -> Unknown:
    """Return a parameter of an effect as an unknown: value = scale x.

    scale: SI unit. start: x at which a search starts.
    """
    about = quantities(REGISTRY[effect])[name]
    low = (about.low + ROUNDING * abs(about.low)) / scale
    high = (about.high - ROUNDING * abs(about.high)) / scale
    path = f"effects.{effect}.{name}"
    return Unknown(path, about.unit, 0.0, scale, low, high, start, False)

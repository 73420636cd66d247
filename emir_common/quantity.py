"""Declaring a physical parameter: unit, range and meaning, once, beside its name."""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Any


class ParameterError(ValueError):
    """A parameter is missing, unknown or outside its range; the message is one line."""


@dataclass(frozen=True)
class Quantity:
    """What is known about a parameter beside its value.

    unit: SI unit, "1" when dimensionless. low, high: the closed range of admissible values.
    """

    unit: str
    low: float
    high: float
    meaning: str

    @property
    def allowed(self) -> str:
        """Return the range with its unit."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"{self.low:g} ... {self.high:g}{unit}"

    def check(self, name: str, value: float) -> None:
        """Raise ParameterError unless `value` is a finite number inside the range."""
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ParameterError(f"{name} = {value!r}: not a number")
        if not math.isfinite(value) or not self.low <= value <= self.high:
            raise ParameterError(f"{name} = {value:g}: outside {self.allowed}")


def quantity(
    unit: str,
    low: float,
    high: float,
    meaning: str,
    default: Any = dataclasses.MISSING,
) -> Any:
    """Declare a field of a parameter dataclass, with its unit, range and meaning."""
    return dataclasses.field(
        default=default, metadata={"quantity": Quantity(unit, low, high, meaning)}
    )


def quantities(group: Any) -> Mapping[str, Quantity]:
    """Return the declared quantities of a parameter dataclass (class or instance) by name."""
    return _quantities(group if isinstance(group, type) else type(group))


@cache
def _quantities(kind: Any) -> Mapping[str, Quantity]:
    return MappingProxyType(
        {
            field.name: field.metadata["quantity"]
            for field in dataclasses.fields(kind)
            if "quantity" in field.metadata
        }
    )


def check_ranges(group: Any, prefix: str = "") -> None:
    """Raise ParameterError if a field of the dataclass instance is outside its range."""
    for name, declared in quantities(group).items():
        declared.check(prefix + name, getattr(group, name))

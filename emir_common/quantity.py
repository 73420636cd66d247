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
    count: of the numbers in a list; 0 for a single one.
    """

    unit: str
    low: float
    high: float
    meaning: str
    count: int = 0

    @property
    def allowed(self) -> str:
        """Return the range with its unit."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"{self.low:g} ... {self.high:g}{unit}"

    def check(self, name: str, value: Any) -> None:
        """Raise ParameterError unless `value` is a finite number, or all are, inside the range."""
        if self.count:
            self._check_each(name, value)
        else:
            self._check_number(name, value)

    def _check_each(self, name: str, values: Any) -> None:
        if not isinstance(values, list | tuple) or len(values) != self.count:
            raise ParameterError(f"{name} = {values!r}: not a list of {self.count} numbers")
        # all at once where they are right: a machine has many of them and is made thousandfold
        numbers = set(map(type, values)) <= {int, float} and math.isfinite(sum(values))
        if not numbers or min(values) < self.low or max(values) > self.high:
            for k, value in enumerate(values):
                self._check_number(f"{name}.{k}", value)

    def _check_number(self, name: str, value: Any) -> None:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ParameterError(f"{name} = {value!r}: not a number")
        if not math.isfinite(value) or not self.low <= value <= self.high:
            raise ParameterError(f"{name} = {value:g}: outside {self.allowed}")


def quantity(  # noqa: PLR0913 - all that is to be said of a parameter
    unit: str,
    low: float,
    high: float,
    meaning: str,
    default: Any = dataclasses.MISSING,
    *,
    count: int = 0,
) -> Any:
    """Declare a field of a parameter dataclass, with its unit, range and meaning.

    count: of the numbers in it where it is a list, which a tuple holds.
    """
    return dataclasses.field(
        default=default, metadata={"quantity": Quantity(unit, low, high, meaning, count)}
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
        value = getattr(group, name)
        # most are right, and a machine is made thousandfold; nan is in no range
        if type(value) is not float or not declared.low <= value <= declared.high:
            declared.check(prefix + name, value)

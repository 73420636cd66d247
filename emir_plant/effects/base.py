"""What every effect has: a balance it belongs to, a size that switches it on, a source."""

from dataclasses import dataclass
from typing import ClassVar, Literal

Balance = Literal["force", "chambers", "valve", "supply", "logic block", "kinematics", "sensors"]


@dataclass(frozen=True)
class Effect:
    """Base of all effects.

    balance: the one balance whose residual shows the effect.
    size: name of the field that is 0 while the effect is off.
    source: where the term and its magnitude come from.
    trial: values at which a search for a missing effect starts, SI units.
    """

    balance: ClassVar[Balance]
    size: ClassVar[str]
    source: ClassVar[str]
    trial: ClassVar[dict[str, float]]

"""What every effect has: a balance it belongs to, sizes that switch it on, a source."""

from dataclasses import dataclass
from typing import ClassVar, Literal

Balance = Literal["force", "chambers", "valve", "supply", "logic block", "kinematics", "sensors"]

SENSORS = ("angle", "pressure_lifting", "pressure_lowering", "deflection", "stroke")  # a size each


@dataclass(frozen=True)
class Effect:
    """Base of all effects.

    balance: the one balance whose residual shows the effect.
    sizes: names of the fields that are all 0 while the effect is off; each of them alone
        switches it on.
    source: where the term and its magnitude come from.
    trial: values at which a search for a missing effect starts in EMIR's main joint, SI units.
    stepwise: names of the sizes that act only beyond some value, and too much soon after: a search
        goes through them in steps of their trial values.
    none_or_above: values of fields below which they count as none.
    other_law: fields that give the effect another law where they are not 0; a search begins at 0.
    given: fields that say what the others mean, and are not searched from the start.
    forms: values of given fields that make another effect of it; a search tries one by one.
    is_series: each size is worth little without those before it, as a polynomial's higher terms.
    """

    balance: ClassVar[Balance]
    sizes: ClassVar[tuple[str, ...]]
    source: ClassVar[str]
    trial: ClassVar[dict[str, float]]
    stepwise: ClassVar[tuple[str, ...]] = ()
    none_or_above: ClassVar[dict[str, float]] = {}
    given: ClassVar[tuple[str, ...]] = ()
    forms: ClassVar[dict[str, tuple[float, ...]]] = {}
    is_series: ClassVar[bool] = False
    other_law: ClassVar[tuple[str, ...]] = ()

    @property
    def is_on(self) -> bool:
        """Tell whether any of its sizes switches it on."""
        return any(getattr(self, size) != 0.0 for size in self.sizes)

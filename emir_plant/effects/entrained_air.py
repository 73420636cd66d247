"""Air bubbles in the oil: soft at low pressure, nearly gone at high pressure."""

from dataclasses import dataclass
from typing import Any, ClassVar

from emir_common.quantity import quantity
from emir_plant.effects.base import Balance, Effect
from emir_plant.jit import compiled

ATMOSPHERE = 1e5  # Pa, at which the gas share is stated


@dataclass(frozen=True)
class EntrainedAir(Effect):
    """Stiffness of the mixture, E_l [1 + g] / [1 + g E_l / (n p)], g = a (p_a/p)^(1/n).

    E_l is the cylinder's beta, p the absolute pressure or `least_pressure` where that is more, p_a
    one atmosphere: below, oil that evaporates keeps the bubbles from growing on.
    """

    balance: ClassVar[Balance] = "chambers"
    sizes: ClassVar[tuple[str, ...]] = ("share",)
    source: ClassVar[str] = "0.2-2 % of the volume at 1 bar; polytropic mixture"
    trial: ClassVar[dict[str, float]] = {"share": 0.01}

    share: float = quantity("1", 0.0, 0.2, "a, gas volume share at 1 bar", default=0.0)
    exponent: float = quantity("1", 1.0, 1.4, "n, polytropic exponent", default=1.2)
    least_pressure: float = quantity(
        "Pa", 1e2, 1e5, "below which the bubbles grow no further", default=3e3
    )


@compiled
def stiffness(pressure: float, p: Any) -> float:
    """Return the effective stiffness of a chamber's content, Pa, at an absolute pressure, Pa."""
    if p.entrained_air_share == 0.0:
        return p.beta
    absolute = max(pressure, p.entrained_air_least_pressure)
    n = p.entrained_air_exponent
    gas = p.entrained_air_share * (ATMOSPHERE / absolute) ** (1.0 / n)
    return p.beta * (1.0 + gas) / (1.0 + gas * p.beta / (n * absolute))

"""Lines and hoses that widen more than the stated stiffness says."""

from dataclasses import dataclass
from typing import ClassVar

from emir_common.quantity import quantity
from emir_plant.effects.base import Balance, Effect
from emir_plant.jit import compiled


@dataclass(frozen=True)
class VesselCompliance(Effect):
    """Volume C that a chamber's vessels take up per pressure, on top of the stated stiffness.

    With a hose of volume V_h and wall stiffness K_hose it is V_h / K_hose:
    1/K = 1/K_stated + C/V.
    """

    balance: ClassVar[Balance] = "chambers"
    sizes: ClassVar[tuple[str, ...]] = ("lifting", "lowering")
    source: ClassVar[str] = "hose wall 0.7e9 Pa: 10 l of hose take up 1.4e-11 m^3/Pa"
    trial: ClassVar[dict[str, float]] = {"lifting": 1e-11, "lowering": 1e-11}

    lifting: float = quantity("m^3/Pa", 0.0, 1e-9, "C of the lifting side", default=0.0)
    lowering: float = quantity("m^3/Pa", 0.0, 1e-9, "C of the lowering side", default=0.0)


@compiled
def stiffness(stated: float, volume: float, compliance: float) -> float:
    """Return a chamber's stiffness, Pa, from the stated one, Pa, its volume, m^3, and C, m^3/Pa."""
    return stated / (1.0 + stated * compliance / volume)

"""Lines, hoses and walls that widen more, or less, than the stated stiffness says."""

from dataclasses import dataclass
from typing import Any, ClassVar

from emir_common.quantity import quantity
from emir_plant.effects.base import Balance, Effect
from emir_plant.jit import compiled

STIFFEST = 5.0  # times the stated stiffness, where compliance is less than stated


@dataclass(frozen=True)
class VesselCompliance(Effect):
    """Volume per pressure that a chamber takes up on top of the stated stiffness.

    1/K = 1/K_stated + C [1 - w + w V/V_0]/V, with a C of its own for either chamber and w, the
    share that grows with its volume V, V_0 at zero stroke. A hose of volume V_h and wall stiffness
    K_hose is C = V_h / K_hose with w = 0, a dead volume too small by V_d is C = V_d / K_stated with
    w = 0, and a cylinder of another stiffness, or oil, is w = 1. Less than stated is a C below 0;
    the chamber becomes no more than STIFFEST times as stiff then.
    """

    balance: ClassVar[Balance] = "chambers"
    sizes: ClassVar[tuple[str, ...]] = ("lifting", "lowering")
    source: ClassVar[str] = "hose wall 0.7e9 Pa: 10 l of hose take up 1.4e-11 m^3/Pa"
    trial: ClassVar[dict[str, float]] = {"lifting": 1e-11, "lowering": 1e-11, "wall_share": 0.5}

    lifting: float = quantity("m^3/Pa", -1e-9, 1e-9, "C of the lifting side", default=0.0)
    lowering: float = quantity("m^3/Pa", -1e-9, 1e-9, "C of the lowering side", default=0.0)
    wall_share: float = quantity("1", 0.0, 1.0, "w, share that grows with the volume", default=0.0)


@compiled
def lifting(volume: float, p: Any) -> float:
    """Return what the lifting chamber of a volume, m^3, takes up per pressure, m^3/Pa."""
    return _compliance(p.vessel_compliance_lifting, volume, p.volume_lifting_0, p)


@compiled
def lowering(volume: float, p: Any) -> float:
    """Return the same of the lowering chamber."""
    return _compliance(p.vessel_compliance_lowering, volume, p.volume_lowering_0, p)


@compiled
def _compliance(size: float, volume: float, at_zero_stroke: float, p: Any) -> float:
    if size == 0.0:
        return 0.0
    return size * (1.0 + p.vessel_compliance_wall_share * (volume / at_zero_stroke - 1.0))


@compiled
def stiffness(stated: float, volume: float, compliance: float) -> float:
    """Return a chamber's stiffness, Pa, from the stated one, Pa.

    volume: m^3. compliance: m^3/Pa, beyond the stated one.
    """
    if compliance == 0.0:
        return stated
    return stated / max(1.0 + stated * compliance / volume, 1.0 / STIFFEST)

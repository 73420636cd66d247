"""Oil that passes the piston from one chamber to the other."""

from dataclasses import dataclass
from typing import Any, ClassVar

from emir_common.quantity import quantity
from emir_plant.effects.base import Balance, Effect
from emir_plant.effects.leak import leak
from emir_plant.jit import compiled


@dataclass(frozen=True)
class InternalLeakage(Effect):
    """Flow C_i (p_H - p_S) out of the lifting into the lowering chamber.

    For turbulent_share of it C_i dp (100 bar / |dp|)^(1/2), through a scratch in place of a gap.
    """

    balance: ClassVar[Balance] = "chambers"
    sizes: ClassVar[tuple[str, ...]] = ("coefficient",)
    source: ClassVar[str] = "piston leakage 1e-13 ... 5e-12 m^3/(s Pa)"
    trial: ClassVar[dict[str, float]] = {"coefficient": 1e-12, "turbulent_share": 0.5}

    coefficient: float = quantity("m^3/(s Pa)", 0.0, 1e-9, "C_i", default=0.0)
    turbulent_share: float = quantity("1", 0.0, 1.0, "with the root of the drop", default=0.0)


@compiled
def flow(pressure_lifting: float, pressure_lowering: float, p: Any) -> float:
    """Return the flow from the lifting to the lowering chamber, m^3/s; pressures in Pa."""
    drop = pressure_lifting - pressure_lowering
    return leak(drop, p.internal_leakage_coefficient, p.internal_leakage_turbulent_share)

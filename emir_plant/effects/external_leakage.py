"""Oil that leaves a chamber for the tank."""

from dataclasses import dataclass
from typing import Any, ClassVar

from emir_common.quantity import quantity
from emir_plant.effects.base import Balance, Effect
from emir_plant.effects.leak import leak
from emir_plant.jit import compiled


@dataclass(frozen=True)
class ExternalLeakage(Effect):
    """Flow C_e (p - p_T) out of either chamber, each with its own coefficient.

    For turbulent_share of it C_e dp (100 bar / |dp|)^(1/2), through a hole in place of a gap.
    """

    balance: ClassVar[Balance] = "chambers"
    sizes: ClassVar[tuple[str, ...]] = ("lifting", "lowering")
    source: ClassVar[str] = (
        "rod seal and line fittings; magnitude of a piston's leakage, 1e-13 ... 5e-12 m^3/(s Pa)"
    )
    trial: ClassVar[dict[str, float]] = {
        "lifting": 1e-12,
        "lowering": 1e-12,
        "turbulent_share": 0.5,
    }

    lifting: float = quantity("m^3/(s Pa)", 0.0, 1e-9, "C_e of the lifting side", default=0.0)
    lowering: float = quantity("m^3/(s Pa)", 0.0, 1e-9, "C_e of the lowering side", default=0.0)
    turbulent_share: float = quantity("1", 0.0, 1.0, "with the root of the drop", default=0.0)


@compiled
def flow(pressure: float, coefficient: float, p: Any) -> float:
    """Return the flow out of a chamber to the tank, m^3/s, at its pressure, Pa."""
    return leak(pressure - p.pT, coefficient, p.external_leakage_turbulent_share)

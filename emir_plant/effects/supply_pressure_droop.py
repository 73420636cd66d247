"""A supply whose pressure falls when oil is taken from it."""

from dataclasses import dataclass
from typing import Any, ClassVar

from emir_common.quantity import quantity
from emir_plant.effects.base import Balance, Effect
from emir_plant.jit import compiled


@dataclass(frozen=True)
class SupplyPressureDroop(Effect):
    """Pressure p_0 - D at the pump, T dD/dt = R Q - D, Q the flow the pump delivers.

    For turbulent_share of it R Q |Q| / Q_n, Q_n the valve's flow: through a filter or a line in
    place of a pump's controller.
    """

    balance: ClassVar[Balance] = "supply"
    sizes: ClassVar[tuple[str, ...]] = ("resistance",)
    source: ClassVar[str] = (
        "pump controller and line: some 10 bar at 200 l/min, recovering in 0.1-0.5 s"
    )
    trial: ClassVar[dict[str, float]] = {"resistance": 1e9, "turbulent_share": 0.5}
    stepwise: ClassVar[tuple[str, ...]] = ("resistance",)  # only where the pressure is short

    resistance: float = quantity("Pa s/m^3", 0.0, 1e13, "R", default=0.0)
    time_constant: float = quantity("s", 1e-3, 10.0, "T", default=0.2)
    turbulent_share: float = quantity("1", 0.0, 1.0, "with the square of the flow", default=0.0)


@compiled
def rate(droop: float, flow: float, p: Any) -> float:
    """Return dD/dt, Pa/s, of the droop D, Pa, while the pump delivers a flow, m^3/s."""
    if p.supply_pressure_droop_resistance == 0.0:
        return 0.0
    turbulent = p.supply_pressure_droop_turbulent_share
    law = 1.0 - turbulent + turbulent * abs(flow) / p.flow_nominal
    wanted = p.supply_pressure_droop_resistance * flow * law
    return (wanted - droop) / p.supply_pressure_droop_time_constant

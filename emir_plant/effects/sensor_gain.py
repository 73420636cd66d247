"""A sensor that shows a constant factor too much."""

from dataclasses import dataclass
from typing import ClassVar

from emir_common.quantity import quantity
from emir_plant.effects.base import SENSORS, Balance, Effect


@dataclass(frozen=True)
class SensorGain(Effect):
    """Shown = true (1 + error), one error for each sensor."""

    balance: ClassVar[Balance] = "sensors"
    sizes: ClassVar[tuple[str, ...]] = SENSORS
    source: ClassVar[str] = "span of a pressure transducer 0.5 %, of strain gauges 2 %"
    trial: ClassVar[dict[str, float]] = {
        "angle": 5e-3,
        "pressure_lifting": 1e-2,
        "pressure_lowering": 1e-2,
        "deflection": 2e-2,
        "stroke": 2e-2,
    }

    angle: float = quantity("1", -0.5, 0.5, "relative error of the resolver", default=0.0)
    pressure_lifting: float = quantity("1", -0.5, 0.5, "relative error of p_H", default=0.0)
    pressure_lowering: float = quantity("1", -0.5, 0.5, "relative error of p_S", default=0.0)
    deflection: float = quantity("1", -0.5, 0.5, "relative error of the gauges", default=0.0)
    stroke: float = quantity("1", -0.5, 0.5, "relative error of a measured stroke", default=0.0)

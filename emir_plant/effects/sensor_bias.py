"""A sensor that shows a constant too much."""

from dataclasses import dataclass
from typing import ClassVar

from emir_common.quantity import quantity
from emir_plant.effects.base import SENSORS, Balance, Effect


@dataclass(frozen=True)
class SensorBias(Effect):
    """Shown = true + bias, one bias for each sensor."""

    balance: ClassVar[Balance] = "sensors"
    sizes: ClassVar[tuple[str, ...]] = SENSORS
    source: ClassVar[str] = (
        "zero of a 400 bar transducer 0.25 %; mounting of a resolver; zero of a bridge"
    )
    trial: ClassVar[dict[str, float]] = {
        "angle": 2e-3,
        "pressure_lifting": 1e5,
        "pressure_lowering": 1e5,
        "deflection": 2e-4,
        "stroke": 2e-3,
    }

    angle: float = quantity("rad", -0.2, 0.2, "bias of the resolver", default=0.0)
    pressure_lifting: float = quantity("Pa", -5e6, 5e6, "bias of p_H", default=0.0)
    pressure_lowering: float = quantity("Pa", -5e6, 5e6, "bias of p_S", default=0.0)
    deflection: float = quantity("rad", -0.05, 0.05, "bias of the gauges", default=0.0)
    stroke: float = quantity("m", -0.5, 0.5, "bias of a measured stroke", default=0.0)

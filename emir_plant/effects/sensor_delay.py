"""A sensor that lags behind."""

from dataclasses import dataclass
from typing import ClassVar

from emir_common.quantity import quantity
from emir_plant.effects.base import Balance, Effect
from emir_plant.jit import compiled

SHORTEST = 5e-4  # s


@dataclass(frozen=True)
class SensorDelay(Effect):
    """First-order lag, T dy/dt = true - y, one time constant for each sensor.

    A lag below SHORTEST acts as SHORTEST: it is beyond what the integration resolves.
    """

    balance: ClassVar[Balance] = "sensors"
    sizes: ClassVar[tuple[str, ...]] = (
        "angle",
        "pressure_lifting",
        "pressure_lowering",
        "deflection",
    )
    source: ClassVar[str] = "filters of transducers and amplifiers, 10-50 ms"
    trial: ClassVar[dict[str, float]] = {
        "angle": 0.02,
        "pressure_lifting": 0.02,
        "pressure_lowering": 0.02,
        "deflection": 0.02,
    }

    angle: float = quantity("s", 0.0, 1.0, "lag of the resolver", default=0.0)
    pressure_lifting: float = quantity("s", 0.0, 1.0, "lag of p_H", default=0.0)
    pressure_lowering: float = quantity("s", 0.0, 1.0, "lag of p_S", default=0.0)
    deflection: float = quantity("s", 0.0, 1.0, "lag of the gauges", default=0.0)


@compiled
def rate(true: float, shown: float, lag: float) -> float:
    """Return dy/dt of what a sensor with a lag, s, shows; signals in any unit."""
    if lag == 0.0:
        return 0.0
    return (true - shown) / max(lag, SHORTEST)

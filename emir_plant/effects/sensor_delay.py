"""A sensor that shows late what was: by a lag, by dead time, or by both."""

from dataclasses import dataclass
from typing import ClassVar

from emir_common.quantity import quantity
from emir_plant.effects.base import SENSORS, Balance, Effect
from emir_plant.jit import compiled

SHORTEST = 5e-4  # s


@dataclass(frozen=True)
class SensorDelay(Effect):
    """What is slow comes late by T, one for each sensor.

    dead_share of T is dead time (sampling, bus), the rest a first-order lag (filter). The state
    of the integrated model has one number for each sensor: dead time acts there as the first-order
    system that agrees with it to the second power of T times the frequency; `sensors.readings`
    has it exactly. What is later by less than SHORTEST is a share of a lag of SHORTEST: the
    integration does not resolve a shorter one.
    """

    balance: ClassVar[Balance] = "sensors"
    sizes: ClassVar[tuple[str, ...]] = SENSORS
    source: ClassVar[str] = "filters of transducers and amplifiers, sampling and bus: 10-50 ms"
    trial: ClassVar[dict[str, float]] = {
        "angle": 0.02,
        "pressure_lifting": 0.02,
        "pressure_lowering": 0.02,
        "deflection": 0.02,
        "stroke": 0.02,
        "dead_share": 0.5,
    }

    angle: float = quantity("s", 0.0, 1.0, "T of the resolver", default=0.0)
    pressure_lifting: float = quantity("s", 0.0, 1.0, "T of p_H", default=0.0)
    pressure_lowering: float = quantity("s", 0.0, 1.0, "T of p_S", default=0.0)
    deflection: float = quantity("s", 0.0, 1.0, "T of the gauges", default=0.0)
    stroke: float = quantity("s", 0.0, 1.0, "T of a measured stroke", default=0.0)
    dead_share: float = quantity("1", 0.0, 1.0, "share of T that is dead time", default=0.0)


@compiled
def rate(true: float, lagging: float, delay: float, dead_share: float) -> float:
    """Return dz/dt of the state z of a sensor that shows late by a delay, s; signals in any unit.

    L dz/dt = true - z, and the sensor shows z + (T / L - 1) (z - true), which is late by T.
    """
    if delay == 0.0:
        return 0.0
    return (true - lagging) / _lag(delay, dead_share)


def shown(true: float, lagging: float, delay: float, dead_share: float) -> float:
    """Return what a sensor late by a delay, s, shows, from the truth and its state z."""
    return lagging + (delay / _lag(delay, dead_share) - 1.0) * (lagging - true)


@compiled
def _lag(delay: float, dead_share: float) -> float:
    """Return L, s, of (1 - (T - L) s) / (1 + L s), which is late by T whatever L.

    A lag has L = T, dead time T / 2; between, the powers up to (T s)^2 are those of both in a row.
    """
    ahead = dead_share * (1.0 - 0.5 * dead_share)
    return max((1.0 - ahead) * delay, SHORTEST)

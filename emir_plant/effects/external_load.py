"""A force at the TCP that no state of the machine explains: wind, contact, a swinging load."""

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from emir_common.quantity import quantity
from emir_plant.effects.base import Balance, Effect
from emir_plant.jit import compiled


@dataclass(frozen=True)
class ExternalLoad(Effect):
    """Force across the boom at the TCP, up positive: F cos(2 pi f (t - t_0) + phase).

    It acts from t_0 for a duration; with t_0 before the run the machine rests under it. f = 0
    gives a constant load or, with a short duration, a pulse; f > 0 a harmonic one.
    """

    balance: ClassVar[Balance] = "force"
    sizes: ClassVar[tuple[str, ...]] = ("force",)
    source: ClassVar[str] = "wind pressure 0.3 kPa on a boom of 15 m^2 gives about 2 kN at the TCP"
    trial: ClassVar[dict[str, float]] = {
        "force": 1e3,
        "frequency": 0.2,
        "phase": 0.5,
        "start": 1.0,
        "duration": 1e3,
    }

    force: float = quantity("N", -1e5, 1e5, "F", default=0.0)
    frequency: float = quantity("Hz", 0.0, 20.0, "f; 0: constant while it acts", default=0.0)
    phase: float = quantity("rad", -6.3, 6.3, "at the start", default=0.0)
    start: float = quantity("s", -1e6, 1e6, "t_0, since the start of the run", default=0.0)
    duration: float = quantity("s", 1e-3, 1e6, "how long it acts", default=1e6)


@compiled
def force(time: float, p: Any) -> float:
    """Return the force at the TCP, N, at a time since the start of the run, s."""
    since = time - p.external_load_start
    if p.external_load_force == 0.0 or since < 0.0 or since >= p.external_load_duration:
        return 0.0
    angle = 2.0 * math.pi * p.external_load_frequency * since + p.external_load_phase
    return p.external_load_force * math.cos(angle)

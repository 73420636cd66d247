"""Effects on what the sensors show, written a second time."""

from typing import ClassVar

import numpy as np

from emir_analysis.blind.hidden import P_H, P_S, Hidden, Random, between, either_sign
from emir_analysis.blind.machine import HYDRAULIC, Array, Sizes
from emir_analysis.blind.numbers import Numbers

SENSORS = ("angle", "pressure_lifting", "pressure_lowering", "deflection")


class SensorBias(Hidden):
    """One sensor shows a constant too much."""

    name = "sensor_bias"
    grows = tuple(f"bias_{sensor}" for sensor in SENSORS)
    RANGES: ClassVar[tuple[tuple[float, float], ...]] = (
        (3e-3, 3e-2),
        (1e5, 1e6),
        (1e5, 1e6),
        (1e-4, 1e-3),
    )

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw a sensor and its bias."""
        sensor = random.integers(len(SENSORS))
        return {cls.grows[sensor]: either_sign(random, *cls.RANGES[sensor])}

    def shown(self, signals: dict[str, Array], states: Array) -> dict[str, Array]:
        """Add the constant."""
        shown = super().shown(signals, states)
        return {name: signal + self.size(f"bias_{name}") for name, signal in shown.items()}


class SensorGain(Hidden):
    """One sensor shows a factor too much."""

    name = "sensor_gain"
    grows = tuple(f"gain_{sensor}" for sensor in SENSORS)
    RANGES: ClassVar[tuple[tuple[float, float], ...]] = (
        (0.01, 0.04),
        (0.01, 0.05),
        (0.01, 0.05),
        (0.03, 0.12),
    )

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw a sensor and its error."""
        sensor = random.integers(len(SENSORS))
        return {cls.grows[sensor]: either_sign(random, *cls.RANGES[sensor])}

    def shown(self, signals: dict[str, Array], states: Array) -> dict[str, Array]:
        """Scale the signal."""
        shown = super().shown(signals, states)
        return {name: signal * (1.0 + self.size(f"gain_{name}")) for name, signal in shown.items()}


class SensorDelay(Hidden):
    """One sensor lags behind, first order, as one more state of the machine."""

    name = "sensor_delay"
    grows = tuple(f"lag_{sensor}" for sensor in SENSORS)

    def __init__(self, numbers: Numbers, sizes: Sizes | None = None) -> None:
        super().__init__(numbers, sizes)
        self._lagging = self.slot()
        drawn = next(name for name in SensorDelay.grows if name in self.sizes)
        self._sensor = drawn.removeprefix("lag_")
        self._time = self.sizes[drawn]
        self._unit = 1e5 if "pressure" in drawn else 1e-3  # of the memory

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw a sensor and a filter's time constant."""
        return {str(random.choice(cls.grows)): between(random, 0.012, 0.08)}

    def remembered_rates(self, time: float, x: list[float], now: dict[str, float]) -> list[float]:
        """Follow the truth."""
        rate = (now[self._sensor] / self._unit - x[self._lagging]) / self._time
        return [*super().remembered_rates(time, x, now), rate]

    def start_memory(self, angle: float, x: list[float]) -> list[float]:
        """Start at rest on the truth."""
        modes = (self.modes.stop - HYDRAULIC) // 2
        tip_angle = float(self.boom.tip_angle @ np.array(x[HYDRAULIC : HYDRAULIC + modes]))
        true = {
            "angle": angle,
            "deflection": tip_angle - angle,
            "pressure_lifting": x[P_H],
            "pressure_lowering": x[P_S],
        }
        return [*super().start_memory(angle, x), true[self._sensor] / self._unit]

    def shown(self, signals: dict[str, Array], states: Array) -> dict[str, Array]:
        """Show the memory in place of the truth."""
        lagging = {self._sensor: self._unit * states[:, self._lagging]}
        return super().shown(signals | lagging, states)

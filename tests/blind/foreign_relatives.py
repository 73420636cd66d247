"""Effects of the catalogue by other laws than the registry's, for `emir blind --foreign`.

Another author would have written them so. Each is named after the effect that it is a relative
of: `found` with that name, or `unexplained`, is a good answer, another name is not. Those with
"own stroke" in their name have a stroke with a sensor of its own.
"""

import math
from typing import ClassVar

import numpy as np

from emir_analysis.blind.hidden import (
    ATMOSPHERE,
    Hidden,
    Random,
    Scale,
    between,
    either_sign,
    lifting_force,
    nominal_hose,
    nominal_speed,
)
from emir_analysis.blind.machine import Array, Machine, Sizes
from emir_analysis.blind.numbers import Numbers

STIFFENED = 6e6  # Pa, at which a hose gives way half as much


class SmoothHysteresis(Hidden):
    """A spool that lags behind as Dahl's friction does: round the corner, not by play."""

    name = "valve_hysteresis~dahl"
    grows = ("loop",)

    def __init__(self, numbers: Numbers, sizes: Sizes | None = None) -> None:
        super().__init__(numbers, sizes)
        self._behind = self.slot()

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"loop": between(random, 0.012, 0.05)}

    def edges(self, spool: float, x: list[float]) -> float:
        return super().edges(spool, x) - 0.5 * self.sizes["loop"] * x[self._behind]

    def remembered_rates(self, time: float, x: list[float], now: dict[str, float]) -> list[float]:
        others, rate = super().remembered_rates(time, x, now), x[3]
        return [*others, (rate - abs(rate) * x[self._behind]) / (0.25 * self.sizes["loop"])]

    def start_memory(self, angle: float, x: list[float]) -> list[float]:
        return [*super().start_memory(angle, x), 0.0]


class AirInOneChamber(Hidden):
    """Bubbles in the lowering chamber alone."""

    name = "entrained_air~one_chamber"
    grows = ("bubbles",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"bubbles": between(random, 0.004, 0.03), "bubbles_n": random.uniform(1.0, 1.4)}

    def stiffness(self, pressure: float, volume: float, *, lifting: bool) -> float:
        oil = super().stiffness(pressure, volume, lifting=lifting)
        if lifting:
            return oil
        p, n = max(pressure, 1e3), self.sizes["bubbles_n"]
        gas = self.sizes["bubbles"] * math.pow(ATMOSPHERE / p, 1.0 / n)
        share = gas / (1.0 + gas)
        return 1.0 / ((1.0 - share) / oil + share / (n * p))


class StiffeningHose(Hidden):
    """Hoses that give way less the more they are filled."""

    name = "vessel_compliance~stiffening"
    grows = ("soft",)
    scales: ClassVar[dict[str, Scale]] = {"soft": nominal_hose}

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"soft": between(random, 2e-11, 1e-10)}

    def stiffness(self, pressure: float, volume: float, *, lifting: bool) -> float:
        oil = super().stiffness(pressure, volume, lifting=lifting)
        hose = self.sizes["soft"] / (1.0 + max(pressure, 0.0) / STIFFENED)
        return volume / (volume / oil + hose)


class PasteFriction(Hidden):
    """Grease: friction by a power of the speed below one."""

    name = "viscous_friction~power"
    grows = ("paste",)
    scales: ClassVar[dict[str, Scale]] = {"paste": lifting_force}

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"paste": between(random, 8e3, 4e4), "paste_power": random.uniform(0.5, 0.8)}

    def resistance(self, velocity: float, force: float, stroke: float) -> float:
        v, power = velocity / nominal_speed(self.n), self.sizes["paste_power"]
        law = v * (v * v + 1e-4) ** (0.5 * (power - 1.0))
        return super().resistance(velocity, force, stroke) + self.sizes["paste"] * law


class MeasuredTriangle(Hidden):
    """Another rod eye than the stated one, and a sensor that shows the piston's own stroke."""

    name = "linkage_error~triangle, own stroke"
    grows = ("eye",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"eye": either_sign(random, 0.01, 0.03)}

    def changed(self, numbers: Numbers) -> Numbers:
        n = super().changed(numbers)
        return Numbers(**{**vars(n), "triangle_b": n.triangle_b * (1.0 + self.sizes["eye"])})


class ShortTriangle(MeasuredTriangle):
    """The same where the stroke is computed from the angle by the stated linkage."""

    name = "linkage_error~triangle"

    def __init__(self, numbers: Numbers, sizes: Sizes | None = None) -> None:
        super().__init__(numbers, sizes)
        self._plain = Machine(numbers)

    def stroke(self, angle: float) -> float:
        return float(Machine.stated_stroke(self, angle))

    def stated_stroke(self, angle: Array | float) -> Array:
        return np.asarray(self._plain.stated_stroke(angle))


class MeasuredWave(Hidden):
    """A stroke of its own, off by a wave over it."""

    name = "linkage_error~wave, own stroke"
    grows = ("wave",)
    LENGTH = 0.8  # m, half of the wave

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"wave": either_sign(random, 0.002, 0.006)}

    def stated_stroke(self, angle: Array | float) -> Array:
        h = super().stated_stroke(angle)
        return np.asarray(h + self.sizes["wave"] * np.sin(math.pi * h / self.LENGTH))

    def lever_arm(self, angle: float) -> float:
        h = float(Machine.stated_stroke(self, angle))
        slope = self.sizes["wave"] * math.pi / self.LENGTH
        return super().lever_arm(angle) * (1.0 + slope * math.cos(math.pi * h / self.LENGTH))


class MeasuredBias(Hidden):
    """An angle with a bias beside a stroke of its own."""

    name = "sensor_bias~angle, own stroke"
    grows = ("beside",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"beside": either_sign(random, 5e-3, 3e-2)}

    def shown(self, signals: dict[str, Array], states: Array) -> dict[str, Array]:
        shown = super().shown(signals, states)
        return shown | {"angle": shown["angle"] + self.sizes["beside"]}

    def stroke(self, angle: float) -> float:
        return float(Machine.stated_stroke(self, angle))

    def stated_stroke(self, angle: Array | float) -> Array:
        """Return the true stroke at an angle that is shown."""
        return np.asarray(super().stated_stroke(angle - self.sizes["beside"]))


class CreepingFriction(Hidden):
    """Dry friction with an arc tangent for its sign, which is gradual far from rest, too."""

    name = "coulomb_friction~arc tangent"
    grows = ("creeps",)
    scales: ClassVar[dict[str, Scale]] = {"creeps": lifting_force}

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"creeps": between(random, 5e3, 2.5e4), "creeping": between(random, 2e-4, 2e-3)}

    def resistance(self, velocity: float, force: float, stroke: float) -> float:
        sign = 2.0 / math.pi * math.atan(velocity / self.sizes["creeping"])
        return super().resistance(velocity, force, stroke) + self.sizes["creeps"] * sign


class StraightFriction(Hidden):
    """Dry friction that rises along a straight line up to a small speed, then stays."""

    name = "coulomb_friction~straight"
    grows = ("rubs",)
    scales: ClassVar[dict[str, Scale]] = {"rubs": lifting_force}

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"rubs": between(random, 5e3, 2.5e4), "up_to": between(random, 2e-4, 2e-3)}

    def resistance(self, velocity: float, force: float, stroke: float) -> float:
        sign = min(max(velocity / self.sizes["up_to"], -1.0), 1.0)
        return super().resistance(velocity, force, stroke) + self.sizes["rubs"] * sign


FOREIGN: tuple[type[Hidden], ...] = (
    SmoothHysteresis,
    AirInOneChamber,
    StiffeningHose,
    PasteFriction,
    ShortTriangle,
    MeasuredTriangle,
    MeasuredWave,
    MeasuredBias,
    CreepingFriction,
    StraightFriction,
)

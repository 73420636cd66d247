"""A third set of what no catalogue holds, for `emir blind --foreign`.

Written when the diagnosis had been finished with the other two. A name with a tilde is that of an
effect which it is a relative of: `found` with that name, or `unexplained`, is a good answer.
"""

import math
from typing import ClassVar

import numpy as np

from emir_analysis.blind.boom import GRAVITY
from emir_analysis.blind.hidden import (
    P_H,
    P_S,
    Hidden,
    Random,
    Scale,
    between,
    boom_mass,
    either_sign,
    lever,
    lifting_force,
    nominal_leak,
    nominal_speed,
)
from emir_analysis.blind.machine import HYDRAULIC, Array, Sizes
from emir_analysis.blind.numbers import Numbers


class HuntingPump(Hidden):
    """A pump whose controller hunts: its flow swings whatever is asked for."""

    name = "hunting_pump"
    grows = ("swings_by",)

    def __init__(self, numbers: Numbers, sizes: Sizes | None = None) -> None:
        super().__init__(numbers, sizes)
        self._now = 1.0

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {
            "swings_by": between(random, 0.08, 0.25),
            "swings_at": between(random, 0.3, 2.0),
        }

    def supply(self, time: float, x: list[float]) -> float:
        phase = 2.0 * math.pi * self.sizes["swings_at"] * time
        self._now = 1.0 - min(self.sizes["swings_by"], 0.5) * (1.0 + math.sin(phase))
        return super().supply(time, x)

    def pumped(self, wanted: float, drop: float) -> float:
        return self._now * super().pumped(wanted, drop)


class ClippedTransducer(Hidden):
    """A pressure transducer of too small a range: above it shows its end."""

    name = "clipped_transducer"
    grows = ()

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"highest": random.uniform(1.005, 1.05)}

    def shown(self, signals: dict[str, Array], states: Array) -> dict[str, Array]:
        shown = super().shown(signals, states)
        p = shown["pressure_lifting"]
        end = self.sizes["highest"] * self._at_rest()
        return shown | {"pressure_lifting": np.minimum(p, end)}

    def _at_rest(self) -> float:
        """Return p_H that carries the horizontal boom with the lowering chamber empty."""
        torque = 0.5 * self.n.boom_mass * GRAVITY * self.n.boom_length
        return torque / (self.lever_arm(0.0) * self.n.area_lifting)


class GivingBracket(Hidden):
    """A cylinder's bracket that gives way under its force."""

    name = "giving_bracket"
    grows = ("gives",)
    FOLLOWS = 5e-3  # s
    scales: ClassVar[dict[str, Scale]] = {"gives": lambda n: lever(n) / lifting_force(n)}

    def __init__(self, numbers: Numbers, sizes: Sizes | None = None) -> None:
        super().__init__(numbers, sizes)
        self._given = self.slot()

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"gives": between(random, 2e-9, 1e-8)}

    def play(self, x: list[float]) -> float:
        return super().play(x) + 1e-3 * x[self._given]

    def remembered_rates(self, time: float, x: list[float], now: dict[str, float]) -> list[float]:
        others = super().remembered_rates(time, x, now)
        rate = (1e3 * self.sizes["gives"] * now["force"] - x[self._given]) / self.FOLLOWS
        now["play_rate"] = 1e-3 * rate
        return [*others, rate]

    def start_memory(self, angle: float, x: list[float]) -> list[float]:
        force = x[P_H] * self.n.area_lifting - x[P_S] * self.n.area_lowering
        return [*super().start_memory(angle, x), 1e3 * self.sizes["gives"] * force]


class LoadOnARope(Hidden):
    """A load that hangs from the TCP on a rope that gives, and bounces."""

    name = "load_on_a_rope"
    grows = ("hung",)
    scales: ClassVar[dict[str, Scale]] = {"hung": boom_mass}
    DAMPING = 0.03

    def __init__(self, numbers: Numbers, sizes: Sizes | None = None) -> None:
        super().__init__(numbers, sizes)
        self._stretch, self._rate = self.slot(), self.slot()

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"hung": between(random, 100.0, 500.0), "bounces_at": between(random, 0.8, 2.5)}

    def _pull(self, stretch: float, rate: float) -> float:
        """Return the rope's force over the load's mass; stretch, m, beyond that at rest."""
        w = 2.0 * math.pi * self.sizes["bounces_at"]
        return w * w * stretch + 2.0 * self.DAMPING * w * rate

    def weight(self, time: float, angle: float) -> Array:
        return super().weight(time, angle) + GRAVITY * self.sizes["hung"] * self.boom.tip

    def accelerations(self, x: Array, time: float, angle: float, push: float) -> Array:
        pull = self.sizes["hung"] * self._pull(x[self._stretch], x[self._rate])
        return super().accelerations(x, time, angle, push) - pull * self.boom.tip

    def rates(self, x: Array, time: float, command: float) -> Array:
        dx = super().rates(x, time, command)
        half = HYDRAULIC + self.boom.joint.size
        tip = float(self.boom.tip @ dx[half : self.modes.stop])
        dx[self._stretch] = x[self._rate]
        dx[self._rate] = tip - self._pull(x[self._stretch], x[self._rate])
        return dx

    def remembered_rates(self, time: float, x: list[float], now: dict[str, float]) -> list[float]:
        return [*super().remembered_rates(time, x, now), 0.0, 0.0]

    def start_memory(self, angle: float, x: list[float]) -> list[float]:
        return [*super().start_memory(angle, x), 0.0, 0.0]


class PumpCreepsIn(Hidden):
    """A worn spool: oil from the pump into the lifting chamber, though the valve is shut."""

    name = "pump_creeps_in"
    grows = ("creeps_in",)
    scales: ClassVar[dict[str, Scale]] = {"creeps_in": nominal_leak}

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"creeps_in": between(random, 5e-13, 1e-11)}

    def leaving(self, p_h: float, p_s: float) -> tuple[float, float]:
        out_h, out_s = super().leaving(p_h, p_s)
        return out_h - self.sizes["creeps_in"] * (self.n.p0 - p_h), out_s


class SteppedAmplifier(Hidden):
    """A valve amplifier that gives its current in coarse steps."""

    name = "stepped_amplifier"
    grows = ("step",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"step": between(random, 0.03, 0.08)}

    def run(self, x: Array, times: Array, command: float) -> Array:
        step = self.sizes["step"]
        return super().run(x, times, step * round(command / step))


class WanderingNull(Hidden):
    """A spool's middle that wanders with the oil's temperature."""

    name = "wandering_null"
    grows = ("wanders_by",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {
            "wanders_by": either_sign(random, 0.01, 0.04),
            "wanders_in": random.uniform(15.0, 50.0),
        }

    def opening(self, edges: float, time: float, stroke: float) -> float:
        off = self.sizes["wanders_by"] * math.sin(2.0 * math.pi * time / self.sizes["wanders_in"])
        return super().opening(edges + off, time, stroke)


class StickingSpool(Hidden):
    """A spool with dry friction: it stops short of where it is sent."""

    name = "valve_hysteresis~sticking_spool"
    grows = ("sticks_by",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"sticks_by": between(random, 0.008, 0.03)}

    def acceleration(self, command: float, spool: float, rate: float) -> float:
        w = self.n.natural_frequency
        rub = w * w * self.sizes["sticks_by"] * rate / math.hypot(rate, 0.02)
        return super().acceleration(command, spool, rate) - rub


class SquareDrag(Hidden):
    """Oil squeezed through a narrow: a force with the square of the speed, either way."""

    name = "viscous_friction~square"
    grows = ("squeezed",)
    scales: ClassVar[dict[str, Scale]] = {"squeezed": lifting_force}

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"squeezed": between(random, 8e3, 4e4)}

    def resistance(self, velocity: float, force: float, stroke: float) -> float:
        v = velocity / nominal_speed(self.n)
        return super().resistance(velocity, force, stroke) + self.sizes["squeezed"] * v * abs(v)


class PinFriction(Hidden):
    """Dry friction in the joint's pin: a moment, which a longer lever arm feels less."""

    name = "coulomb_friction~pin"
    grows = ("pin",)
    scales: ClassVar[dict[str, Scale]] = {"pin": lambda n: lifting_force(n) * lever(n)}

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"pin": between(random, 3e3, 1.2e4)}

    def accelerations(self, x: Array, time: float, angle: float, push: float) -> Array:
        half = HYDRAULIC + self.boom.joint.size
        spin = float(self.boom.joint @ x[half : self.modes.stop])
        rub = self.sizes["pin"] * spin / math.hypot(spin, 1e-3)
        return super().accelerations(x, time, angle, push) - rub * self.boom.joint


FOREIGN: tuple[type[Hidden], ...] = (
    HuntingPump,
    ClippedTransducer,
    GivingBracket,
    LoadOnARope,
    PumpCreepsIn,
    SteppedAmplifier,
    WanderingNull,
    StickingSpool,
    SquareDrag,
    PinFriction,
)

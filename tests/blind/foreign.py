"""What no catalogue holds; `emir blind --foreign` puts it into machines.

Each is a subclass of `Hidden` with sizes at random; `FOREIGN` lists them.
"""

import math
from typing import ClassVar

import numpy as np

from emir_analysis.blind.hidden import (
    Hidden,
    Random,
    Scale,
    between,
    lever,
    lifting_force,
    nominal_leak,
    nominal_speed,
)
from emir_analysis.blind.machine import Array, Sizes


class TightSpot(Hidden):
    """A scored cylinder: dry friction in one place of the stroke alone."""

    name = "tight_spot"
    grows = ("tight_force",)
    scales: ClassVar[dict[str, Scale]] = {
        "tight_force": lifting_force,
        "tight_place": lever,
        "tight_width": lever,
    }

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {
            "tight_force": between(random, 2e4, 8e4),
            "tight_place": random.uniform(0.35, 0.6),
            "tight_width": random.uniform(0.03, 0.08),
        }

    def resistance(self, velocity: float, force: float, stroke: float) -> float:
        s = self.sizes
        near = math.exp(-(((stroke - s["tight_place"]) / s["tight_width"]) ** 2))
        sign = velocity / math.hypot(velocity, 1e-3)
        return super().resistance(velocity, force, stroke) + s["tight_force"] * near * sign


class GasSpring(Hidden):
    """A balancer beside the cylinder that nobody wrote down: a force by place, not by speed."""

    name = "gas_spring"
    grows = ("spring_force",)
    scales: ClassVar[dict[str, Scale]] = {"spring_force": lifting_force, "spring_length": lever}

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {
            "spring_force": between(random, 2e4, 6e4),
            "spring_length": random.uniform(0.12, 0.3),
        }

    def resistance(self, velocity: float, force: float, stroke: float) -> float:
        wave = math.sin(2.0 * math.pi * stroke / self.sizes["spring_length"])
        helped = self.sizes["spring_force"] * wave
        return super().resistance(velocity, force, stroke) - helped


class OneWayDrag(Hidden):
    """A force that grows with the square of speed, in one direction only."""

    name = "one_way_drag"
    grows = ("drag",)
    scales: ClassVar[dict[str, Scale]] = {
        "drag": lambda n: lifting_force(n) / nominal_speed(n) ** 2
    }

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"drag": between(random, 1.5e7, 6e7)}

    def resistance(self, velocity: float, force: float, stroke: float) -> float:
        drag = self.sizes["drag"] * min(velocity, 0.0) * abs(velocity)
        return super().resistance(velocity, force, stroke) + drag


class SlowSpool(Hidden):
    """A pilot stage that runs dry: the spool is no faster than a limit."""

    name = "slow_spool"
    grows = ()

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"spool_fastest": between(random, 0.5, 2.0)}

    def acceleration(self, command: float, spool: float, rate: float) -> float:
        wanted = super().acceleration(command, spool, rate)
        limit = self.sizes["spool_fastest"]
        over = max(rate - limit, 0.0) + min(rate + limit, 0.0)
        return wanted - 2e4 * over if over * wanted > 0.0 else wanted - 2e3 * over


class CurvedEdges(Hidden):
    """Metering edges with a curved characteristic."""

    name = "curved_edges"
    grows = ("curve",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"curve": between(random, 0.15, 0.5)}

    def opening(self, edges: float, time: float, stroke: float) -> float:
        o = super().opening(edges, time, stroke)
        return o * (1.0 + self.sizes["curve"] * (abs(o) - 0.5))


class EndCushion(Hidden):
    """A throttle at one end of the stroke: the valve opens less far near the upper end."""

    name = "end_cushion"
    grows = ("cushion",)
    scales: ClassVar[dict[str, Scale]] = {"cushion_from": lever}

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"cushion": between(random, 0.2, 0.6), "cushion_from": random.uniform(0.4, 0.55)}

    def opening(self, edges: float, time: float, stroke: float) -> float:
        inside = min(max((stroke - self.sizes["cushion_from"]) / 0.1, 0.0), 1.0)
        shut = min(self.sizes["cushion"], 0.9) * inside * inside * (3.0 - 2.0 * inside)
        return super().opening(edges, time, stroke) * (1.0 - shut)


class EarlyRelief(Hidden):
    """A relief valve set far too low: the lifting chamber blows off at its peaks."""

    name = "early_relief"
    grows = ("relief_slope",)
    scales: ClassVar[dict[str, Scale]] = {
        "relief_from": lambda n: n.p0,
        "relief_slope": nominal_leak,
    }

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {
            "relief_from": random.uniform(110e5, 130e5),
            "relief_slope": between(random, 1e-11, 5e-11),
        }

    def leaving(self, p_h: float, p_s: float) -> tuple[float, float]:
        out_h, out_s = super().leaving(p_h, p_s)
        return out_h + self.sizes["relief_slope"] * max(p_h - self.sizes["relief_from"], 0.0), out_s


class RippledResolver(Hidden):
    """A resolver whose error goes round with the angle."""

    name = "rippled_resolver"
    grows = ("ripple",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {
            "ripple": between(random, 5e-3, 1.5e-2),
            "ripple_waves": random.uniform(15.0, 40.0),
        }

    def shown(self, signals: dict[str, Array], states: Array) -> dict[str, Array]:
        shown = super().shown(signals, states)
        angle = shown["angle"]
        off = self.sizes["ripple"] * np.sin(self.sizes["ripple_waves"] * angle)
        return shown | {"angle": angle + off}


class OneWayBrace(Hidden):
    """A brace along the boom that carries only when the boom sags: bending with two slopes."""

    name = "one_way_brace"
    grows = ("brace",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"brace": between(random, 0.2, 1.0), "brace_from": random.uniform(-8e-3, -5e-3)}

    def bending(self, position: Array, rate: Array) -> Array:
        across = self.boom.tip_angle - self.boom.joint
        slack = max(self.sizes["brace_from"] - float(across @ position), 0.0)
        stiffness = self.sizes["brace"] * self.boom.stiffness[1] / across[1] ** 2
        return super().bending(position, rate) + stiffness * slack * across


FOREIGN: tuple[type[Hidden], ...] = (
    TightSpot,
    GasSpring,
    OneWayDrag,
    SlowSpool,
    CurvedEdges,
    EndCushion,
    EarlyRelief,
    RippledResolver,
    OneWayBrace,
)

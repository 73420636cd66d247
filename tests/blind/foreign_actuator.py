"""What no catalogue holds, for actuators: `emir blind --actuator --foreign`.

Each is a subclass of the actuator's `Hidden` with sizes at random; `FOREIGN` lists them.
"""

import math

from emir_analysis.blind.actuator.hidden import Hidden, dry
from emir_analysis.blind.hidden import Random, between
from emir_analysis.blind.machine import Sizes

STEEPEST = 50.0  # exponent; no run of which something is known comes near


class WanderingGain(Hidden):
    """A valve whose gain swings slowly."""

    name = "wandering_gain"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {
            "gain_swing": random.uniform(0.15, 0.4),
            "gain_period": random.uniform(100.0, 300.0),
        }

    def gain(self, time: float, *, lifting: bool) -> float:
        swing = math.sin(2.0 * math.pi * time / self.sizes["gain_period"])
        return super().gain(time, lifting=lifting) * (1.0 + self.sizes["gain_swing"] * swing)


class ProgressiveEdges(Hidden):
    """Metering edges that open the more the further they are open."""

    name = "progressive_edges"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"progression": random.uniform(0.5, 1.2)}

    def opening(self, spool: float) -> float:
        opening = super().opening(spool)
        return opening * math.pow(abs(opening), self.sizes["progression"])


class TightSpot(Hidden):
    """A scored cylinder: dry friction in one place of the way alone."""

    name = "tight_spot"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {
            "tight_friction": between(random, 0.2, 1.0),
            "tight_place": random.uniform(-5.0, 5.0),
            "tight_width": random.uniform(1.0, 4.0),
        }

    def resistance(self, velocity: float, way: float, pressure: float) -> float:
        s = self.sizes
        near = math.exp(-0.5 * ((way - s["tight_place"]) / s["tight_width"]) ** 2)
        own = s["tight_friction"] * near * dry(velocity)
        return super().resistance(velocity, way, pressure) + own


class Wind(Hidden):
    """A force that swings with time."""

    name = "wind"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"wind": between(random, 0.1, 0.5), "wind_period": random.uniform(30.0, 120.0)}

    def load(self, way: float, time: float) -> float:
        swing = math.sin(2.0 * math.pi * time / self.sizes["wind_period"])
        return super().load(way, time) + self.sizes["wind"] * swing


class OneWayDrag(Hidden):
    """Viscous friction in one direction alone."""

    name = "one_way_drag"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"drag": between(random, 0.5, 2.0)}

    def resistance(self, velocity: float, way: float, pressure: float) -> float:
        return super().resistance(velocity, way, pressure) + self.sizes["drag"] * max(velocity, 0.0)


class SoftOil(Hidden):
    """Oil with air, softer the lower its pressure."""

    name = "soft_oil"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {
            "softer": between(random, 0.3, 2.0),  # at a pressure of -1
            "softer_over": random.uniform(0.5, 1.5),
        }

    def capacity(self, flow: float, pressure: float) -> float:
        exponent = min(-(pressure + 1.0) / self.sizes["softer_over"], STEEPEST)
        softer = self.sizes["softer"] * math.exp(exponent)
        return super().capacity(flow, pressure) * (1.0 + softer)


class EndCushion(Hidden):
    """A spring that is met on the way."""

    name = "end_cushion"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"cushion": between(random, 0.05, 0.3), "cushion_from": random.uniform(0.0, 6.0)}

    def load(self, way: float, time: float) -> float:
        met = max(way - self.sizes["cushion_from"], 0.0)
        return super().load(way, time) + self.sizes["cushion"] * met


class ClippedTransducer(Hidden):
    """A transducer whose range ends where the machine goes on."""

    name = "clipped_transducer"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"shows_most": between(random, 0.4, 0.9)}

    def shown(self, pressure: float, flow: float) -> float:
        most = self.sizes["shows_most"]
        return min(max(super().shown(pressure, flow), -most), most)


FOREIGN: tuple[type[Hidden], ...] = (
    WanderingGain,
    ProgressiveEdges,
    TightSpot,
    Wind,
    OneWayDrag,
    SoftOil,
    EndCushion,
    ClippedTransducer,
)

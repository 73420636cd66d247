"""A second set of what no catalogue holds, for `emir blind --foreign`.

None of these was known while the diagnosis was made: they were written when it was finished.
"""

import math
from typing import ClassVar

import numpy as np

from emir_analysis.blind.hidden import (
    Hidden,
    Random,
    Scale,
    between,
    either_sign,
    lifting_force,
    nominal_hose,
    nominal_speed,
)
from emir_analysis.blind.machine import HYDRAULIC, Array, Sizes

ADIABATIC = 1.4  # of nitrogen
SEAT = 2e5  # Pa, over which a bladder leaves its seat
RAMP = 0.1  # s, in which another consumer comes and goes


class AnotherConsumer(Hidden):
    """Someone else draws from the pump now and then: pressure drops, whatever this joint does."""

    name = "another_consumer"
    grows = ("drawn",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {
            "drawn": between(random, 0.25, 0.5),
            "consumer_period": random.uniform(5.0, 12.0),
            "consumer_share": random.uniform(0.25, 0.5),
        }

    def supply(self, time: float, x: list[float]) -> float:
        s = self.sizes
        phase = (time / s["consumer_period"]) % 1.0
        ramp = RAMP / s["consumer_period"]
        on = min(max(min(phase, s["consumer_share"] - phase) / ramp, 0.0), 1.0)
        return super().supply(time, x) * (1.0 - min(s["drawn"], 0.8) * on)


class StarvedPump(Hidden):
    """A pump that gives no more than a flow below what the open valve asks for."""

    name = "starved_pump"
    grows = ()

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"most_flow": random.uniform(0.3, 0.5)}

    def pumped(self, wanted: float, drop: float) -> float:
        most = self.sizes["most_flow"] * self.n.flow_nominal
        return min(super().pumped(wanted, drop), most)


class SpoolStop(Hidden):
    """Dirt under the spool: it opens no further than a stop, in one direction."""

    name = "spool_stop"
    grows = ()

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"stop": random.uniform(0.3, 0.5)}

    def edges(self, spool: float, x: list[float]) -> float:
        return max(super().edges(spool, x), -self.sizes["stop"])


class FlowForces(Hidden):
    """Flow pulls the spool shut: the less open, the more pressure falls over the return edge."""

    name = "flow_forces"
    grows = ("shut_by_flow",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"shut_by_flow": between(random, 0.1, 0.3)}

    def edges(self, spool: float, x: list[float]) -> float:
        edges = super().edges(spool, x)
        drop = max(self.n.p0 - x[0], 0.0) if edges > 0.0 else max(x[0], 0.0)
        return edges * (1.0 - self.sizes["shut_by_flow"] * min(drop / self.n.p0, 1.0))


class StiffeningBoom(Hidden):
    """Arms that bend less the more they are bent."""

    name = "stiffening_boom"
    grows = ("stiffening",)

    AT_REST = 6e-3  # rad, bent about so far by its own weight

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"stiffening": between(random, 0.3, 1.0)}

    def bending(self, position: Array, rate: Array) -> Array:
        across = self.boom.tip_angle - self.boom.joint
        bent = float(across @ position)
        stiffness = self.sizes["stiffening"] * self.boom.stiffness[1] / across[1] ** 2
        return super().bending(position, rate) - stiffness * bent**3 / self.AT_REST**2 * across


class DriftingGauge(Hidden):
    """A strain gauge that warms up in the sun: its zero creeps."""

    name = "drifting_gauge"
    grows = ("creep",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"creep": either_sign(random, 5e-6, 2e-5)}

    def shown(self, signals: dict[str, Array], states: Array) -> dict[str, Array]:
        shown = super().shown(signals, states)
        time = np.arange(states.shape[0]) / self.n.rate
        return shown | {"deflection": shown["deflection"] + self.sizes["creep"] * time}


class Crosstalk(Hidden):
    """A gauge that also feels the pressure beside it."""

    name = "crosstalk"
    grows = ("pressure_felt",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"pressure_felt": either_sign(random, 0.05, 0.2)}

    def shown(self, signals: dict[str, Array], states: Array) -> dict[str, Array]:
        shown = super().shown(signals, states)
        off = self.sizes["pressure_felt"] * shown["pressure_lowering"]
        return shown | {"pressure_lifting": shown["pressure_lifting"] + off}


class CurvedTransducer(Hidden):
    """A pressure transducer with a curved characteristic."""

    name = "curved_transducer"
    grows = ("transducer_curve",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"transducer_curve": either_sign(random, 0.1, 0.3)}

    def shown(self, signals: dict[str, Array], states: Array) -> dict[str, Array]:
        shown = super().shown(signals, states)
        p = shown["pressure_lifting"] / self.n.p0
        off = self.sizes["transducer_curve"] * p * (1.0 - p) * self.n.p0
        return shown | {"pressure_lifting": shown["pressure_lifting"] + off}


class LeaningBase(Hidden):
    """A vehicle that stands on a slope: the angle is not against the horizontal."""

    name = "leaning_base"
    grows = ("lean",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"lean": either_sign(random, 0.03, 0.1)}

    def weight(self, time: float, angle: float) -> Array:
        return super().weight(time, angle + self.sizes["lean"])


class ForgottenAccumulator(Hidden):
    """A gas bladder on the lifting line: soft above its precharge, not there below."""

    name = "forgotten_accumulator"
    grows = ("gas",)
    scales: ClassVar[dict[str, Scale]] = {"gas": lambda n: nominal_hose(n) * n.p0}

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"gas": between(random, 2e-4, 1e-3), "precharge": random.uniform(70e5, 95e5)}

    def stiffness(self, pressure: float, volume: float, *, lifting: bool) -> float:
        oil = super().stiffness(pressure, volume, lifting=lifting)
        if not lifting:
            return oil
        s = self.sizes
        p = max(pressure, 1e3)
        gas = s["gas"] * (s["precharge"] / p) ** (1.0 / ADIABATIC)
        inside = min(max((p - s["precharge"]) / SEAT + 0.5, 0.0), 1.0)
        return volume / (volume / oil + inside * gas / (ADIABATIC * p))


class ThinningOil(Hidden):
    """Friction of cold seals that falls as the oil warms up."""

    name = "thinning_oil"
    grows = ("cold_friction",)
    scales: ClassVar[dict[str, Scale]] = {
        "cold_friction": lambda n: lifting_force(n) / nominal_speed(n)
    }

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {
            "cold_friction": between(random, 2e5, 6e5),
            "warm_after": random.uniform(10.0, 25.0),
        }

    def accelerations(self, x: Array, time: float, angle: float, push: float) -> Array:
        s = self.sizes
        half = HYDRAULIC + self.boom.joint.size
        spin = float(self.boom.joint @ x[half : self.modes.stop])
        velocity = self.lever_arm(angle) * spin
        drag = s["cold_friction"] * math.exp(-time / s["warm_after"]) * velocity
        return super().accelerations(x, time, angle, push - drag)


FOREIGN: tuple[type[Hidden], ...] = (
    AnotherConsumer,
    StarvedPump,
    SpoolStop,
    FlowForces,
    StiffeningBoom,
    DriftingGauge,
    Crosstalk,
    CurvedTransducer,
    LeaningBase,
    ForgottenAccumulator,
    ThinningOil,
)

"""A second set of what no catalogue holds, for `emir blind --actuator --foreign`.

Written by someone who did not know what the diagnosis of actuators does.
"""

import math

import numpy as np

from emir_analysis.blind.actuator.hidden import Hidden
from emir_analysis.blind.actuator.machine import SPOOL, State
from emir_analysis.blind.hidden import Random, between, either_sign
from emir_analysis.blind.machine import Array, Sizes

RAMP = 3.0  # samples, in which a load comes on the hook or leaves it
VOID = 50.0  # how much softer oil is that boils
BOILING = 0.02  # pressure over which it begins to


class PickedUpLoad(Hidden):
    """A load that is picked up at some time and set down at another."""

    name = "picked_up_load"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {
            "picked": between(random, 0.15, 0.6),
            "picked_at": random.uniform(40.0, 150.0),
            "picked_for": random.uniform(80.0, 250.0),
        }

    def load(self, way: float, time: float) -> float:
        s = self.sizes
        since = time - s["picked_at"]
        share = min(max(min(since, s["picked_for"] - since) / RAMP, 0.0), 1.0)
        return super().load(way, time) + s["picked"] * share


class ChatteringValve(Hidden):
    """A counterbalance valve that chatters while it lowers: the flow comes in beats."""

    name = "chattering_valve"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {
            "chatter": random.uniform(0.4, 0.9),
            "chatter_period": random.uniform(4.0, 10.0),
        }

    def gain(self, time: float, *, lifting: bool) -> float:
        gain = super().gain(time, lifting=lifting)
        if lifting:
            return gain
        beat = math.sin(2.0 * math.pi * time / self.sizes["chatter_period"])
        return gain * (1.0 + self.sizes["chatter"] * beat)


class WarmingOil(Hidden):
    """Cold oil that warms up as it works: viscous friction that falls with time."""

    name = "warming_oil"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {
            "cold_friction": between(random, 0.5, 2.0),
            "warm_after": random.uniform(60.0, 200.0),
        }

    def push(self, x: State, velocity: float, time: float) -> float:
        cold = self.sizes["cold_friction"] * math.exp(-time / self.sizes["warm_after"])
        return super().push(x, velocity, time) - cold * velocity


class DriftingTransducer(Hidden):
    """A pressure transducer that warms up: its zero creeps to another value."""

    name = "drifting_transducer"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {
            "zero_creep": either_sign(random, 0.2, 0.8),
            "creep_over": random.uniform(80.0, 300.0),
        }

    def run(self, opening: Array) -> Array:
        warm = 1.0 - np.exp(-np.arange(opening.size) / self.sizes["creep_over"])
        return super().run(opening) + self.sizes["zero_creep"] * warm


class Cavitation(Hidden):
    """Oil that boils where its pressure is low: the void has to be filled before it rises."""

    name = "cavitation"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"boils_below": between(random, 0.3, 1.2)}

    def capacity(self, flow: float, pressure: float) -> float:
        boils = min(max(-(pressure + self.sizes["boils_below"]) / BOILING, 0.0), 1.0)
        return super().capacity(flow, pressure) * (1.0 + VOID * boils)


class StickingSpool(Hidden):
    """A silted spool: at rest it sticks until the command is far away, then jumps there."""

    name = "sticking_spool"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"breakaway": between(random, 0.1, 0.4)}

    def arriving(self, time: Array, opening: Array) -> Array:
        commands = super().arriving(time, opening).tolist()
        held, loose, taken = commands[0], False, []
        for command, before in zip(commands, commands[:1] + commands, strict=False):
            moves = abs(command - before) > 1e-9
            loose = moves if loose else abs(command - held) > self.sizes["breakaway"]
            held = command if loose else held
            taken.append(held)
        return np.array(taken)


class SlowSpool(Hidden):
    """A pilot stage that is too small: the spool goes no faster than a speed."""

    name = "slow_spool"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"spool_speed": between(random, 0.03, 0.12)}

    def rates(self, time: float, state: Array, places: Array, arriving: Array) -> State:
        rates = super().rates(time, state, places, arriving)
        most = self.sizes["spool_speed"]
        rates[SPOOL] = min(max(rates[SPOOL], -most), most)
        return rates


class TurningWeight(Hidden):
    """An arm that turns: its weight's torque goes with the sine of its angle."""

    name = "turning_weight"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {
            "turning": between(random, 0.15, 0.6),
            "way_per_angle": random.uniform(2.0, 6.0),
            "first_angle": random.uniform(-math.pi, math.pi),
        }

    def load(self, way: float, time: float) -> float:
        s = self.sizes
        angle = s["first_angle"] + way / s["way_per_angle"]
        return super().load(way, time) + s["turning"] * math.sin(angle)


class CoarseCommand(Hidden):
    """A remote control of few steps: the valve gets the nearest one."""

    name = "coarse_command"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"command_step": between(random, 0.15, 0.5)}

    def arriving(self, time: Array, opening: Array) -> Array:
        step = self.sizes["command_step"]
        return step * np.round(super().arriving(time, opening) / step)


FOREIGN: tuple[type[Hidden], ...] = (
    PickedUpLoad,
    ChatteringValve,
    WarmingOil,
    DriftingTransducer,
    Cavitation,
    StickingSpool,
    SlowSpool,
    TurningWeight,
    CoarseCommand,
)

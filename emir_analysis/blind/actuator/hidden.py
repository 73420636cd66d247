"""What may be hidden in an actuator: the effects of its catalogue, written a second time.

Each draws its sizes at random inside the range that is usual for it; signals are of order one.
"""

import math
from typing import ClassVar

import numpy as np
from scipy.optimize import brentq

from emir_analysis.blind.actuator.machine import (
    MASS,
    OIL,
    STRETCH,
    SWING,
    SWING_WAY,
    WAY,
    Actuator,
    State,
)
from emir_analysis.blind.hidden import Random, between, either_sign
from emir_analysis.blind.machine import Array, Sizes

DRY = 0.02  # velocity below which dry friction comes gradually
RELIEF = 5.0  # flow of a relief valve per pressure beyond its setting


class Hidden(Actuator):
    """Base of what may be hidden. name: as the catalogue has it."""

    name: ClassVar[str]

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Return sizes by name, in the units of the data sheet."""
        raise NotImplementedError


def root(value: float) -> float:
    """Return the square root with the sign of what is under it."""
    return math.copysign(math.sqrt(abs(value)), value)


def dry(velocity: float) -> float:
    """Return a smoothed sign; no tanh, and rounder."""
    return velocity / math.hypot(velocity, DRY)


class CommandDelay(Hidden):
    """A command that arrives late."""

    name = "command_delay"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw some samples."""
        return {"late": between(random, 0.8, 5.0)}

    def delay(self) -> float:
        """Add the delay."""
        return super().delay() + self.sizes["late"]


class ValveNullOffset(Hidden):
    """A valve that is shut elsewhere than at zero."""

    name = "valve_null_offset"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw some percent of the stroke."""
        return {"null": either_sign(random, 0.02, 0.15)}

    def edges(self, spool: float) -> float:
        """Shift them."""
        return super().edges(spool) + self.sizes["null"]


class ValveDeadZoneError(Hidden):
    """Overlap, another in each direction."""

    name = "valve_dead_zone_error"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw both."""
        return {
            "overlap_lifting": between(random, 0.04, 0.25),
            "overlap_lowering": between(random, 0.04, 0.25),
        }

    def overlap(self, *, lifting: bool) -> float:
        """Return the direction's."""
        return self.sizes["overlap_lifting" if lifting else "overlap_lowering"]


class ValveGainAsymmetry(Hidden):
    """Lowering opens the valve by another factor than lifting."""

    name = "valve_gain_asymmetry"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw up to half as much or twice as much."""
        return {"excess": float(random.choice([-0.5, 1.0])) * between(random, 0.3, 1.0)}

    def gain(self, time: float, *, lifting: bool) -> float:
        """Scale lowering."""
        gain = super().gain(time, lifting=lifting)
        return gain if lifting else gain * (1.0 + self.sizes["excess"])


class ValveHysteresis(Hidden):
    """Play between command and spool."""

    name = "valve_hysteresis"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw some percent of the stroke, half the loop."""
        return {"half_play": between(random, 0.02, 0.12)}

    def arriving(self, time: Array, opening: Array) -> Array:
        """Take the spool along at either end of the play."""
        half = self.sizes["half_play"]
        commands = super().arriving(time, opening)
        held, taken = float(commands[0]), np.empty_like(commands)
        for k, command in enumerate(commands.tolist()):
            held = min(max(held, command - half), command + half)
            taken[k] = held
        return taken


class FlowLimit(Hidden):
    """A pump that gives no more."""

    name = "flow_limit"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw a limit for each direction."""
        return {
            "most_lifting": between(random, 0.25, 0.8),
            "most_lowering": between(random, 0.25, 0.8),
        }

    def most(self, *, lifting: bool) -> float:
        """Return the direction's."""
        return self.sizes["most_lifting" if lifting else "most_lowering"]


class SupplyPressureDroop(Hidden):
    """An orifice between a supply of finite pressure and the load."""

    name = "supply_pressure_droop"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw one over the pressures at which lifting and lowering stall."""
        return {
            "stall_lifting": between(random, 0.06, 0.4),
            "stall_lowering": between(random, 0.06, 0.4),
        }

    def driven(self, pressure: float, *, lifting: bool) -> float:
        """Return the root of the relative drop that is left."""
        if lifting:
            return root(1.0 - self.sizes["stall_lifting"] * pressure)
        return root(1.0 + self.sizes["stall_lowering"] * pressure)


class ReliefValve(Hidden):
    """Relief and anti-cavitation valves that open in the pressure's range."""

    name = "relief_valve"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw both settings."""
        return {"relieved_above": between(random, 0.5, 2.0), "fed_below": between(random, 0.5, 2.0)}

    def leaving(self, pressure: float) -> float:
        """Let out what is above, in what is below."""
        above = max(pressure - self.sizes["relieved_above"], 0.0)
        below = max(-pressure - self.sizes["fed_below"], 0.0)
        return super().leaving(pressure) + RELIEF * (above - below)


class LoadHoldingValve(Hidden):
    """A check valve on the cylinder: unless it lifts, less oil is the spring."""

    name = "load_holding_valve"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw the share of the oil beyond the valve."""
        return {"beyond": random.uniform(0.15, 0.6)}

    def capacity(self, flow: float, pressure: float) -> float:
        """Leave out the line where the valve is shut."""
        whole = super().capacity(flow, pressure)
        return whole if flow > 0.0 else whole * (1.0 - self.sizes["beyond"])


class InternalLeakage(Hidden):
    """Oil past the piston."""

    name = "internal_leakage"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw a worn piston's."""
        return {"leak": between(random, 0.01, 0.15)}

    def leaving(self, pressure: float) -> float:
        """Let oil out."""
        return super().leaving(pressure) + self.sizes["leak"] * pressure


class LineResistance(Hidden):
    """A transducer on the valve's side of a line."""

    name = "line_resistance"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw the line's loss per square of flow."""
        return {"line": between(random, 0.1, 1.0)}

    def shown(self, pressure: float, flow: float) -> float:
        """Add the line's loss."""
        return super().shown(pressure, flow) + self.sizes["line"] * flow * abs(flow)


class CoulombFriction(Hidden):
    """Dry friction, the same at every speed."""

    name = "coulomb_friction"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw the friction over the piston's area."""
        return {"dry_friction": between(random, 0.08, 0.5)}

    def resistance(self, velocity: float, way: float, pressure: float) -> float:
        """Add the friction."""
        own = self.sizes["dry_friction"] * dry(velocity)
        return super().resistance(velocity, way, pressure) + own


class StribeckFriction(Hidden):
    """Seals that stick: dry friction that falls with speed."""

    name = "stribeck_friction"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw what sticks over the piston's area, the share kept when it slides and the speed."""
        return {
            "sticking": between(random, 0.2, 0.8),
            "kept_sliding": random.uniform(0.0, 0.6),
            "stribeck_speed": between(random, 0.08, 0.3),
        }

    def resistance(self, velocity: float, way: float, pressure: float) -> float:
        """Add the friction."""
        s = self.sizes
        slow = math.exp(-((velocity / s["stribeck_speed"]) ** 2))
        share = s["kept_sliding"] + (1.0 - s["kept_sliding"]) * slow
        own = s["sticking"] * share * dry(velocity)
        return super().resistance(velocity, way, pressure) + own


class PressureDependentFriction(Hidden):
    """Seals that the oil presses on."""

    name = "pressure_dependent_friction"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw the coefficient, and the pressure at rest, beside which the shown one counts."""
        return {
            "seal_coefficient": between(random, 0.05, 0.3),
            "seal_rest": random.uniform(0.5, 3.0),
        }

    def resistance(self, velocity: float, way: float, pressure: float) -> float:
        """Add the friction."""
        s = self.sizes
        own = s["seal_coefficient"] * abs(pressure + s["seal_rest"]) * dry(velocity)
        return super().resistance(velocity, way, pressure) + own


class FlowGainDrift(Hidden):
    """Oil that warms up: the valve gives more and more, or less and less."""

    name = "flow_gain_drift"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw how much in a sample."""
        return {"drift": either_sign(random, 2e-4, 6e-4)}

    def gain(self, time: float, *, lifting: bool) -> float:
        """Scale with time."""
        return super().gain(time, lifting=lifting) * (1.0 + self.sizes["drift"] * time)


class TurbulentResistance(Hidden):
    """A loss that grows with the square of the velocity."""

    name = "turbulent_resistance"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw the loss per square of velocity."""
        return {"turbulent": between(random, 0.1, 1.0)}

    def resistance(self, velocity: float, way: float, pressure: float) -> float:
        """Add the loss."""
        lost = self.sizes["turbulent"] * velocity * abs(velocity)
        return super().resistance(velocity, way, pressure) + lost


class ExternalLoad(Hidden):
    """A weight, and how it changes along the way."""

    name = "external_load"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw both over the piston's area."""
        return {
            "weight": either_sign(random, 0.05, 0.5),
            "weight_per_way": either_sign(random, 0.001, 0.01),
        }

    def load(self, way: float, time: float) -> float:
        """Add the weight."""
        weight = self.sizes["weight"] + self.sizes["weight_per_way"] * way
        return super().load(way, time) + weight


class ElasticBoom(Hidden):
    """The mass moves behind an elastic arm; the piston beside it is light."""

    name = "elastic_boom"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw the arm's compliance over the oil's, and its damping, of critical."""
        return {
            "compliance": between(random, 0.3, 2.0),
            "arm_damping": between(random, 0.03, 0.3),
        }

    def piston(self, x: State, time: float) -> float:
        """Return the velocity at which friction and the arm's damper take up the pressure."""
        damper = self._damper()
        driving = x[OIL] - self.load(x[WAY], time) - self._spring(x) + damper * x[MASS]

        def left(velocity: float) -> float:
            return driving - damper * velocity - self.resistance(velocity, x[WAY], x[OIL])

        fastest = driving / damper  # without friction
        return float(brentq(left, 0.0, fastest)) if fastest else 0.0

    def push(self, x: State, velocity: float, time: float) -> float:
        """Return the arm's force."""
        return self._spring(x) + self._damper() * (velocity - x[MASS])

    def _spring(self, x: State) -> float:
        return x[STRETCH] / self.sizes["compliance"]

    def _damper(self) -> float:
        stiffness = math.sqrt(1.0 / self.sizes["compliance"])
        return 2.0 * self.sizes["arm_damping"] * stiffness / self.n.frequency


class SwingingLoad(Hidden):
    """A load that hangs on what moves and swings."""

    name = "swinging_load"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw its mass, over that of what carries it, frequency and damping."""
        return {
            "hanging_mass": between(random, 0.03, 0.3),
            "swing_frequency": between(random, 0.08, 0.4),
            "swing_damping": between(random, 0.002, 0.03),
        }

    def hanging(self) -> float:
        """Return its mass."""
        return self.sizes["hanging_mass"]

    def tug(self, x: State) -> float:
        """Return a damped pendulum's acceleration."""
        frequency = self.sizes["swing_frequency"]
        damped = 2.0 * self.sizes["swing_damping"] * (x[MASS] - x[SWING])
        return frequency * (frequency * x[SWING_WAY] + damped)


CATALOGUE: tuple[type[Hidden], ...] = (
    CommandDelay,
    ValveNullOffset,
    ValveDeadZoneError,
    ValveGainAsymmetry,
    ValveHysteresis,
    FlowGainDrift,
    FlowLimit,
    SupplyPressureDroop,
    ReliefValve,
    LoadHoldingValve,
    InternalLeakage,
    LineResistance,
    CoulombFriction,
    StribeckFriction,
    PressureDependentFriction,
    TurbulentResistance,
    ExternalLoad,
    ElasticBoom,
    SwingingLoad,
)

"""Effects of the catalogue in other forms than `hidden.py` has, for `emir blind --foreign`.

The registry knows these forms, so `found` with the name before the ~ is the right answer.
"""

import math
from typing import Any, ClassVar

import numpy as np

from emir_analysis.blind.boom import GRAVITY
from emir_analysis.blind.hidden import (
    Hidden,
    Random,
    Scale,
    between,
    boom_mass,
    either_sign,
    lifting_force,
    nominal_speed,
)
from emir_analysis.blind.machine import HYDRAULIC, Array, Sizes
from emir_analysis.blind.numbers import Numbers

LOGIC = HYDRAULIC - 1  # where the state has the logic block's opening
LAMINAR = 1e5  # Pa, below which a hole is laminar


def _through_a_hole(size: float, drop: float) -> float:
    return size * drop / math.sqrt(math.hypot(drop, LAMINAR))


class TurbulentLeak(Hidden):
    """A scratch past the piston: flow with the root of the pressure."""

    name = "internal_leakage~turbulent"
    grows = ("scratch",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"scratch": between(random, 4e-9, 3e-8)}

    def leaving(self, p_h: float, p_s: float) -> tuple[float, float]:
        out_h, out_s = super().leaving(p_h, p_s)
        across = _through_a_hole(self.sizes["scratch"], p_h - p_s)
        return out_h + across, out_s - across


class TurbulentDrip(Hidden):
    """The same from the lifting chamber to the tank."""

    name = "external_leakage~turbulent"
    grows = ("drip",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"drip": between(random, 4e-9, 3e-8)}

    def leaving(self, p_h: float, p_s: float) -> tuple[float, float]:
        out_h, out_s = super().leaving(p_h, p_s)
        return out_h + _through_a_hole(self.sizes["drip"], p_h - self.n.pT), out_s


class LateSensor(Hidden):
    """A sensor whose signal comes late as a whole, over a bus."""

    name = "sensor_delay~dead time"
    grows = ("late_angle", "late_pressure_lifting", "late_deflection")

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {str(random.choice(cls.grows)): between(random, 0.015, 0.06)}

    def shown(self, signals: dict[str, Array], states: Array) -> dict[str, Array]:
        time = np.arange(states.shape[0]) / self.n.rate
        return {
            name: np.interp(time - self.size(f"late_{name}"), time, signal)
            for name, signal in super().shown(signals, states).items()
        }


class LinearDrift(Hidden):
    """A valve's gain that changes evenly with time."""

    name = "flow_gain_drift~linear"
    grows = ("per_minute",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"per_minute": either_sign(random, 0.06, 0.25)}

    def opening(self, edges: float, time: float, stroke: float) -> float:
        gain = 1.0 + self.sizes["per_minute"] * time / 60.0
        return super().opening(edges, time, stroke) * gain


class _AtInlet(Hidden):
    """An error of the gain at the edge from the pump alone."""

    def gain(self, opening: float, time: float) -> float:
        """Return the factor on what the inlet lets through."""
        raise NotImplementedError

    def opening(self, edges: float, time: float, stroke: float) -> float:
        found = super().opening(edges, time, stroke)
        self._inlet = self.gain(found, time)
        return found

    def pumped(self, wanted: float, drop: float) -> float:
        return super().pumped(wanted * self._inlet, drop)


class DriftAtInlet(_AtInlet):
    """A pump, or a pressure balance, whose flow changes evenly with time."""

    name = "flow_gain_drift~at the inlet"
    grows = ("inlet_per_minute",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"inlet_per_minute": either_sign(random, 0.06, 0.25)}

    def gain(self, opening: float, time: float) -> float:
        return 1.0 + self.sizes["inlet_per_minute"] * time / 60.0


class AsymmetryAtInlet(_AtInlet):
    """Another flow from the pump in one direction."""

    name = "valve_gain_asymmetry~at the inlet"
    grows = ("inlet_lifting", "inlet_lowering")

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {str(random.choice(cls.grows)): either_sign(random, 0.04, 0.15)}

    def gain(self, opening: float, time: float) -> float:
        return 1.0 + self.size("inlet_lifting" if opening > 0.0 else "inlet_lowering")


def _swung(since: float, frequency: float) -> float:
    """Return the share of a load that swings, a time, s, since it came."""
    return math.cos(2.0 * math.pi * frequency * since) if since >= 0.0 else 0.0


class LoadOnPiston(Hidden):
    """A force along the piston's rod: what leans on the cylinder, comes within a while and goes."""

    name = "external_load~on the piston"
    grows = ("leans",)
    COMES = 0.3  # s

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {
            "leans": either_sign(random, 1.5e4, 6e4),
            "leans_at": random.uniform(5.0, 25.0),
            "leans_for": float(random.choice([1e6, random.uniform(5.0, 15.0)])),
        }

    def accelerations(self, x: Array, time: float, angle: float, push: float) -> Array:
        since = time - self.sizes["leans_at"]
        left = self.sizes["leans_for"] - since
        force = self.sizes["leans"] * min(max(min(since, left) / self.COMES, 0.0), 1.0)
        return super().accelerations(x, time, angle, push + force)


class TurningLoad(Hidden):
    """A torque about the joint that comes and stays, or swings: a winch, a cable that pulls."""

    name = "external_load~about the joint"
    grows = ("torque",)
    scales: ClassVar[dict[str, Scale]] = {"torque": boom_mass}

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {
            "torque": either_sign(random, 1e4, 5e4),
            "torque_at": random.uniform(5.0, 25.0),
            "turns_at": float(random.choice([0.0, between(random, 0.1, 0.4)])),
        }

    def accelerations(self, x: Array, time: float, angle: float, push: float) -> Array:
        s = self.sizes
        torque = s["torque"] * _swung(time - s["torque_at"], s["turns_at"])
        return super().accelerations(x, time, angle, push + torque / self.lever_arm(angle))


class HangingLoad(Hidden):
    """A weight that is hung on or taken off: vertical, at any angle of the boom."""

    name = "external_load~vertical"
    grows = ("hung_on",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {
            "hung_on": either_sign(random, 500.0, 2500.0),
            "hung_at": random.uniform(5.0, 25.0),
            "swings_at": float(random.choice([0.0, between(random, 0.1, 0.4)])),
        }

    def weight(self, time: float, angle: float) -> Array:
        s = self.sizes
        hung = s["hung_on"] * _swung(time - s["hung_at"], s["swings_at"])
        return super().weight(time, angle) - self.boom.tip * hung * math.cos(angle)


class FillingHose(Hidden):
    """Concrete that fills the hose along the boom: weight that comes while it works."""

    name = "external_load~filling hose"
    grows = ("concrete",)
    scales: ClassVar[dict[str, Scale]] = {"concrete": boom_mass}

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {
            "concrete": between(random, 100.0, 400.0),
            "filling_from": random.uniform(5.0, 15.0),
            "filling_for": random.uniform(10.0, 25.0),
        }

    def weight(self, time: float, angle: float) -> Array:
        s = self.sizes
        share = min(max((time - s["filling_from"]) / s["filling_for"], 0.0), 1.0)
        hose = GRAVITY * s["concrete"] * share * self.boom.tip * math.cos(angle)
        return super().weight(time, angle) + hose


class SlowLoad(Hidden):
    """A load that comes slowly and stays, or goes as it came."""

    name = "external_load~slow"
    grows = ("pull",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {
            "pull": either_sign(random, 500.0, 3000.0),
            "comes_at": random.uniform(5.0, 25.0),
            "comes_in": between(random, 0.3, 15.0),
            "stays": float(random.choice([1e6, random.uniform(5.0, 15.0)])),
        }

    def tip_force(self, time: float) -> float:
        since, rise = time - self.sizes["comes_at"], self.sizes["comes_in"]
        come, gone = np.clip([since / rise, (since - self.sizes["stays"]) / rise], 0.0, 1.0)
        return super().tip_force(time) + self.sizes["pull"] * float(come - gone)


class SwingAboutMean(Hidden):
    """A load that hangs and swings, from before the recording."""

    name = "external_load~mean and swing"
    grows = ("hangs",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {
            "hangs": either_sign(random, 300.0, 1500.0),
            "swings": random.uniform(0.3, 1.0),
            "swing_frequency": between(random, 0.05, 0.4),
            "swing_phase": random.uniform(-3.0, 3.0),
        }

    def tip_force(self, time: float) -> float:
        s = self.sizes
        angle = 2.0 * np.pi * s["swing_frequency"] * time + s["swing_phase"]
        swing = s["hangs"] * (1.0 + s["swings"] * float(np.cos(angle)))
        return super().tip_force(time) + swing


class LoadElsewhere(Hidden):
    """A load on the boom, as near the joint as half way or a little beyond the TCP."""

    name = "payload~elsewhere"
    grows = ("hung_mass",)
    scales: ClassVar[dict[str, Scale]] = {"hung_mass": boom_mass}

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        place = float(random.choice([random.uniform(0.5, 0.95), random.uniform(1.02, 1.1)]))
        return {"hung_mass": between(random, 50.0, 600.0), "hung_place": place}

    def changed(self, numbers: Numbers) -> Numbers:
        n, s = super().changed(numbers), self.sizes
        return Numbers(**{**vars(n), "carried": s["hung_mass"], "carried_at": s["hung_place"]})


class BlockedPoppet(Hidden):
    """A logic block whose poppet meets something on its way."""

    name = "logic_block_fault~blocked"
    grows = ("in_the_way",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"in_the_way": between(random, 0.4, 0.75)}

    def start(self, angle: float, p_s: float) -> Array:
        x = super().start(angle, p_s)
        x[LOGIC] = min(x[LOGIC], self._stop)
        return x

    def logic_rate(self, opened: float, pilot: float) -> float:
        rate = super().logic_rate(opened, pilot)
        return min(rate, 0.0) if opened >= self._stop else rate

    @property
    def _stop(self) -> float:
        return max(1.0 - self.sizes["in_the_way"], 0.05)


class StiffSpring(Hidden):
    """A logic block that shuts on the way down, as the pressure swings."""

    def changed(self, numbers: Numbers) -> Numbers:
        n = super().changed(numbers)
        return Numbers(**{**vars(n), "threshold": self.sizes["opens_at"] * n.threshold})


class SlowToOpen(StiffSpring):
    """And whose pilot line is narrow: it opens late."""

    name = "logic_block_fault~slow to open"
    grows = ("opens_in", "opens_at")

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"opens_in": between(random, 0.3, 1.0), "opens_at": between(random, 1.5, 2.5)}

    def logic_rate(self, opened: float, pilot: float) -> float:
        if pilot > self.n.threshold:
            return (1.0 - opened) / self.sizes["opens_in"]
        return super().logic_rate(opened, pilot)


class HeldOpen(StiffSpring):
    """And whose open poppet is pressed on all over: it shuts later than it opens."""

    name = "logic_block_fault~held open"
    grows = ("opens_at", "shuts_lower")

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"opens_at": between(random, 1.5, 2.5), "shuts_lower": between(random, 0.2, 0.5)}

    def logic_rate(self, opened: float, pilot: float) -> float:
        held = self.sizes["shuts_lower"] * self.n.threshold * opened
        return super().logic_rate(opened, pilot + held)


class OtherOil(Hidden):
    """Oil softer or stiffer than stated, beyond what the maker allows for, in one chamber or both.

    One chamber: walls, then.
    """

    name = "vessel_compliance~beta"
    grows = ("softer",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        softer = float(random.choice([random.uniform(0.35, 0.9), random.uniform(-0.35, -0.25)]))
        return {"softer": softer, "where": float(random.integers(3))}

    def stiffness(self, pressure: float, volume: float, *, lifting: bool) -> float:
        oil = super().stiffness(pressure, volume, lifting=lifting)
        both = self.sizes["where"] == 2.0
        here = both or lifting == (self.sizes["where"] == 0.0)
        return oil / (1.0 + self.sizes["softer"]) if here else oil


class SameSlope(Hidden):
    """Ports of the same width that begin elsewhere."""

    name = "valve_dead_zone_error~same slope"
    grows = ("moved",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"moved": either_sign(random, 0.012, 0.05)}

    def changed(self, numbers: Numbers) -> Numbers:
        n = super().changed(numbers)
        return Numbers(**{**vars(n), "dead_zone": n.dead_zone + self.sizes["moved"]})

    def opening(self, edges: float, time: float, stroke: float) -> float:
        width = self.n.dead_zone
        steeper = (1.0 - width) / (1.0 - width + self.sizes["moved"])
        return super().opening(edges, time, stroke) * steeper


class OneEdge(Hidden):
    """One metering edge ground elsewhere, the other as stated; full stroke opens fully."""

    name = "valve_dead_zone_error~one edge"
    grows = ("ground",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {
            "ground": either_sign(random, 0.02, 0.06),
            "lifts": float(random.choice([-1.0, 1.0])),
        }

    def opening(self, edges: float, time: float, stroke: float) -> float:
        if edges * self.sizes["lifts"] <= 0.0:
            return super().opening(edges, time, stroke)
        begins = self.n.dead_zone + self.sizes["ground"]
        opens = max((abs(edges) - begins) / (1.0 - begins), 0.0)
        # where a full opening of what is stated is one, whatever else is hidden scales it
        stated = self.n.dead_zone + opens * (1.0 - self.n.dead_zone)
        return super().opening(math.copysign(stated, edges), time, stroke)


class SquareDroop(Hidden):
    """A filter behind the pump: pressure falls with the square of the flow."""

    name = "supply_pressure_droop~square"
    grows = ("at_full_flow",)

    def __init__(self, numbers: Numbers, sizes: Sizes | None = None) -> None:
        super().__init__(numbers, sizes)
        self._missing = self.slot()

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"at_full_flow": between(random, 2e6, 8e6)}

    def supply(self, time: float, x: list[float]) -> float:
        return super().supply(time, x) - 1e5 * x[self._missing]

    def remembered_rates(self, time: float, x: list[float], now: dict[str, float]) -> list[float]:
        others = super().remembered_rates(time, x, now)
        wanted = 1e-5 * self.sizes["at_full_flow"] * (now["pumped"] / self.n.flow_nominal) ** 2
        return [*others, (wanted - x[self._missing]) / 0.02]

    def start_memory(self, angle: float, x: list[float]) -> list[float]:
        return [*super().start_memory(angle, x), 0.0]


class PlayOfMagnet(Hidden):
    """Play between command and spool."""

    name = "valve_hysteresis~on the command"
    grows = ("magnet",)

    def __init__(self, numbers: Numbers, sizes: Sizes | None = None) -> None:
        super().__init__(numbers, sizes)
        self._acting = 0.0

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"magnet": between(random, 0.012, 0.05)}

    def start(self, angle: float, p_s: float) -> Array:
        self._acting = 0.0
        return super().start(angle, p_s)

    def run(self, x: Array, times: Array, command: float) -> Any:
        half = 0.5 * self.sizes["magnet"]
        self._acting = min(max(self._acting, command - half), command + half)
        return super().run(x, times, self._acting)


class LaggingCommand(Hidden):
    """A filter ahead of the spool."""

    name = "command_delay~lag"
    grows = ("filtered",)

    def __init__(self, numbers: Numbers, sizes: Sizes | None = None) -> None:
        super().__init__(numbers, sizes)
        self._filter = self.slot()
        self._given = 0.0

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"filtered": between(random, 0.015, 0.06)}

    def rates(self, x: Array, time: float, command: float) -> Array:
        self._given = command
        return super().rates(x, time, float(x[self._filter]))

    def remembered_rates(self, time: float, x: list[float], now: dict[str, float]) -> list[float]:
        behind = self._given - x[self._filter]
        return [*super().remembered_rates(time, x, now), behind / self.sizes["filtered"]]

    def start_memory(self, angle: float, x: list[float]) -> list[float]:
        return [*super().start_memory(angle, x), 0.0]


class _OnBristles(Hidden):
    """Seals that give before they slide, as LuGre's bristles do; a state is how far, in 10 um."""

    def __init__(self, numbers: Numbers, sizes: Sizes | None = None) -> None:
        super().__init__(numbers, sizes)
        self._bristle = self.slot()

    def slides_at(self, velocity: float, x: Array) -> float:
        """Return the friction, N, at which the seals slide."""
        raise NotImplementedError

    def stiffness_of_seals(self, x: Array) -> float:
        """Return that of the bristles, N/m."""
        return self.sizes["slides"] / self.sizes["gives"]

    def slides_with(self, bent: float) -> float:
        """Return the share of the seals that slides, bent by a share of the furthest.

        bent: above 0 the way that the piston moves.
        """
        return 1.0

    def _bending(self, x: Array) -> tuple[float, float]:
        angle, _, spin = self._rows @ x[self.modes]
        velocity = self.lever_arm(angle) * spin
        bent = 1e-5 * x[self._bristle]
        furthest = self.slides_at(velocity, x) / self.stiffness_of_seals(x)
        slides = self.slides_with(math.copysign(bent, bent * velocity) / furthest)
        return bent, velocity - slides * abs(velocity) * bent / furthest

    def remembered_rates(self, time: float, x: list[float], now: dict[str, float]) -> list[float]:
        _, rate = self._bending(np.array(x))
        return [*super().remembered_rates(time, x, now), 1e5 * rate]

    def accelerations(self, x: Array, time: float, angle: float, push: float) -> Array:
        bent, rate = self._bending(x)
        held = self.stiffness_of_seals(x) * (bent + self.sizes["bristle_time"] * rate)
        return super().accelerations(x, time, angle, push - held)

    def start_memory(self, angle: float, x: list[float]) -> list[float]:
        return [*super().start_memory(angle, x), 0.0]


class StribeckOnBristles(_OnBristles):
    """LuGre's friction with a break-away."""

    name = "stribeck_friction~bristles"
    grows = ("slides",)
    scales: ClassVar[dict[str, Scale]] = {"slides": lifting_force}

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {
            "slides": between(random, 4e3, 1.5e4),
            "breaks_away": random.uniform(1.2, 2.0),
            "falls_at": between(random, 4e-3, 2e-2),
            "gives": between(random, 1e-5, 1e-4),
            "bristle_time": float(random.choice([0.0, 1.5e-3])),
        }

    def slides_at(self, velocity: float, x: Array) -> float:
        s = self.sizes
        hump = (s["breaks_away"] - 1.0) * math.exp(-((velocity / s["falls_at"]) ** 2))
        return s["slides"] * (1.0 + hump)


class LoadOnBristles(_OnBristles):
    """Friction by the load, of seals that give."""

    name = "pressure_dependent_friction~bristles"
    grows = ("rubs",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {
            "rubs": between(random, 0.01, 0.04),
            "gives": between(random, 1e-5, 1e-4),
            "bristle_time": 0.0,
        }

    def slides_at(self, velocity: float, x: Array) -> float:
        force = x[0] * self.n.area_lifting - x[1] * self.n.area_lowering
        return self.sizes["rubs"] * abs(float(force)) + 1.0  # N, never 0: it is divided by

    def stiffness_of_seals(self, x: Array) -> float:
        return self.slides_at(0.0, x) / self.sizes["gives"]


class ElasticBristles(_OnBristles):
    """Seals that spring back before they slide: elastoplastic, by Dupont et al. (2002)."""

    name = "coulomb_friction~elastic bristles"
    grows = ("slides",)
    scales: ClassVar[dict[str, Scale]] = {"slides": lifting_force}

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {
            "slides": between(random, 4e3, 1.5e4),
            "gives": between(random, 3e-5, 2e-4),
            "springs_to": random.uniform(0.5, 0.8),
            "slides_from": random.uniform(0.9, 1.0),
            "bristle_time": 0.0,
        }

    def slides_at(self, velocity: float, x: Array) -> float:
        return self.sizes["slides"]

    def slides_with(self, bent: float) -> float:
        low, high = self.sizes["springs_to"], self.sizes["slides_from"]
        passed = (min(max(bent, low), high) - low) / (high - low)
        return 0.5 - 0.5 * math.cos(math.pi * passed)


class PressedSeals(Hidden):
    """Dry friction of seals, each pressed on by the pressure of its own chamber."""

    name = "pressure_dependent_friction~seals"
    grows = ("seals_rub",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"seals_rub": between(random, 0.01, 0.03), "rubs_from": between(random, 2e-4, 2e-3)}

    def accelerations(self, x: Array, time: float, angle: float, push: float) -> Array:
        n, modes = self.n, self.boom.joint
        spin = float(modes @ x[self.modes][modes.size :])
        pressed = float(x[0]) * n.area_lifting + float(x[1]) * n.area_lowering
        velocity = self.lever_arm(angle) * spin
        dry = velocity / math.hypot(velocity, self.sizes["rubs_from"])
        return super().accelerations(x, time, angle, push - self.sizes["seals_rub"] * pressed * dry)


class UnevenFriction(Hidden):
    """A seal that rubs less on the way down."""

    name = "coulomb_friction~by_direction"
    grows = ("rub",)
    scales: ClassVar[dict[str, Scale]] = {"rub": lifting_force}

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"rub": between(random, 5e3, 2e4), "less": random.uniform(0.3, 0.6)}

    def resistance(self, velocity: float, force: float, stroke: float) -> float:
        side = velocity / math.hypot(velocity, 1e-3)
        rub = self.sizes["rub"] * (1.0 if side > 0.0 else self.sizes["less"])
        return super().resistance(velocity, force, stroke) + rub * side


class NarrowGap(Hidden):
    """Friction that grows faster than the speed: oil is pushed through what is narrow."""

    name = "viscous_friction~square"
    grows = ("film", "gap")
    scales: ClassVar[dict[str, Scale]] = {
        "film": lambda n: lifting_force(n) / nominal_speed(n),
        "gap": lambda n: lifting_force(n) / nominal_speed(n) ** 2,
    }

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"film": between(random, 2e4, 2e5), "gap": between(random, 1e6, 1e7)}

    def resistance(self, velocity: float, force: float, stroke: float) -> float:
        oil = (self.sizes["film"] + self.sizes["gap"] * abs(velocity)) * velocity
        return super().resistance(velocity, force, stroke) + oil


FOREIGN: tuple[type[Hidden], ...] = (
    TurbulentLeak,
    TurbulentDrip,
    LateSensor,
    LinearDrift,
    DriftAtInlet,
    AsymmetryAtInlet,
    LoadOnPiston,
    TurningLoad,
    HangingLoad,
    FillingHose,
    SlowLoad,
    SwingAboutMean,
    LoadElsewhere,
    BlockedPoppet,
    SlowToOpen,
    HeldOpen,
    OtherOil,
    SameSlope,
    OneEdge,
    SquareDroop,
    PlayOfMagnet,
    LaggingCommand,
    StribeckOnBristles,
    LoadOnBristles,
    ElasticBristles,
    PressedSeals,
    UnevenFriction,
    NarrowGap,
)

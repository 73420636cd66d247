"""What may be hidden in a machine: the effects of the catalogue, written a second time.

Each draws its sizes at random inside the range that is usual for it. Where the simulator has a
smoothed law, another smoothing stands here; where it has a lag, the same differential equation.
"""

import math
from collections.abc import Callable
from typing import ClassVar

import numpy as np

from emir_analysis.blind.machine import HYDRAULIC, Array, Machine, Sizes
from emir_analysis.blind.numbers import Numbers, main_joint

Random = np.random.Generator
Scale = Callable[[Numbers], float]

ATMOSPHERE = 1e5  # Pa
P_H, P_S, LOGIC = 0, 1, 4


def between(random: Random, low: float, high: float) -> float:
    """Return a number between two positive ones, its logarithm evenly spread."""
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def either_sign(random: Random, low: float, high: float) -> float:
    """Return the same, of either sign."""
    return float(random.choice([-1.0, 1.0])) * between(random, low, high)


def lifting_force(n: Numbers) -> float:
    """Return the lifting force of the pump's pressure, N."""
    return n.area_lifting * n.p0


def nominal_speed(n: Numbers) -> float:
    """Return the piston's nominal speed, m/s."""
    return n.flow_nominal / n.area_lifting


def lever(n: Numbers) -> float:
    """Return the lever to which the stroke is in proportion, m."""
    return n.triangle_b


def boom_mass(n: Numbers) -> float:
    """Return the boom's mass, kg, to which loads are in proportion."""
    return n.boom_mass


def nominal_leak(n: Numbers) -> float:
    """Return the nominal flow over the pump's pressure, m^3/(s Pa)."""
    return n.flow_nominal / n.p0


def nominal_hose(n: Numbers) -> float:
    """Return the cylinder's volume over the pump's pressure, m^3/Pa."""
    return n.area_lifting * n.triangle_b / n.p0


class Hidden(Machine):
    """Base of what may be hidden.

    name: as the catalogue has it. grows: sizes to which more of the effect belongs. scales: what
    sizes are in proportion to, from one machine to another.
    """

    name: ClassVar[str]
    grows: ClassVar[tuple[str, ...]]
    scales: ClassVar[dict[str, Scale]] = {}

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Return sizes by name, SI units, as in EMIR's main joint."""
        raise NotImplementedError

    @classmethod
    def drawn(cls, random: Random, n: Numbers) -> Sizes:
        """Return sizes by name, SI units, as in a machine with these numbers."""
        sizes, emir = cls.draw(random), main_joint()
        for name in sizes.keys() & cls.scales.keys():
            sizes[name] *= cls.scales[name](n) / cls.scales[name](emir)
        return sizes

    def size(self, name: str) -> float:
        """Return one of the effect's sizes; 0 where it was not drawn."""
        return self.sizes.get(name, 0.0)


def _dry(velocity: float, smoothing: float) -> float:
    """Return a smoothed sign; no tanh, and rounder."""
    return velocity / math.hypot(velocity, smoothing)


class CoulombFriction(Hidden):
    """Dry friction, the same at every speed."""

    name = "coulomb_friction"
    grows = ("coulomb_force",)
    scales: ClassVar[dict[str, Scale]] = {"coulomb_force": lifting_force}

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw 1 to 4 % of the load."""
        return {
            "coulomb_force": between(random, 5e3, 2.5e4),
            "coulomb_smoothing": between(random, 2e-4, 2e-3),
        }

    def resistance(self, velocity: float, force: float, stroke: float) -> float:
        """Add the friction."""
        dry = self.sizes["coulomb_force"] * _dry(velocity, self.sizes["coulomb_smoothing"])
        return super().resistance(velocity, force, stroke) + dry


class StribeckFriction(Hidden):
    """Dry friction that falls from breakaway."""

    name = "stribeck_friction"
    grows = ("stribeck_force",)
    scales: ClassVar[dict[str, Scale]] = {"stribeck_force": lifting_force}

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw a breakaway well above the sliding force."""
        return {
            "stribeck_force": between(random, 4e3, 1.5e4),
            "stribeck_breakaway": random.uniform(1.4, 2.2),
            "stribeck_speed": between(random, 5e-3, 2e-2),
            "stribeck_smoothing": between(random, 2e-4, 1e-3),
        }

    def resistance(self, velocity: float, force: float, stroke: float) -> float:
        """Add the friction."""
        s = self.sizes
        extra = (s["stribeck_breakaway"] - 1.0) * math.exp(-((velocity / s["stribeck_speed"]) ** 2))
        dry = s["stribeck_force"] * (1.0 + extra) * _dry(velocity, s["stribeck_smoothing"])
        return super().resistance(velocity, force, stroke) + dry


class ViscousFriction(Hidden):
    """Friction that grows with speed."""

    name = "viscous_friction"
    grows = ("viscous",)
    scales: ClassVar[dict[str, Scale]] = {"viscous": lambda n: lifting_force(n) / nominal_speed(n)}

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw 2 to 12 kN at 30 mm/s."""
        return {"viscous": between(random, 7e4, 4e5)}

    def resistance(self, velocity: float, force: float, stroke: float) -> float:
        """Add the friction."""
        return super().resistance(velocity, force, stroke) + self.sizes["viscous"] * velocity


class PressureDependentFriction(Hidden):
    """Dry friction as a share of the load."""

    name = "pressure_dependent_friction"
    grows = ("share_of_load",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw 1 to 4 % of the load."""
        return {
            "share_of_load": between(random, 0.01, 0.04),
            "share_smoothing": between(random, 2e-4, 2e-3),
        }

    def resistance(self, velocity: float, force: float, stroke: float) -> float:
        """Add the friction."""
        dry = self.sizes["share_of_load"] * abs(force)
        dry *= _dry(velocity, self.sizes["share_smoothing"])
        return super().resistance(velocity, force, stroke) + dry


class Payload(Hidden):
    """A load at the TCP."""

    name = "payload"
    grows = ("mass",)
    scales: ClassVar[dict[str, Scale]] = {"mass": boom_mass}

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw a fraction of what the arm may carry."""
        return {"mass": between(random, 50.0, 600.0)}

    def changed(self, numbers: Numbers) -> Numbers:
        """Hang the mass on the boom."""
        before = super().changed(numbers)
        return Numbers(**{**vars(before), "payload": before.payload + self.sizes["mass"]})


class ExternalLoad(Hidden):
    """A force at the TCP over time: a steady wind that sets in, a contact, a swinging load."""

    name = "external_load"
    grows = ("load",)
    scales: ClassVar[dict[str, Scale]] = {"load": boom_mass}

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw one of the three."""
        load = {"load": either_sign(random, 400.0, 2000.0), "load_start": random.uniform(3.0, 15.0)}
        kind = random.integers(3)
        if kind == 0:
            return load | {"load_duration": 1e6, "load_frequency": 0.0}
        if kind == 1:
            return load | {"load_duration": random.uniform(4.0, 20.0), "load_frequency": 0.0}
        return load | {"load_duration": 1e6, "load_frequency": between(random, 0.05, 0.4)}

    def tip_force(self, time: float) -> float:
        """Add the force; a swinging one starts from zero, the others at once."""
        s, since = self.sizes, time - self.sizes["load_start"]
        other = super().tip_force(time)
        if not 0.0 <= since < s["load_duration"]:
            return other
        if s["load_frequency"] == 0.0:
            return other + s["load"]
        return other + s["load"] * math.sin(2.0 * math.pi * s["load_frequency"] * since)


class LinkageError(Hidden):
    """A lever arm off by a straight line over the stroke."""

    name = "linkage_error"
    grows = ("arm_scale", "arm_slope")
    scales: ClassVar[dict[str, Scale]] = {"arm_slope": lambda n: 1.0 / lever(n)}

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw up to 2 % and its growth."""
        return {
            "arm_scale": either_sign(random, 0.004, 0.02),
            "arm_slope": either_sign(random, 0.008, 0.04),
        }

    def stroke(self, angle: float) -> float:
        """Return the integral of the lever arm over the angle."""
        h = super().stroke(angle)
        return h + self.sizes["arm_scale"] * h + self.sizes["arm_slope"] * h * h / 2.0

    def lever_arm(self, angle: float) -> float:
        """Return the arm as built."""
        off = self.sizes["arm_scale"] + self.sizes["arm_slope"] * self.stated_stroke(angle)
        return super().lever_arm(angle) * (1.0 + float(off))


class InternalLeakage(Hidden):
    """Oil past the piston."""

    name = "internal_leakage"
    grows = ("past_piston",)
    scales: ClassVar[dict[str, Scale]] = {"past_piston": nominal_leak}

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw a worn piston's."""
        return {"past_piston": between(random, 5e-13, 1e-11)}

    def leaving(self, p_h: float, p_s: float) -> tuple[float, float]:
        """Move oil from one chamber to the other."""
        out_h, out_s = super().leaving(p_h, p_s)
        across = self.sizes["past_piston"] * (p_h - p_s)
        return out_h + across, out_s - across


class ExternalLeakage(Hidden):
    """Oil from one chamber to the tank."""

    name = "external_leakage"
    grows = ("leak_lifting", "leak_lowering")
    scales: ClassVar[dict[str, Scale]] = {
        "leak_lifting": nominal_leak,
        "leak_lowering": nominal_leak,
    }

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw one chamber and its leak."""
        return {str(random.choice(cls.grows)): between(random, 5e-13, 1e-11)}

    def leaving(self, p_h: float, p_s: float) -> tuple[float, float]:
        """Let oil out."""
        out_h, out_s = super().leaving(p_h, p_s)
        out_h += self.size("leak_lifting") * (p_h - self.n.pT)
        out_s += self.size("leak_lowering") * (p_s - self.n.pT)
        return out_h, out_s


class EntrainedAir(Hidden):
    """Oil with air bubbles: compliances of oil and gas by volume."""

    name = "entrained_air"
    grows = ("air",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw up to 3 % of the volume, and below which pressure it stays as it is."""
        return {
            "air": between(random, 0.003, 0.03),
            "polytropic": random.uniform(1.0, 1.4),
            "swells_down_to": between(random, 5e2, 2e4),
        }

    def stiffness(self, pressure: float, volume: float, *, lifting: bool) -> float:
        """Return the bulk modulus of both in series."""
        oil = super().stiffness(pressure, volume, lifting=lifting)
        p, n = max(pressure, self.sizes["swells_down_to"]), self.sizes["polytropic"]
        gas = self.sizes["air"] * math.pow(ATMOSPHERE / p, 1.0 / n)
        share = gas / (1.0 + gas)
        return 1.0 / ((1.0 - share) / oil + share / (n * p))


class VesselCompliance(Hidden):
    """A hose that widens, at one chamber or at both."""

    name = "vessel_compliance"
    grows = ("hose_lifting", "hose_lowering")
    scales: ClassVar[dict[str, Scale]] = {
        "hose_lifting": nominal_hose,
        "hose_lowering": nominal_hose,
    }

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw which, and how many litres of hose."""
        which = random.integers(3)
        names = cls.grows if which == 2 else (cls.grows[which],)  # noqa: PLR2004 (both)
        return {name: between(random, 1e-11, 1e-10) for name in names}

    def stiffness(self, pressure: float, volume: float, *, lifting: bool) -> float:
        """Add the compliance of the hose's wall."""
        oil = super().stiffness(pressure, volume, lifting=lifting)
        hose = self.size("hose_lifting" if lifting else "hose_lowering")
        return volume / (volume / oil + hose)


class SupplyPressureDroop(Hidden):
    """A pump that gives less pressure while it delivers."""

    name = "supply_pressure_droop"
    grows = ("droop",)
    scales: ClassVar[dict[str, Scale]] = {"droop": lambda n: 1.0 / nominal_leak(n)}

    def __init__(self, numbers: Numbers, sizes: Sizes | None = None) -> None:
        super().__init__(numbers, sizes)
        self._droop = self.slot()

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw some ten bar at 100 l/min."""
        return {"droop": between(random, 5e9, 2.5e10), "droop_time": between(random, 0.05, 0.6)}

    def supply(self, time: float, x: list[float]) -> float:
        """Take off what is missing."""
        return super().supply(time, x) - 1e5 * x[self._droop]

    def remembered_rates(self, time: float, x: list[float], now: dict[str, float]) -> list[float]:
        """Follow the flow; remembered in bar."""
        wanted = 1e-5 * self.sizes["droop"] * now["pumped"]
        rate = (wanted - x[self._droop]) / self.sizes["droop_time"]
        return [*super().remembered_rates(time, x, now), rate]

    def start_memory(self, angle: float, x: list[float]) -> list[float]:
        """Start full."""
        return [*super().start_memory(angle, x), 0.0]


class ValveNullOffset(Hidden):
    """A spool off its middle."""

    name = "valve_null_offset"
    grows = ("null",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw 1 to 4 % of the stroke."""
        return {"null": either_sign(random, 0.01, 0.04)}

    def edges(self, spool: float, x: list[float]) -> float:
        """Shift the edges."""
        return super().edges(spool, x) + self.sizes["null"]


class ValveGainAsymmetry(Hidden):
    """A gain of its own in one direction."""

    name = "valve_gain_asymmetry"
    grows = ("gain_lifting", "gain_lowering")

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw a direction and 4 to 15 %."""
        return {str(random.choice(cls.grows)): either_sign(random, 0.04, 0.15)}

    def opening(self, edges: float, time: float, stroke: float) -> float:
        """Scale the opening."""
        o = super().opening(edges, time, stroke)
        return o + o * self.size("gain_lifting" if o > 0.0 else "gain_lowering")


class ValveDeadZoneError(Hidden):
    """A dead zone other than stated."""

    name = "valve_dead_zone_error"
    grows = ("overlap",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw 1 to 4 % of the stroke."""
        return {"overlap": either_sign(random, 0.01, 0.04)}

    def changed(self, numbers: Numbers) -> Numbers:
        """Move both edges."""
        n = super().changed(numbers)
        width = max(n.dead_zone + self.sizes["overlap"], 0.0)
        return Numbers(**{**vars(n), "dead_zone": width})


class ValveHysteresis(Hidden):
    """Play between spool and edges: the spool pushes them from either side."""

    name = "valve_hysteresis"
    grows = ("spool_play",)
    PUSHED = 1e-5  # s, in which the edges follow the flank that pushes them: as good as none

    def __init__(self, numbers: Numbers, sizes: Sizes | None = None) -> None:
        super().__init__(numbers, sizes)
        self._edges = self.slot()

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw 1 to 5 % of the stroke."""
        return {"spool_play": between(random, 0.012, 0.05)}

    def edges(self, spool: float, x: list[float]) -> float:
        """Return where the edges are."""
        return super().edges(spool, x) - spool + x[self._edges]

    def remembered_rates(self, time: float, x: list[float], now: dict[str, float]) -> list[float]:
        """Push the edges."""
        ahead, half = now["spool"] - x[self._edges], 0.5 * self.sizes["spool_play"]
        push = max(ahead - half, 0.0) + min(ahead + half, 0.0)
        return [*super().remembered_rates(time, x, now), push / self.PUSHED]

    def start_memory(self, angle: float, x: list[float]) -> list[float]:
        """Start in the middle."""
        return [*super().start_memory(angle, x), 0.0]


class CommandDelay(Hidden):
    """A command that arrives late."""

    name = "command_delay"
    grows = ("late",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw a fraction of a control period to some."""
        return {"late": between(random, 0.01, 0.08)}

    def delay(self) -> float:
        """Return it."""
        return super().delay() + self.sizes["late"]


class FlowGainDrift(Hidden):
    """A gain that changes as the oil warms up."""

    name = "flow_gain_drift"
    grows = ("drift",)

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw 6 to 25 % with a time constant about the recording's length."""
        return {
            "drift": either_sign(random, 0.06, 0.25),
            "drift_time": between(random, 15.0, 120.0),
        }

    def opening(self, edges: float, time: float, stroke: float) -> float:
        """Scale the opening."""
        warm = 1.0 - math.exp(-time / self.sizes["drift_time"])
        return super().opening(edges, time, stroke) * (1.0 + self.sizes["drift"] * warm)


class LogicBlockFault(Hidden):
    """A logic block with another threshold, another closing time or a leaking pilot line."""

    name = "logic_block_fault"
    grows = ("threshold_off", "closing_off", "pilot_leak")

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw one of the three."""
        kind = random.integers(3)
        if kind == 0:
            return {"threshold_off": either_sign(random, 5e5, 3e6)}
        if kind == 1:
            return {"closing_off": between(random, 0.6, 4.0)}
        return {"pilot_leak": between(random, 0.06, 0.3)}

    def changed(self, numbers: Numbers) -> Numbers:
        """Change threshold and closing time."""
        n = super().changed(numbers)
        return Numbers(
            **{
                **vars(n),
                "threshold": n.threshold + self.size("threshold_off"),
                "time_constant_closing": n.time_constant_closing * (1.0 + self.size("closing_off")),
            }
        )

    def pilot(self, p_h: float, p_s: float) -> float:
        """Mix the pilot pressure."""
        leak = min(self.size("pilot_leak"), 1.0)
        return (1.0 - leak) * super().pilot(p_h, p_s) + leak * p_s


class Backlash(Hidden):
    """Play between piston and joint; the load decides on which flank the piston rests."""

    name = "backlash"
    grows = ("gap",)
    scales: ClassVar[dict[str, Scale]] = {"gap": lever, "seating": lifting_force}

    def __init__(self, numbers: Numbers, sizes: Sizes | None = None) -> None:
        super().__init__(numbers, sizes)
        self._offset = self.slot()

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Draw worn pins."""
        return {
            "gap": between(random, 5e-4, 3e-3),
            "seating": between(random, 1e4, 4e4),
            "crossing": between(random, 0.01, 0.03),
        }

    def _flank(self, force: float) -> float:
        return 0.5 * self.sizes["gap"] * _dry(force, self.sizes["seating"])

    def play(self, x: list[float]) -> float:
        """Return the offset; remembered in mm."""
        return super().play(x) + 1e-3 * x[self._offset]

    def remembered_rates(self, time: float, x: list[float], now: dict[str, float]) -> list[float]:
        """Cross over to the flank that carries."""
        others = super().remembered_rates(time, x, now)
        rate = (1e3 * self._flank(now["force"]) - x[self._offset]) / self.sizes["crossing"]
        now["play_rate"] = 1e-3 * rate
        return [*others, rate]

    def start_memory(self, angle: float, x: list[float]) -> list[float]:
        """Start on the flank that carries."""
        force = x[P_H] * self.n.area_lifting - x[P_S] * self.n.area_lowering
        return [*super().start_memory(angle, x), 1e3 * self._flank(force)]


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


CATALOGUE: tuple[type[Hidden], ...] = (
    CoulombFriction,
    StribeckFriction,
    ViscousFriction,
    PressureDependentFriction,
    Payload,
    ExternalLoad,
    LinkageError,
    InternalLeakage,
    ExternalLeakage,
    EntrainedAir,
    VesselCompliance,
    SupplyPressureDroop,
    ValveNullOffset,
    ValveGainAsymmetry,
    ValveDeadZoneError,
    ValveHysteresis,
    CommandDelay,
    FlowGainDrift,
    LogicBlockFault,
    Backlash,
    SensorBias,
    SensorGain,
    SensorDelay,
)

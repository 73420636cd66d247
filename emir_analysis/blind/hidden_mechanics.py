"""Effects on forces and masses, written a second time: friction, loads, linkage, backlash."""

import math
from typing import ClassVar

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
    nominal_speed,
)
from emir_analysis.blind.machine import Sizes
from emir_analysis.blind.numbers import Numbers


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

"""Effects on oil and chambers, written a second time: leaks, air, hoses, pump, logic block."""

import math
from typing import ClassVar

from emir_analysis.blind.hidden import (
    ATMOSPHERE,
    Hidden,
    Random,
    Scale,
    between,
    either_sign,
    nominal_hose,
    nominal_leak,
)
from emir_analysis.blind.machine import Sizes
from emir_analysis.blind.numbers import Numbers


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

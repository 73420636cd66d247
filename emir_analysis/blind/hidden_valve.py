"""Effects on the valve and its command, written a second time."""

import math

from emir_analysis.blind.hidden import Hidden, Random, between, either_sign
from emir_analysis.blind.machine import Sizes
from emir_analysis.blind.numbers import Numbers


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

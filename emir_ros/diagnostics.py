"""What a node says about itself on /diagnostics, where ROS's tools look for it, and in its log."""

from collections import Counter
from collections.abc import Callable, Mapping
from enum import IntEnum
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

from emir_msgs_py.conversions import set_stamp
from emir_msgs_py.topics import DIAGNOSTICS
from emir_ros import qos

REPEAT = 1.0  # s, after which the last word is said again: whoever came late hears it


class Level(IntEnum):
    """How bad it is, as DiagnosticStatus has it."""

    OK = 0
    WARN = 1
    ERROR = 2


class Beat:
    """How regularly something comes that is due every period, s."""

    def __init__(self, period: float) -> None:
        self._period = period
        self._last: float | None = None
        self._jitter = 0.0
        self._missed = 0

    def tick(self, now: float) -> None:
        """Note that it has come, at a time in s."""
        gap = self._period if self._last is None else now - self._last
        self._last = now
        self._jitter = max(self._jitter, abs(gap - self._period))
        self._missed += max(0, round(gap / self._period) - 1)

    def values(self) -> dict[str, str]:
        """Return the largest deviation since it was last asked for, and all missed periods."""
        jitter, self._jitter = self._jitter, 0.0
        return {"jitter [ms]": f"{jitter * 1e3:.3f}", "missed periods": str(self._missed)}


class Diagnostics:
    """The one status of a node: said when it changes, and in real time again every second.

    counts: what has happened how often since the start; it and what `figures` returns are the
    status's values. now: ns, what a status is stamped with.
    """

    def __init__(self, node: Node, now: Callable[[], int], *, lockstep: bool) -> None:
        self._node, self._now = node, now
        self.counts: Counter[str] = Counter()
        self.figures: Callable[[], Mapping[str, str]] = dict
        self._said: tuple[Level, str] | None = None
        self._publisher = node.create_publisher(
            DiagnosticArray, DIAGNOSTICS, qos.offered(lockstep=True)
        )
        if not lockstep:
            node.create_timer(REPEAT, self._publish)

    def say(self, level: Level, message: str) -> None:
        """Publish and log a status unless it is the last one, too."""
        if (level, message) == self._said:
            return
        log = self._node.get_logger()  # which knows a call by its place, and a place by its level
        if level == Level.ERROR:
            log.error(message)
        elif level == Level.WARN:
            log.warning(message)
        elif self._said is not None:  # that it begins well is no news
            log.info(message)
        self._said = level, message
        self._publish()

    def _publish(self) -> None:
        if self._said is None:
            return
        level, message = self._said
        array: Any = DiagnosticArray()
        set_stamp(array, self._now())
        name = self._node.get_fully_qualified_name()
        status = DiagnosticStatus(level=bytes([level]), name=name, message=message)
        found = {**self.figures(), **{key: str(n) for key, n in sorted(self.counts.items())}}
        status.values = [KeyValue(key=key, value=value) for key, value in found.items()]
        array.status.append(status)
        self._publisher.publish(array)


def pressures(signals: Mapping[str, float]) -> dict[str, str]:
    """Return the measured pressures among the signals as texts with their unit."""
    return {
        f"{name} [bar]": f"{value * 1e-5:.2f}"
        for name, value in signals.items()
        if "pressure_l" in name and "true" not in name
    }

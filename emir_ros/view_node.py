"""view_node: the running graph as a page in the browser (`emir view --live`). It only listens."""

import math
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

from emir_analysis.errors import InputError
from emir_analysis.view.command import start_server
from emir_analysis.view.frames import Frame, tcp_deflection
from emir_common.quantity import ParameterError
from emir_msgs_py import conversions
from emir_msgs_py.topics import (
    BOOM_DEFLECTION,
    CYLINDER_REFERENCE,
    CYLINDER_STATES,
    JOINT1,
    JOINT_STATES,
    PRESSURE_LIFTING,
    PRESSURE_LOWERING,
    TRUTH,
    VALVE_COMMAND,
    Topic,
)
from emir_ros import qos
from emir_ros.main import run
from emir_ros.node_parameters import declare, reject_unknown
from emir_ros.shell import Shell

SHOWN = (
    JOINT_STATES,
    CYLINDER_STATES,
    PRESSURE_LIFTING,
    PRESSURE_LOWERING,
    BOOM_DEFLECTION,
    CYLINDER_REFERENCE,
    VALVE_COMMAND,
    TRUTH,  # a real machine has none
)
PERIOD = 0.1  # s, of the page
KEPT = 300  # frames: the last 30 s
SILENT = 0.5  # s behind the others: a topic's numbers are no longer shown
NOTHING = 1.0  # s without anything, which is then said
HIGHEST_PORT = 65535


class ViewNode(Shell):
    """Sensors, reference and valve command -> a page on this computer."""

    def __init__(self, arguments: Sequence[str] | None = None) -> None:
        super().__init__("view_node", [], arguments, robot=[])
        port: int = declare(self, "port", 8080, "of the page")
        reject_unknown(self)
        if not 0 < port <= HIGHEST_PORT:
            raise ParameterError(f"view_node: port = {port}: outside 1 ... {HIGHEST_PORT}")
        self._heard: dict[str, tuple[float, dict[str, float]]] = {}  # when, s; steady clock
        self._stamp = math.nan
        self._frame: Callable[[float, dict[str, float]], Any]
        self._history: deque[Any] = deque(maxlen=KEPT)
        try:
            self._server = start_server(port)
        except InputError as error:
            raise ParameterError(f"view_node: {error}") from None
        from emir_analysis.view import robot, subject
        from emir_analysis.view.page import Page, Subject

        machine: Subject
        if self.model == JOINT1:
            machine = joint = subject.subject_of_joint1()
            self._frame = lambda time, signals: frame(time, signals, joint.reach)
        else:
            machine = subject.robot_subject()
            self._frame = robot.robot_frame
        for topic in SHOWN if self.model == JOINT1 else robot.TOPICS:
            self._listen(topic)
        self._page = Page(self._server, machine, "EMIR, live")
        self.start_steady_timer(PERIOD, self._show)
        self.get_logger().info(f"http://localhost:{port} shows the graph")

    @property
    def shown(self) -> str:
        """Return the numbers on the page, as Markdown."""
        return self._page.readings

    def close(self) -> None:
        """Close the page."""
        self._server.stop()

    def _listen(self, topic: Topic) -> None:
        def receive(message: Any) -> None:
            if not self.active:
                return
            try:
                values = conversions.values(topic, message)
            except LookupError as error:
                self.malformed(topic.name, error)
                return
            self._heard[topic.name] = time.monotonic(), values
            self._stamp = conversions.stamp_ns(message) / conversions.NANOSECONDS

        kind = conversions.message_class(topic.type)
        profile = qos.requested(topic, lockstep=False)
        self.create_subscription(kind, topic.name, receive, profile)

    @property
    def note(self) -> str:
        """Return what the page says besides: that nothing comes."""
        return self._page.note

    def _last_heard(self) -> float:
        """Return when the last message came, s of the steady clock; -inf: none did."""
        return max((when for when, _ in self._heard.values()), default=-math.inf)

    def _signals(self) -> dict[str, float]:
        """Return the numbers of the topics that are still published."""
        since = self._last_heard() - SILENT
        groups = [values for when, values in self._heard.values() if when >= since]
        return {name: value for group in groups for name, value in group.items()}

    def _show(self) -> None:
        silent = time.monotonic() - self._last_heard()
        self._page.say(_silence(silent) if silent > NOTHING else "")
        if self._history and self._stamp < self._history[-1].time - SILENT:
            self._history.clear()  # another run has begun
        if math.isnan(self._stamp) or (self._history and self._stamp <= self._history[-1].time):
            return  # nothing new
        self._history.append(self._frame(self._stamp, self._signals()))
        self._page.show(self._history[-1])
        if len(self._history) > 1:
            self._page.plot(list(self._history), self._stamp)


def _silence(seconds: float) -> str:
    """Return what is said when nothing has come for a while."""
    if math.isinf(seconds):
        return "**nothing heard yet**"
    return f"**nothing heard for {seconds:.0f} s**; the last is shown"


def frame(time: float, signals: dict[str, float], length: float) -> Frame:
    """Return what is known at a time, s, from the latest signals; length: of the boom, m."""
    known = {name: signals.get(name, math.nan) for name in Frame._fields}
    bent = float(tcp_deflection(signals.get("deflection", math.nan), length))
    return Frame(**(known | {"time": time, "tcp_deflection": signals.get("tcp_deflection", bent)}))


def main() -> None:
    """Show the graph until stopped."""
    run(ViewNode)


if __name__ == "__main__":
    main()

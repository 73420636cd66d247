"""What a node says about itself on /diagnostics, where ROS's tools look for it, and in its log."""

from enum import IntEnum

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node

REPEAT = 1.0  # s, after which the last word is said again: whoever came late hears it


class Level(IntEnum):
    """How bad it is, as DiagnosticStatus has it."""

    OK = 0
    WARN = 1
    ERROR = 2


class Diagnostics:
    """The one status of a node: said when it changes, and in real time again every second."""

    def __init__(self, node: Node, *, repeat: bool) -> None:
        self._node = node
        self._said: tuple[Level, str] | None = None
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        if repeat:
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
        array = DiagnosticArray()
        array.header.stamp = self._node.get_clock().now().to_msg()
        name = self._node.get_fully_qualified_name()
        status = DiagnosticStatus(level=bytes([level]), name=name, message=message)
        array.status.append(status)
        self._publisher.publish(array)

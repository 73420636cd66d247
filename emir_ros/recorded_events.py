"""What the recorder keeps beside the signals: /diagnostics and the nodes' orders.

They come when they come, so nothing waits for them. In lock step a status is written a second of
the run later, in the order of stamps and names: recordings of the same run are then the same.
"""

import json
from collections.abc import Collection
from types import SimpleNamespace
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.serialization import deserialize_message

from emir_analysis.rosbag2_writer import Rosbag2Writer, channel_metadata
from emir_msgs_py.topics import DIAGNOSTICS, ORDERS
from emir_ros import qos
from emir_ros.message_definitions import schema, type_hash
from emir_ros.shell import Shell
from emir_ros.wire import as_cdr, stamp_ns

TYPE = "diagnostic_msgs/msg/DiagnosticArray"


class RecordedEvents:
    """Two topics of a recording.

    nodes: full names of those whose status is recorded; none: everybody's. Subscribed to before
    the signals are, so that what a node said first is not discovered after what it said later.
    """

    def __init__(self, node: Shell, writer: Rosbag2Writer, nodes: Collection[str]) -> None:
        self._node, self._writer, self._nodes = node, writer, nodes
        self._waiting: list[tuple[int, bytes]] = []  # lock step: stamp, status
        self._orders = node.resolve_topic_name(ORDERS)
        self._begin = node.now_ns()  # what was ordered before is told once more
        profile = qos.offered(lockstep=node.lockstep)
        node.create_subscription(DiagnosticArray, DIAGNOSTICS, self._on_status, profile, raw=True)
        node.create_subscription(
            DiagnosticArray, ORDERS, self._on_order, qos.offered(lockstep=True), raw=True
        )

    def write_until(self, stamp: int) -> None:
        """Write the statuses of lock step up to a stamp, ns."""
        due = sorted(entry for entry in self._waiting if entry[0] <= stamp)
        self._waiting = [entry for entry in self._waiting if entry[0] > stamp]
        for at, data in due:
            self._record(DIAGNOSTICS, data, at, at)

    def write_all(self) -> None:
        """Write what is left of them."""
        self.write_until(max((stamp for stamp, _ in self._waiting), default=0))

    def _on_order(self, data: bytes) -> None:
        stamp = stamp_ns(data)
        if self._node.lockstep or stamp >= self._begin:
            self._record(self._orders, data, self._log_time(stamp), stamp)

    def _on_status(self, data: bytes) -> None:
        message: Any = deserialize_message(data, DiagnosticArray)
        if self._nodes and not any(status.name in self._nodes for status in message.status):
            return  # of another machine in this domain
        stamp = stamp_ns(data)
        if self._node.lockstep:
            self._waiting.append((stamp, as_cdr(TYPE, _plain(message))))  # the same every time
        else:
            self._record(DIAGNOSTICS, data, self._log_time(stamp), stamp)

    def _log_time(self, stamp: int) -> int:
        return stamp if self._node.lockstep else self._node.get_clock().now().nanoseconds

    def _record(self, topic: str, data: bytes, log_time: int, publish_time: int) -> None:
        if topic not in self._writer.topics:
            profile = qos.offered(lockstep=self._node.lockstep)
            about = channel_metadata([qos.as_rosbag2(profile)], type_hash(TYPE))
            self._writer.add_topic(topic, schema(TYPE), about | {"fields": json.dumps({})})
        self._writer.write(topic, data, log_time, publish_time)


def _plain(message: Any) -> Any:
    """Return the message with its levels as numbers, which the serializer wants."""
    statuses = [
        SimpleNamespace(
            level=status.level[0],
            name=status.name,
            message=status.message,
            hardware_id=status.hardware_id,
            values=status.values,
        )
        for status in message.status
    ]
    return SimpleNamespace(header=message.header, status=statuses)

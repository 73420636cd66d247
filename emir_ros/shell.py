"""What every node of the graph shares: parameters, inputs with their age, the two ways of time.

Real time: a timer starts each control period, which takes the latest inputs. Lock step: a
control period starts when all inputs with the stamp of that period are there, so the graph
runs as fast as it can and the result does not depend on how fast that is.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rclpy.duration import Duration
from rclpy.node import Node

from emir_msgs_py import conversions
from emir_msgs_py.topics import CONTROL_PERIOD_NS, Topic
from emir_ros import qos
from emir_ros.node_parameters import declare
from emir_ros.wire import Wire, stamp_ns

if TYPE_CHECKING:
    from rclpy.time import Time

Signals = dict[str, float]


class NodeError(RuntimeError):
    """A node cannot go on; the message is one line."""


class Shell(Node):
    """A node with the graph's common parameter `lockstep` and its publishers.

    arguments: ROS arguments of this node alone, beside those of the process.
    """

    def __init__(
        self, name: str, outputs: Sequence[Topic], arguments: Sequence[str] | None = None
    ) -> None:
        super().__init__(name, cli_args=None if arguments is None else list(arguments))
        self.done = False
        self.lockstep: bool = declare(self, "lockstep", False, "step on stamps, not on a timer")
        self._outputs = {
            topic.name: (topic, Wire(topic), self._publisher(topic.type, topic.name))
            for topic in outputs
        }

    def _publisher(self, type_name: str, name: str) -> Any:
        kind = conversions.message_class(type_name)
        return self.create_publisher(kind, name, qos.offered(lockstep=self.lockstep))

    def publish(self, topic: Topic, stamp: int, signals: Mapping[str, float]) -> None:
        """Publish a topic's signals, stamped in ns."""
        _, wire, publisher = self._outputs[topic.name]
        publisher.publish(wire.encode(stamp, signals))

    def close(self) -> None:
        """Bring to an end what must not be left half done."""


class ControlNode(Shell):
    """A node that turns the signals of its inputs into the signals of its outputs.

    A subclass implements `control`; `stale` says what to do without fresh inputs.
    """

    def __init__(
        self,
        name: str,
        inputs: Sequence[Topic],
        outputs: Sequence[Topic],
        arguments: Sequence[str] | None = None,
    ) -> None:
        super().__init__(name, outputs, arguments)
        self._inputs = {topic.name: topic for topic in inputs}
        self._timeout = Duration(
            seconds=declare(self, "input_timeout", 0.1, "an older input is stale [s], real time")
        )
        self._latest: dict[str, tuple[Time, Signals]] = {}
        self._pending: dict[int, dict[str, Signals]] = {}
        for topic in inputs:
            self._subscribe(topic)
        if not self.lockstep:
            self.create_timer(CONTROL_PERIOD_NS * 1e-9, self._on_timer)

    def control(self, signals: Signals, dt: float) -> Signals:
        """Return the output signals of one control period of dt, s."""
        raise NotImplementedError

    def stale(self, missing: Sequence[str]) -> Signals | None:
        """Return what to publish while inputs are missing or too old; None: nothing."""
        return None

    def _subscribe(self, topic: Topic) -> None:
        wire = Wire(topic)

        def receive(data: bytes) -> None:
            if not self.lockstep:
                self._latest[topic.name] = (self.get_clock().now(), wire.decode(data))
            elif stamp_ns(data) % CONTROL_PERIOD_NS == 0:
                self._on_stamp(topic, stamp_ns(data), wire.decode(data))

        kind = conversions.message_class(topic.type)
        profile = qos.requested(topic, lockstep=self.lockstep)
        self.create_subscription(kind, topic.name, receive, profile, raw=True)

    def _on_stamp(self, topic: Topic, stamp: int, signals: Signals) -> None:
        complete = self._pending.setdefault(stamp, {})
        complete[topic.name] = signals
        if len(complete) == len(self._inputs):
            self._pending = {s: rest for s, rest in self._pending.items() if s > stamp}
            self._run(stamp, complete.values())

    def _on_timer(self) -> None:
        now = self.get_clock().now()
        missing = [
            name
            for name in self._inputs
            if name not in self._latest or now - self._latest[name][0] > self._timeout
        ]
        if not missing:
            self._run(now.nanoseconds, [signals for _, signals in self._latest.values()])
            return
        self.get_logger().warning(
            f"no fresh {', '.join(missing)}", throttle_duration_sec=2.0, skip_first=True
        )
        instead = self.stale(missing)
        if instead is not None:
            self._publish_all(now.nanoseconds, instead)

    def _run(self, stamp: int, inputs: Any) -> None:
        signals = {name: value for group in inputs for name, value in group.items()}
        self._publish_all(stamp, self.control(signals, CONTROL_PERIOD_NS * 1e-9))

    def _publish_all(self, stamp: int, signals: Signals) -> None:
        for topic, _, _ in self._outputs.values():
            self.publish(topic, stamp, signals)

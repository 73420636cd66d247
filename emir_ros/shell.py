"""What every node of the graph shares: parameters, inputs with their age, the two ways of time.

Real time: a timer starts each control period, which takes the latest inputs. Lock step: a
control period starts when all inputs with the stamp of that period are there, so the graph
runs as fast as it can and the result does not depend on how fast that is.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rclpy.duration import Duration
from rclpy.node import Node

from emir_analysis.node_controls import NodeControl
from emir_common.quantity import ParameterError
from emir_msgs_py import conversions
from emir_msgs_py.topics import CONTROL_PERIOD_NS, JOINT1, PLANT_PERIOD_NS, ROBOT, Topic
from emir_ros import qos
from emir_ros.node_parameters import declare

if TYPE_CHECKING:
    from rclpy.time import Time

Signals = dict[str, float]


class NodeError(RuntimeError):
    """A node cannot go on; the message is one line."""


class Shell(Node):
    """A node with the graph's common parameters `lockstep` and `model`, and its publishers.

    outputs: of joint 1's model. robot: those of the whole robot's, where the node knows that.
    arguments: ROS arguments of this node alone, beside those of the process. Raises
    ParameterError for a model that the node does not know.
    """

    def __init__(
        self,
        name: str,
        outputs: Sequence[Topic],
        arguments: Sequence[str] | None = None,
        robot: Sequence[Topic] | None = None,
    ) -> None:
        super().__init__(name, cli_args=None if arguments is None else list(arguments))
        self.done = False
        self.lockstep: bool = declare(self, "lockstep", False, "step on stamps, not on a timer")
        known = {JOINT1: outputs} | ({} if robot is None else {ROBOT: robot})
        self.model: str = declare(self, "model", JOINT1, f"{JOINT1}, or {ROBOT}: the whole robot")
        if self.model not in known:
            raise ParameterError(f"{name}: model {self.model!r}: there is {', '.join(known)}")
        self._outputs = {
            topic.name: (topic, self._publisher(topic.type, topic.name))
            for topic in known[self.model]
        }

    def _publisher(self, type_name: str, name: str) -> Any:
        kind = conversions.message_class(type_name)
        return self.create_publisher(kind, name, qos.offered(lockstep=self.lockstep))

    def publish(self, topic: Topic, stamp: int, signals: Mapping[str, float]) -> None:
        """Publish a topic's signals, stamped in ns."""
        publisher = self._outputs[topic.name][1]
        publisher.publish(conversions.message(topic, stamp, signals))

    def close(self) -> None:
        """Bring to an end what must not be left half done."""


class ControlNode(Shell):
    """A node that turns the signals of its inputs into the signals of its outputs.

    A subclass implements `control`; `stale` says what to do without fresh inputs. It acts as
    often as its first output is to come. robot: whose inputs and outputs it has when the model
    is the whole robot.
    """

    def __init__(
        self,
        name: str,
        inputs: Sequence[Topic],
        outputs: Sequence[Topic],
        arguments: Sequence[str] | None = None,
        robot: type[NodeControl] | None = None,
    ) -> None:
        super().__init__(name, outputs, arguments, None if robot is None else robot.outputs)
        if robot is not None and self.model == ROBOT:
            inputs, outputs = robot.inputs, robot.outputs
        fast = outputs[0].every == "plant"
        self._period = PLANT_PERIOD_NS if fast else CONTROL_PERIOD_NS
        self._inputs = {topic.name: topic for topic in inputs}
        self._held: dict[str, Signals] = {}  # what comes less often than this node acts
        self._timeout = Duration(
            seconds=declare(self, "input_timeout", 0.1, "an older input is stale [s], real time")
        )
        self._latest: dict[str, tuple[Time, Signals]] = {}
        self._pending: dict[int, dict[str, Signals]] = {}
        for topic in inputs:
            self._subscribe(topic)
        if not self.lockstep:
            self.create_timer(self._period * 1e-9, self._on_timer)

    def control(self, signals: Signals, dt: float) -> Signals:
        """Return the output signals of one control period of dt, s."""
        raise NotImplementedError

    def stale(self, missing: Sequence[str]) -> Signals | None:
        """Return what to publish while inputs are missing or too old; None: nothing."""
        return None

    def _subscribe(self, topic: Topic) -> None:
        def receive(message: Any) -> None:
            if self.lockstep:
                self._on_stamp(topic, message)
            else:
                signals = conversions.values(topic, message)
                self._latest[topic.name] = (self.get_clock().now(), signals)

        kind = conversions.message_class(topic.type)
        profile = qos.requested(topic, lockstep=self.lockstep)
        self.create_subscription(kind, topic.name, receive, profile)

    def _on_stamp(self, topic: Topic, message: Any) -> None:
        stamp = conversions.stamp_ns(message)
        if stamp % self._period:
            return
        complete = self._pending.setdefault(stamp, {})
        complete[topic.name] = conversions.values(topic, message)
        if len(complete) == self._expected(stamp):
            self._pending = {s: rest for s, rest in self._pending.items() if s > stamp}
            self._held |= complete
            self._run(stamp, self._held.values())

    def _expected(self, stamp: int) -> int:
        """Return how many of the inputs have messages of that stamp."""
        controlled = stamp % CONTROL_PERIOD_NS == 0
        return sum(controlled or topic.every == "plant" for topic in self._inputs.values())

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
        self._publish_all(stamp, self.control(signals, self._period * 1e-9))

    def _publish_all(self, stamp: int, signals: Signals) -> None:
        for topic, _ in self._outputs.values():
            self.publish(topic, stamp, signals)

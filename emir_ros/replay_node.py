"""replay_node: a recording into a live graph, with /clock, pausable, at any speed.

Messages are published as they were recorded (CDR), with the QoS that was offered then, and under
their recorded names, below the node's own namespace. Beginning and end are the recording's.
"""

import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from mcap.records import Channel, Schema
from rclpy.duration import Duration
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock as ClockMessage
from std_srvs.srv import SetBool

from emir_analysis import bags
from emir_analysis.errors import InputError
from emir_common.parameter_tree import with_values
from emir_common.quantity import ParameterError, quantity
from emir_msgs_py import conversions
from emir_ros import qos
from emir_ros.live_parameters import refused_by
from emir_ros.main import run
from emir_ros.node_parameters import declare, declare_tree, reject_unknown
from emir_ros.shell import NodeError, Shell

CLOCK = "/clock"
PERIOD = 0.004  # s, of the computer's clock: half a period of the sensors
BURST = qos.DEPTH // 2  # messages of a topic at once: a reader's queue holds twice that
PATIENCE = Duration(seconds=2.0)  # for the last messages to be received


@dataclass(frozen=True, kw_only=True)
class Pace:
    """How fast a recording is replayed."""

    rate: float = quantity(
        "1", 0.01, 1000.0, "speed against the recorded one; may be set at any time", default=1.0
    )


class Recorded(NamedTuple):
    """A message as it stands in the file; time in ns."""

    topic: str
    time: int
    data: bytes


class ReplayNode(Shell):
    """A recording -> its topics, /clock. Service ~/pause (std_srvs/SetBool); parameter `rate`."""

    def __init__(self, arguments: Sequence[str] | None = None) -> None:
        super().__init__("replay_node", [], arguments, [])
        bag: str = declare(self, "bag", "", "recording to replay: a folder or an .mcap file")
        chosen: list[str] = declare(self, "topics", [""], "full names to replay; empty: all")
        self._paused: bool = declare(self, "start_paused", False, "wait for ~/pause false")
        declare_tree(self, Pace(), live=["rate"])
        self.add_on_set_parameters_callback(refused_by(_check_pace))
        reject_unknown(self)
        if not bag:
            raise ParameterError("replay_node: bag: the recording to replay is missing")
        self._by_topic: dict[str, Any] = {}
        self._messages = self._open(Path(bag), {name for name in chosen if name})
        try:
            self._next = next(self._messages, None)
        except InputError as error:
            raise ParameterError(f"replay_node: {error}") from None
        if self._next is None:
            raise ParameterError(f"replay_node: {bag}: no message of these topics")
        self._position = float(self._next.time)  # ns, in the recording's time
        self._clock_publisher = self.create_publisher(ClockMessage, CLOCK, 10)
        self.create_service(SetBool, "~/pause", self._on_pause)
        self._looked = time.monotonic()
        self.start_steady_timer(PERIOD, self._on_timer)  # else it would wait for its own /clock

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Go on from where the recording was left: its time has stood still."""
        self._looked = time.monotonic()
        return super().on_activate(state)

    def close(self) -> None:
        """Wait until what was published last has been received."""
        for publisher in self._by_topic.values():
            publisher.wait_for_all_acked(PATIENCE)

    def _open(self, bag: Path, chosen: set[str]) -> Iterator[Recorded]:
        try:
            there = bags.recorded_topics(bag)
        except InputError as error:
            raise ParameterError(f"replay_node: {error}") from None
        for name in chosen - there:
            raise ParameterError(
                f"replay_node: {bag}: topic {name} is not recorded; there are: "
                + ", ".join(sorted(there))
            )
        return self._recorded(bag, chosen or there - {CLOCK})

    def _recorded(self, bag: Path, chosen: set[str]) -> Iterator[Recorded]:
        """Yield the messages in their order, announcing each topic when it is first met."""
        for file in bags.files(bag):
            schemas: dict[int, Schema] = {}
            channels: dict[int, str] = {}
            for record in bags.records(file):
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel) and record.topic in chosen:
                    channels[record.id] = record.topic
                    self._announce(record, schemas[record.schema_id].name)
                elif isinstance(record, bags.Raw) and record.channel_id in channels:
                    yield Recorded(channels[record.channel_id], record.log_time, record.data)

    def _announce(self, channel: Channel, type_name: str) -> None:
        if channel.topic in self._by_topic:
            return
        try:
            kind = conversions.message_class(type_name)
        except (ImportError, AttributeError):
            raise NodeError(
                f"replay_node: topic {channel.topic}: type {type_name} is not installed"
            ) from None
        profile = qos.recorded(channel.metadata.get("offered_qos_profiles", ""))
        name = channel.topic.removeprefix("/")
        self._by_topic[channel.topic] = self.create_publisher(kind, name, profile)

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._paused = request.data
        response.success = True
        state = "paused" if self._paused else "running"
        response.message = f"{state} at {self._position * 1e-9:.3f} s"
        return response

    def _on_timer(self) -> None:
        if not self.active:
            return
        now = time.monotonic()
        if not self._paused:
            rate: float = self.get_parameter("rate").value
            self._position += (now - self._looked) * rate * conversions.NANOSECONDS
        self._looked = now
        try:
            self._publish_what_is_due()
        except InputError as error:
            raise NodeError(f"replay_node: {error}") from None
        clock = ClockMessage()
        clock.clock.sec, clock.clock.nanosec = divmod(int(self._position), conversions.NANOSECONDS)
        self._clock_publisher.publish(clock)

    def _publish_what_is_due(self) -> None:
        sent: Counter[str] = Counter()
        while self._next is not None and self._next.time <= self._position:
            if sent[self._next.topic] == BURST:
                break  # the rest when the readers have had a chance
            sent[self._next.topic] += 1
            self._by_topic[self._next.topic].publish(self._next.data)
            self._next = next(self._messages, None)
        if self._next is None:
            self.end()


def _check_pace(parameters: list[Parameter]) -> None:
    """Raise ParameterError for a speed out of range; rclpy looks at floats alone, not integers."""
    with_values(Pace(), {p.name: p.value for p in parameters if p.name == "rate"})


def main() -> None:
    """Replay until the recording's end or until stopped."""
    run(ReplayNode)


if __name__ == "__main__":
    main()

"""recorder_node: the graph's topics to an MCAP file that rosbag2's tools take.

Messages are stored as they came (CDR). In lock step they are stored in the order of stamps and
of the topic table, with the stamp as time, so that two runs give the same recording; each
finished control period is reported, and the plant waits for that, so that nothing is lost.
What was recorded is handed to the operating system every second (of the run in lock step, of the
clock otherwise), so a recorder that is killed outright loses no more than that.
"""

import json
import math
from collections import defaultdict
from collections.abc import Callable, Sequence
from pathlib import Path

from rclpy.validate_node_name import validate_node_name
from std_msgs.msg import Header

from emir_analysis.rosbag2_writer import (
    COMPRESSIONS,
    Rosbag2Writer,
    channel_metadata,
)
from emir_common.quantity import ParameterError
from emir_msgs_py import conversions
from emir_msgs_py.meanings import field_table
from emir_msgs_py.robot_topics import ROBOT_TOPICS
from emir_msgs_py.topics import (
    CONTROL_PERIOD_NS,
    PLANT_PERIOD_NS,
    RECORDED,
    ROBOT,
    TOPICS,
    Topic,
    by_name,
)
from emir_ros import qos
from emir_ros.main import run
from emir_ros.message_definitions import schema, type_hash
from emir_ros.node_parameters import declare, naming, reject_unknown
from emir_ros.recorded_events import RecordedEvents
from emir_ros.recorded_setup import RecordedSetup
from emir_ros.shell import NodeError, Shell
from emir_ros.wire import header_message, sender, stamp_ns

QUEUE = 10_000  # messages of a topic that may wait here while the file system keeps us waiting
FLUSH_PERIOD_NS = conversions.NANOSECONDS
MEGABYTE = 1_000_000


def _description(text: str) -> dict[str, str]:
    """Return the texts by key that a JSON holds; raises ParameterError for anything else."""
    try:
        found = json.loads(text)
    except ValueError:
        found = None
    if not isinstance(found, dict) or not all(isinstance(value, str) for value in found.values()):
        raise ParameterError(f"recorder_node: description = {text!r}: not JSON of texts by key")
    return found


class RecorderNode(Shell):
    """Every topic of the table (or those named) -> recording, recorder/recorded."""

    hears_everybody = True

    def __init__(self, arguments: Sequence[str] | None = None) -> None:
        super().__init__("recorder_node", [], arguments, [])
        self._table = ROBOT_TOPICS if self.model == ROBOT else TOPICS
        everything = [topic.name for topic in self._table]
        folder: str = declare(self, "bag", "", "folder of the recording, must not exist")
        names: list[str] = declare(self, "topics", everything, "topics to record")
        about: str = declare(self, "description", "{}", "JSON: texts by key, kept in the file")
        given: list[str] = declare(self, "nodes", [""], "nodes whose parameters are recorded")
        metadata = _description(about)
        nodes = {name: self._full_name(name) for name in given if name}
        writer = self._make_writer(folder)
        reject_unknown(self)
        self._topics = [_known(name, self._table) for name in names]
        self._plant_topics = [topic for topic in self._topics if topic.every == "plant"]
        self._full_names = {name: self.resolve_topic_name(name) for name in names}
        with naming(self):
            self._writer = writer()
        self._writer.add_metadata("emir", metadata)
        ack = self.create_publisher(Header, RECORDED, qos.offered(lockstep=self.lockstep))
        self._acknowledge = sender(ack)
        self._events = RecordedEvents(self, self._writer, nodes.values())
        self._pending: defaultdict[int, dict[str, bytes]] = defaultdict(dict)  # by stamp, full name
        self._next = 0
        for topic in self._topics:
            self._record(topic)
        self._setup = RecordedSetup(
            self, self._writer, nodes, self._time, self._write_complete_stamps
        )
        if not self.lockstep:
            self.create_timer(FLUSH_PERIOD_NS * 1e-9, self._writer.flush)

    def _full_name(self, node: str) -> str:
        validate_node_name(node)
        return f"{self.get_namespace().rstrip('/')}/{node}"

    def _make_writer(self, folder: str) -> Callable[[], Rosbag2Writer]:
        """Declare what the file shall be like."""
        kinds = ", ".join(COMPRESSIONS)
        compression: str = declare(self, "compression", "none", f"of the file's chunks: {kinds}")
        size: float = declare(self, "max_size", 0.0, "a new file from here on [MB]; 0: one file")
        duration: float = declare(self, "max_duration", 0.0, "the same by time [s]; 0: one file")
        for name, value in (("max_size", size), ("max_duration", duration)):
            if not 0.0 <= value < math.inf:
                raise ParameterError(f"recorder_node: {name} = {value:g}: has to be 0 or more")
        if not folder:
            raise ParameterError("recorder_node: bag: the folder of the recording is missing")
        return lambda: Rosbag2Writer(
            Path(folder),
            compression,
            max_size=size * MEGABYTE or math.inf,
            max_duration=duration or math.inf,
            failure=lambda said: NodeError(f"recorder_node: {said}"),
        )

    @property
    def writer(self) -> Rosbag2Writer:
        """Return the recording so far."""
        return self._writer

    @property
    def answered(self) -> list[str]:
        """Return the nodes that have told their parameters."""
        return self._setup.answered

    @property
    def changes(self) -> int:
        """Return how many settings of parameters were recorded."""
        return self._setup.changes

    def close(self) -> None:
        """Write what is left and finish the file."""
        if self._writer.closed:
            return
        if not self.heard and not self.lockstep:  # `emir run` says itself why
            first, *others = self._full_names.values()
            count = f" and {len(others)} others" if others else ""
            self.get_logger().warning(f"nothing is recorded: no message came of {first}{count}")
        lacking = self._setup.finish()
        if lacking and not self.lockstep:  # `emir run` says itself why
            self.get_logger().warning(lacking)
        for stamp in sorted(self._pending):
            self._write_stamp(stamp)
        self._events.write_all()
        self._writer.close()

    def _record(self, topic: Topic) -> None:
        full_name = self._full_names[topic.name]
        profile = qos.offered(lockstep=self.lockstep)
        about = channel_metadata([qos.as_rosbag2(profile)], type_hash(topic.type))
        about |= {"publisher": topic.publisher, "fields": json.dumps(field_table(topic))}
        self._writer.add_topic(full_name, schema(topic.type), about)

        def receive_by_stamp(data: bytes) -> None:
            stamp = stamp_ns(data)
            messages = self._pending[stamp]
            messages[full_name] = data
            if len(messages) == self._expected(stamp):
                self._write_complete_stamps()

        def receive_by_clock(data: bytes) -> None:
            self.heard += 1
            self._writer.write(full_name, data, self.now_ns(), stamp_ns(data))

        profile.depth = QUEUE
        self.hear(topic, receive_by_stamp if self.lockstep else receive_by_clock, profile)

    def _time(self) -> int:
        """Return the recording's own time, ns."""
        return self._next if self.lockstep else self.now_ns()

    def _write_complete_stamps(self) -> None:
        """Write the stamps that are whole; none before the setup: all recordings are the same."""
        while self._setup.complete and len(self._pending[self._next]) == self._expected(self._next):
            whole_second = self._next % FLUSH_PERIOD_NS == 0
            if whole_second:  # before what may begin a new file
                self._events.write_until(self._next - FLUSH_PERIOD_NS)
            self._write_stamp(self._next)
            if whole_second:
                self._writer.flush()
            if self._next % CONTROL_PERIOD_NS == 0:
                self._acknowledge(header_message(self._next))
            self._next += PLANT_PERIOD_NS

    def _expected(self, stamp: int) -> int:
        """Return how many topics have messages of that stamp."""
        return len(self._topics if stamp % CONTROL_PERIOD_NS == 0 else self._plant_topics)

    def _write_stamp(self, stamp: int) -> None:
        messages = self._pending.pop(stamp)
        for name in self._full_names.values():
            if name in messages:
                self._writer.write(name, messages[name], stamp, stamp)


def _known(name: str, table: tuple[Topic, ...]) -> Topic:
    try:
        return by_name(name, table)
    except KeyError:
        raise ParameterError(f"recorder_node: topics: {name!r} is not a topic of EMIR") from None


def main() -> None:
    """Record until stopped."""
    run(RecorderNode)


if __name__ == "__main__":
    main()

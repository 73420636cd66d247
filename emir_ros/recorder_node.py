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
from typing import Any

from mcap.records import Attachment
from rcl_interfaces.msg import ParameterEvent
from rclpy.parameter import parameter_value_to_python
from rclpy.validate_node_name import validate_node_name
from std_msgs.msg import Header, String

from emir_analysis import parameter_files
from emir_analysis.info import CHANGE, MACHINE, PARAMETERS, Change
from emir_analysis.machine_record import PLANT, machine_record
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
from emir_ros.diagnostics import Level
from emir_ros.main import run
from emir_ros.message_definitions import schema, type_hash
from emir_ros.node_parameters import declare, naming, reject_unknown
from emir_ros.parameter_record import ParameterRecord, as_metadata
from emir_ros.picture import DESCRIPTION
from emir_ros.recorded_events import RecordedEvents
from emir_ros.shell import NodeError, Shell
from emir_ros.wire import header_message, sender, stamp_ns

EVENTS = 1000  # depth, as ROS has it for parameter events
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
        nodes: list[str] = declare(self, "nodes", [""], "nodes whose parameters are recorded")
        metadata = _description(about)
        for node in filter(None, nodes):
            validate_node_name(node)
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
        self.changes = 0  # of parameters, recorded
        self._nodes = [f"{self.get_namespace().rstrip('/')}/{name}" for name in nodes if name]
        self._events = RecordedEvents(self, self._writer, self._nodes)
        self._pending: defaultdict[int, dict[str, bytes]] = defaultdict(dict)  # by stamp, full name
        self._next = 0
        for topic in self._topics:
            self._record(topic)
        self._described = not any(nodes)
        self._answers: dict[str, dict[str, Any]] = {}
        self._urdf: str | None = None if PLANT in nodes else ""  # None: still to come
        if not self._described:
            ParameterRecord(self, nodes, self._on_answers)
        self.create_subscription(String, DESCRIPTION, self._on_urdf, qos.latched())
        self.create_subscription(ParameterEvent, "/parameter_events", self._on_change, EVENTS)
        if not self.lockstep:
            self.create_timer(FLUSH_PERIOD_NS * 1e-9, self._writer.flush)

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

    def close(self) -> None:
        """Write what is left and finish the file."""
        if self._writer.closed:
            return
        if not self.heard and not self.lockstep:  # `emir run` says itself why
            first, *others = self._full_names.values()
            count = f" and {len(others)} others" if others else ""
            self.get_logger().warning(f"nothing is recorded: no message came of {first}{count}")
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

    def _write_complete_stamps(self) -> None:
        while self._described and len(self._pending[self._next]) == self._expected(self._next):
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

    def _on_answers(self, answers: dict[str, dict[str, Any]]) -> None:
        self._answers = answers
        self._describe()

    def _on_urdf(self, message: String) -> None:
        first, self._urdf = not self._urdf, message.data
        if first and self._described:
            self._attach_urdf()
        elif first:
            self._describe()

    def _describe(self) -> None:
        """Store parameters and robot description once both have come.

        In lock step nothing is written before, so that every recording is the same.
        """
        if not self._answers or self._urdf is None:
            return
        self._writer.add_metadata(PARAMETERS, as_metadata(self._answers))
        machine = machine_record(self._answers.get(PLANT, {}))
        if machine:
            self._writer.add_metadata(MACHINE, machine)
        for name, values in self._answers.items():
            self._attach_files(name, values)
        if self._urdf:
            self._attach_urdf()
        self._described = True
        self._write_complete_stamps()

    def _attach_files(self, node: str, values: dict[str, Any]) -> None:
        try:
            for attachment in parameter_files.attachments(node, values):
                self._writer.add_attachment(attachment)
        except ParameterError as error:
            self.diagnostics.say(Level.WARN, f"not in the recording: {error}")

    def _attach_urdf(self) -> None:
        data = (self._urdf or "").encode()
        self._writer.add_attachment(Attachment(0, 0, f"{DESCRIPTION}.urdf", "text/xml", data))

    def _on_change(self, event: ParameterEvent) -> None:
        """Store what was set at a node while it runs, with the recording's own time."""
        if self._nodes and event.node not in self._nodes:
            return
        time = self._next if self.lockstep else self.now_ns()
        for parameter in event.changed_parameters:
            value = parameter_value_to_python(parameter.value)
            change = Change(time, event.node, parameter.name, json.dumps(value, default=list))
            self._writer.add_metadata(f"{CHANGE}.{self.changes}", change.as_metadata())
            self.changes += 1


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

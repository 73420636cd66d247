"""What the recorder keeps of the run itself: parameters, what was set later, the robot."""

import json
from collections.abc import Callable, Mapping
from typing import Any

from mcap.records import Attachment
from rcl_interfaces.msg import ParameterEvent
from rclpy.parameter import parameter_value_to_python
from std_msgs.msg import String

from emir_analysis import parameter_files
from emir_analysis.info import CHANGE, MACHINE, PARAMETERS, Change
from emir_analysis.machine_record import PLANT, machine_record
from emir_analysis.rosbag2_writer import Rosbag2Writer
from emir_common.quantity import ParameterError
from emir_ros import qos
from emir_ros.diagnostics import Level
from emir_ros.parameter_record import ParameterRecord, as_metadata
from emir_ros.picture import DESCRIPTION
from emir_ros.shell import Shell

EVENTS = 1000  # depth, as ROS has it for parameter events


class RecordedSetup:
    """Metadata and attachments of a recording.

    nodes: full names by name of those whose parameters are recorded; none: nobody's, but
    everybody's changes. time(): the recording's own, ns. on_complete() is called once parameters
    and robot description are stored, where there are nodes. changes: how many were recorded.
    """

    def __init__(
        self,
        node: Shell,
        writer: Rosbag2Writer,
        nodes: Mapping[str, str],
        time: Callable[[], int],
        on_complete: Callable[[], None],
    ) -> None:
        self._writer, self._time, self._on_complete = writer, time, on_complete
        self._diagnostics = node.diagnostics
        self._nodes = set(nodes.values())
        self.changes = 0
        self.complete = not nodes
        self._answers: dict[str, dict[str, Any]] = {}
        self._urdf: str | None = None if PLANT in nodes else ""  # None: still to come
        self._record = ParameterRecord(node, list(nodes), self._on_answers) if nodes else None
        node.create_subscription(String, DESCRIPTION, self._on_urdf, qos.latched())
        node.create_subscription(ParameterEvent, "/parameter_events", self._on_change, EVENTS)

    @property
    def answered(self) -> list[str]:
        """Return the nodes that have told their parameters."""
        return [] if self._record is None else list(self._record.answers)

    def finish(self) -> str:
        """Store what has come so far, at the end; return what has not, in words, or nothing."""
        if self.complete or self._record is None:
            return ""
        self._answers, self._urdf = self._record.answers, self._urdf or ""
        self._store_when_known()
        waiting = ", ".join(self._record.waiting)
        return f"without the parameters of {waiting}: no answer" if waiting else ""

    def _on_answers(self, answers: dict[str, dict[str, Any]]) -> None:
        self._answers = answers
        self._store_when_known()

    def _on_urdf(self, message: String) -> None:
        first, self._urdf = not self._urdf, message.data
        if first and self.complete:
            self._attach_urdf()
        elif first:
            self._store_when_known()

    def _store_when_known(self) -> None:
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
        self.complete = True
        self._on_complete()

    def _attach_files(self, node: str, values: dict[str, Any]) -> None:
        try:
            for attachment in parameter_files.attachments(node, values):
                self._writer.add_attachment(attachment)
        except ParameterError as error:
            self._diagnostics.say(Level.WARN, f"not in the recording: {error}")

    def _attach_urdf(self) -> None:
        data = (self._urdf or "").encode()
        self._writer.add_attachment(Attachment(0, 0, f"{DESCRIPTION}.urdf", "text/xml", data))

    def _on_change(self, event: ParameterEvent) -> None:
        """Store what was set at a node while it runs."""
        if self._nodes and event.node not in self._nodes:
            return
        time = self._time()
        for parameter in event.changed_parameters:
            value = parameter_value_to_python(parameter.value)
            change = Change(time, event.node, parameter.name, json.dumps(value, default=list))
            self._writer.add_metadata(f"{CHANGE}.{self.changes}", change.as_metadata())
            self.changes += 1

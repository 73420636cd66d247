"""A recording in rosbag2's own form: an MCAP file of CDR messages and metadata.yaml (version 9)."""

import shutil
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import yaml
from mcap.writer import CompressionType, Writer

from emir_common.quantity import ParameterError
from emir_common.version import software_version
from emir_ros.message_definitions import definition, type_hash

CHUNK = 64 * 1024  # bytes: what a recorder that is killed outright may lose


class _Plain(yaml.SafeDumper):
    """YAML without anchors, as rosbag2 writes it."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _yaml(content: Any) -> str:
    return yaml.dump(content, Dumper=_Plain, sort_keys=False)


@dataclass
class Channel:
    """A topic of the recording."""

    topic: str
    type: str
    qos: list[dict[str, Any]]
    id: int
    count: int = 0


class Rosbag2Writer:
    """Writes serialized messages as they came.

    The folder must not exist: a recording is never written over. Raises ParameterError then.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            raise ParameterError(f"{folder}: exists already, and is not overwritten") from None
        except OSError as error:
            raise ParameterError(f"{folder}: {error.strerror}") from None
        self._file = folder / f"{folder.name}_0.mcap"
        self._stream = self._file.open("wb")
        self._writer = Writer(self._stream, chunk_size=CHUNK, compression=CompressionType.NONE)
        self._writer.start(profile="ros2", library=f"emir {software_version()}")
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, Channel] = {}
        self._start: int | None = None
        self._end = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    @property
    def message_count(self) -> int:
        """Return how many messages were written."""
        return sum(channel.count for channel in self._channels.values())

    @property
    def duration_ns(self) -> int:
        """Return the time between first and last message, ns."""
        return 0 if self._start is None else self._end - self._start

    def add_topic(self, topic: str, type_name: str, qos: list[dict[str, Any]]) -> None:
        """Announce a topic by its full name, with the QoS that its publishers offer."""
        if type_name not in self._schemas:
            self._schemas[type_name] = self._writer.register_schema(
                name=type_name, encoding="ros2msg", data=definition(type_name).encode()
            )
        channel = self._writer.register_channel(
            topic=topic,
            message_encoding="cdr",
            schema_id=self._schemas[type_name],
            metadata={
                "offered_qos_profiles": _yaml(qos),
                "topic_type_hash": type_hash(type_name),
            },
        )
        self._channels[topic] = Channel(topic, type_name, qos, channel)

    def add_metadata(self, name: str, data: dict[str, str]) -> None:
        """Store a metadata record, texts by key, in the MCAP file."""
        self._writer.add_metadata(name, data)

    def write(self, topic: str, data: bytes, log_time: int, publish_time: int) -> None:
        """Store one message; times in ns."""
        channel = self._channels[topic]
        self._writer.add_message(channel.id, log_time, data, publish_time, channel.count)
        channel.count += 1
        self._start = log_time if self._start is None else min(self._start, log_time)
        self._end = max(self._end, log_time)

    def close(self) -> None:
        """Finish the file and write metadata.yaml; without a message, leave no folder behind.

        A second call does nothing.
        """
        if self._stream.closed:
            return
        text = _yaml(self._metadata())
        self._writer.add_metadata("rosbag2", {"serialized_metadata": text})
        self._writer.finish()
        self._stream.close()
        (self.folder / "metadata.yaml").write_text(text)
        if not self.message_count:
            shutil.rmtree(self.folder)

    def _metadata(self) -> dict[str, Any]:
        start = {"nanoseconds_since_epoch": self._start or 0}
        duration = {"nanoseconds": self.duration_ns}
        topics = [
            {
                "topic_metadata": {
                    "name": channel.topic,
                    "type": channel.type,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": channel.qos,
                    "type_description_hash": type_hash(channel.type),
                },
                "message_count": channel.count,
            }
            for channel in self._channels.values()
        ]
        return {
            "rosbag2_bagfile_information": {
                "version": 9,
                "storage_identifier": "mcap",
                "duration": duration,
                "starting_time": start,
                "message_count": self.message_count,
                "topics_with_message_count": topics,
                "compression_format": "",
                "compression_mode": "",
                "relative_file_paths": [self._file.name],
                "files": [
                    {
                        "path": self._file.name,
                        "starting_time": start,
                        "duration": duration,
                        "message_count": self.message_count,
                    }
                ],
                "custom_data": None,
                "ros_distro": "jazzy",
            }
        }

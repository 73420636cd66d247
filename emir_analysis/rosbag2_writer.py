"""A recording in rosbag2's own form: an MCAP file of CDR messages and metadata.yaml (version 9)."""

import shutil
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import yaml
from mcap.records import Attachment, Schema
from mcap.writer import CompressionType, Writer

from emir_common.quantity import ParameterError
from emir_common.version import software_version

CHUNK = 64 * 1024  # bytes: what a recorder that is killed outright may lose


class _Plain(yaml.SafeDumper):
    """YAML without anchors, as rosbag2 writes it."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _yaml(content: Any) -> str:
    return yaml.dump(content, Dumper=_Plain, sort_keys=False)


def channel_metadata(qos: list[dict[str, Any]], type_hash: str) -> dict[str, str]:
    """Return what rosbag2 stores with a channel: the QoS offered and the type's RIHS01 hash."""
    return {"offered_qos_profiles": _yaml(qos), "topic_type_hash": type_hash}


@dataclass
class Channel:
    """A topic of the recording."""

    topic: str
    type: str
    metadata: dict[str, str]  # of rosbag2: QoS as YAML, type hash
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
    def topics(self) -> set[str]:
        """Return the full names of the topics announced."""
        return set(self._channels)

    @property
    def message_count(self) -> int:
        """Return how many messages were written."""
        return sum(channel.count for channel in self._channels.values())

    @property
    def duration_ns(self) -> int:
        """Return the time between first and last message, ns."""
        return 0 if self._start is None else self._end - self._start

    def add_topic(self, topic: str, schema: Schema, metadata: dict[str, str]) -> None:
        """Announce a topic by its full name.

        schema: name, encoding and text of the type; its id is not used. metadata: as
        `channel_metadata` returns it, or as it stands in another recording.
        """
        if schema.name not in self._schemas:
            self._schemas[schema.name] = self._writer.register_schema(
                name=schema.name, encoding=schema.encoding, data=schema.data
            )
        channel = self._writer.register_channel(
            topic=topic,
            message_encoding="cdr",
            schema_id=self._schemas[schema.name],
            metadata=metadata,
        )
        self._channels[topic] = Channel(topic, schema.name, metadata, channel)

    def add_metadata(self, name: str, data: dict[str, str]) -> None:
        """Store a metadata record, texts by key, in the MCAP file."""
        self._writer.add_metadata(name, data)

    def add_attachment(self, a: Attachment) -> None:
        """Store an attachment in the MCAP file."""
        self._writer.add_attachment(a.create_time, a.log_time, a.name, a.media_type, a.data)

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
        self._writer.finish()  # type: ignore[no-untyped-call]  # mcap's, untyped
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
                    "offered_qos_profiles": _qos(channel),
                    "type_description_hash": channel.metadata.get("topic_type_hash", ""),
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


def _qos(channel: Channel) -> list[dict[str, Any]]:
    return yaml.safe_load(channel.metadata.get("offered_qos_profiles", "")) or []

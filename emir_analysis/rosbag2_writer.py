"""A recording in rosbag2's own form: MCAP files of CDR messages and metadata.yaml (version 9)."""

import math
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import yaml
from mcap.records import Attachment, Schema
from mcap.writer import CompressionType

from emir_analysis.errors import InputError
from emir_analysis.mcap_writer import MessageWriter
from emir_common.quantity import ParameterError
from emir_common.version import software_version

# bytes: what a recorder that is killed outright may lose between two flushes. Each chunk has its
# entry of 1.3 kB in the index that the writer holds until the file is finished.
CHUNK = 256 * 1024
COMPRESSIONS = {"none": CompressionType.NONE, "zstd": CompressionType.ZSTD}


class WriteError(InputError):
    """The recording cannot be written on; what was written is readable. One line."""


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
class Topic:
    """A topic of the recording. metadata: rosbag2's (QoS as YAML, type hash) and ours."""

    name: str
    schema: Schema
    metadata: dict[str, str]
    count: int = 0


@dataclass
class _Span:
    """How many messages there are, and their first and last log time, ns."""

    count: int = 0
    start: int | None = None
    end: int = 0

    @property
    def duration(self) -> int:
        return 0 if self.start is None else self.end - self.start

    def add_all(self, other: "_Span") -> None:
        if other.start is not None:
            self.count += other.count
            self.start = other.start if self.start is None else min(self.start, other.start)
            self.end = max(self.end, other.end)


class _File:
    """One MCAP file of a recording; every file repeats what describes the recording."""

    def __init__(self, path: Path, compression: CompressionType) -> None:
        self.path = path
        self.stream = path.open("wb")
        self.writer = MessageWriter(self.stream, CHUNK, compression)
        self.writer.start(profile="ros2", library=f"emir {software_version()}")
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}

    @property
    def span(self) -> _Span:
        found = self.writer.statistics
        start = found.message_start_time if found.message_count else None
        return _Span(found.message_count, start, found.message_end_time)

    def announce(self, topic: Topic) -> None:
        schema = topic.schema
        if schema.name not in self._schemas:
            self._schemas[schema.name] = self.writer.register_schema(
                name=schema.name, encoding=schema.encoding, data=schema.data
            )
        self._channels[topic.name] = self.writer.register_channel(
            topic=topic.name,
            message_encoding="cdr",
            schema_id=self._schemas[schema.name],
            metadata=topic.metadata,
        )

    def attach(self, a: Attachment) -> None:
        self.writer.add_attachment(a.create_time, a.log_time, a.name, a.media_type, a.data)

    def write(self, topic: Topic, data: bytes, log_time: int, publish_time: int) -> None:
        number = self._channels[topic.name]
        self.writer.add_message(number, log_time, data, publish_time, topic.count)

    def finish(self) -> None:
        self.writer.finish()  # type: ignore[no-untyped-call]  # mcap's, untyped
        self.stream.close()


@dataclass
class Rosbag2Writer:
    """Writes serialized messages as they came.

    compression: of the chunks in the files, a key of COMPRESSIONS. max_size (bytes) and
    max_duration (s, of log time): a new file is begun where the present one reaches them.
    failure: what is raised where a method says WriteError, made of that one's line.
    The folder has to be new or empty: a recording is never written over. Raises ParameterError
    where it is not, or cannot be written to.
    """

    folder: Path
    compression: str = "none"
    max_size: float = math.inf
    max_duration: float = math.inf
    failure: Callable[[str], Exception] = WriteError
    _topics: dict[str, Topic] = field(default_factory=dict, init=False)
    _metadata: dict[str, dict[str, str]] = field(default_factory=dict, init=False)
    _attachments: list[Attachment] = field(default_factory=list, init=False)
    _finished: list[_File] = field(default_factory=list, init=False)
    _closed: bool = field(default=False, init=False)
    _latest: int = field(default=0, init=False)  # log time so far, ns
    _begin: int = field(default=0, init=False)  # the present file's, ns

    def __post_init__(self) -> None:
        if self.compression not in COMPRESSIONS:
            raise ParameterError(
                f"compression {self.compression!r}: there are {', '.join(COMPRESSIONS)}"
            )
        self._splits = min(self.max_size, self.max_duration) < math.inf
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            taken = any(self.folder.iterdir())
            if not taken:
                self._file = self._next_file()
        except FileExistsError:  # a file of that name
            taken = True
        except OSError as error:
            raise ParameterError(f"{self.folder}: {error.strerror}") from None
        if taken:
            raise ParameterError(f"{self.folder}: exists already, and is not overwritten")

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
    def closed(self) -> bool:
        """Return whether nothing more can be written."""
        return self._closed

    @property
    def topics(self) -> set[str]:
        """Return the full names of the topics announced."""
        return set(self._topics)

    @property
    def message_count(self) -> int:
        """Return how many messages were written."""
        return self._span.count

    @property
    def duration_ns(self) -> int:
        """Return the time between first and last message, ns."""
        return self._span.duration

    def add_topic(self, name: str, schema: Schema, metadata: dict[str, str]) -> None:
        """Announce a topic by its full name.

        schema: name, encoding and text of the type; its id is not used. metadata: as
        `channel_metadata` returns it, or as it stands in another recording. Raises WriteError.
        """
        self._topics[name] = Topic(name, schema, metadata)
        with self._watched():
            self._file.announce(self._topics[name])

    def add_metadata(self, name: str, data: dict[str, str]) -> None:
        """Store a metadata record, texts by key, in the MCAP files. Raises WriteError."""
        self._metadata[name] = data
        with self._watched():
            self._file.writer.add_metadata(name, data)

    def add_attachment(self, attachment: Attachment) -> None:
        """Store an attachment in the MCAP files. Raises WriteError."""
        self._attachments.append(attachment)
        with self._watched():
            self._file.attach(attachment)

    def write(self, topic: str, data: bytes, log_time: int, publish_time: int) -> None:
        """Store one message; times in ns. Raises WriteError, such as for a full disk."""
        entry = self._topics[topic]
        try:  # not `_watched`: this is done tens of thousands of times a second
            if self._splits and self._is_full(log_time):
                self._split()
            self._file.write(entry, data, log_time, publish_time)
        except OSError as error:
            raise self._given_up(error) from None
        entry.count += 1

    def flush(self) -> None:
        """Hand all that was written to the operating system: it outlives this process.

        Raises WriteError.
        """
        with self._watched():
            self._file.writer.flush()  # type: ignore[no-untyped-call]  # mcap's, untyped

    def close(self) -> None:
        """Finish the files and write metadata.yaml; without a message, leave no folder behind.

        A second call does nothing, nor does one after a WriteError. Raises WriteError.
        """
        if self._closed:
            return
        self._closed = True
        text = _yaml(self._description([*self._finished, self._file]))
        with self._watched():
            self._file.writer.add_metadata("rosbag2", {"serialized_metadata": text})
            self._file.finish()
            (self.folder / "metadata.yaml").write_text(text)
        if not self.message_count:
            shutil.rmtree(self.folder)

    @contextmanager
    def _watched(self) -> Iterator[None]:
        """Give up writing when it fails."""
        try:
            yield
        except OSError as error:
            raise self._given_up(error) from None

    def _given_up(self, error: OSError) -> Exception:
        """Write no more; the file keeps what is in it. Returns what to raise."""
        self._closed = True
        with suppress(OSError):  # it tries once more to write what it still holds
            self._file.stream.close()
        return self.failure(
            f"{self._file.path}: {error.strerror}: recording ended;"
            " what came before it is kept (emir bag recover)"
        )

    @property
    def _span(self) -> _Span:
        """Of all files together."""
        whole = _Span()
        for file in (*self._finished, self._file):
            whole.add_all(file.span)
        return whole

    def _is_full(self, time: int) -> bool:
        """Return whether a message of that log time, ns, belongs into a new file.

        A file's time counts from when it was begun: what comes late makes it no longer.
        """
        self._latest = max(self._latest, time)
        if not self._file.writer.statistics.message_count:  # the first file's first
            self._begin = time
            return False
        too_long = (time - self._begin) * 1e-9 >= self.max_duration
        return too_long or self._file.stream.tell() >= self.max_size

    def _split(self) -> None:
        self._file.finish()
        self._finished.append(self._file)
        self._file = self._next_file()
        self._begin = self._latest

    def _next_file(self) -> _File:
        path = self.folder / f"{self.folder.name}_{len(self._finished)}.mcap"
        file = _File(path, COMPRESSIONS[self.compression])
        for name, data in self._metadata.items():
            file.writer.add_metadata(name, data)
        for attachment in self._attachments:
            file.attach(attachment)
        for topic in self._topics.values():
            file.announce(topic)
        return file

    def _description(self, files: list[_File]) -> dict[str, Any]:
        return {
            "rosbag2_bagfile_information": {
                "version": 9,
                "storage_identifier": "mcap",
                **_times(self._span),
                "topics_with_message_count": [_counted(t) for t in self._topics.values()],
                "compression_format": "",  # of whole files; chunks say for themselves
                "compression_mode": "",
                "relative_file_paths": [file.path.name for file in files],
                "files": [{"path": file.path.name, **_times(file.span)} for file in files],
                "custom_data": None,
                "ros_distro": "jazzy",
            }
        }


def _times(span: _Span) -> dict[str, Any]:
    return {
        "duration": {"nanoseconds": span.duration},
        "starting_time": {"nanoseconds_since_epoch": span.start or 0},
        "message_count": span.count,
    }


def _counted(topic: Topic) -> dict[str, Any]:
    return {
        "topic_metadata": {
            "name": topic.name,
            "type": topic.schema.name,
            "serialization_format": "cdr",
            "offered_qos_profiles": _qos(topic),
            "type_description_hash": topic.metadata.get("topic_type_hash", ""),
        },
        "message_count": topic.count,
    }


def _qos(topic: Topic) -> list[dict[str, Any]]:
    return yaml.safe_load(topic.metadata.get("offered_qos_profiles", "")) or []

"""Reading rosbag2 recordings in MCAP: messages with their times, and what was stored beside."""

import os
import struct
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import IO, Any, NamedTuple, cast

from mcap.exceptions import EndOfFile, McapError
from mcap.records import Attachment, Channel, Footer, McapRecord, Metadata, Schema
from mcap.records import Message as McapMessage
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from zstandard import ZstdError

from emir_analysis.errors import InputError

MAGIC = b"\x89MCAP0\r\n"  # first and last bytes of an .mcap file


class _Stream:
    """A file that says so when it ends in the middle of a record."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file

    def read(self, length: int) -> bytes:
        """Return `length` bytes. Raises EndOfFile when there are fewer."""
        data = self._file.read(length)
        if len(data) < length:
            raise EndOfFile
        return data


class Message(NamedTuple):
    """One message of a recording."""

    stamp: int  # ns, of the header; the log time where the message has no header
    log_time: int  # ns, when it was recorded
    data: Any  # the decoded message, fields as attributes


def read(path: Path, topics: Collection[str] | None = None) -> dict[str, list[Message]]:
    """Return the messages of a recording by topic, in the order of their log times.

    path: a rosbag2 folder, with or without its metadata.yaml, or one .mcap file. A recording
    that was cut off is read as far as it goes. topics: all when not given. Raises InputError
    for a path without a recording, a damaged or empty one and a topic that is not recorded.
    """
    found: dict[str, list[Message]] = {}
    for file in files(path):
        for topic, message in _messages(file, topics):
            found.setdefault(topic, []).append(message)
    if not found and not topics:
        raise InputError(f"{path}: no message in it")
    for topic in topics or ():
        if topic not in found:
            there = ", ".join(sorted(recorded_topics(path))) or "none"
            raise InputError(f"{path}: topic {topic} is not recorded; there are: {there}")
    for messages in found.values():
        messages.sort(key=lambda message: message.log_time)
    return found


def metadata(path: Path) -> dict[str, dict[str, str]]:
    """Return the MCAP metadata records of a recording by name. Raises InputError as `read`."""
    return {
        record.name: dict(record.metadata)
        for file in files(path)
        for record in records(file)
        if isinstance(record, Metadata)
    }


def attachments(path: Path) -> list[Attachment]:
    """Return the attachments of a recording, each once by its name. Raises InputError as `read`."""
    found = {
        record.name: record
        for file in files(path)
        for record in records(file)
        if isinstance(record, Attachment)
    }
    return list(found.values())


def files(path: Path) -> list[Path]:
    """Return the .mcap files of a recording. Raises InputError when there are none."""
    if not path.exists():
        raise InputError(f"{path}: no such recording")
    found = [path] if path.is_file() else sorted(path.glob("*.mcap"), key=_place)
    if not found or found[0].suffix != ".mcap":
        raise InputError(f"{path}: not a recording: no .mcap file")
    return found


def _place(file: Path) -> tuple[int, str]:
    """Order the files of a split recording: NAME_2.mcap comes before NAME_10.mcap."""
    number = file.stem.rpartition("_")[2]
    return (int(number) if number.isdecimal() else 0, file.name)


def recorded_topics(path: Path) -> set[str]:
    """Return the names of the topics in a recording. Raises InputError as `read`."""
    found = (record for file in files(path) for record in records(file))
    return {record.topic for record in found if isinstance(record, Channel)}


def records(file: Path) -> Iterator[McapRecord]:
    """Yield the records of a file in their order, up to where it was cut off.

    Read in sequence and not by the index at the end, which a cut-off file does not have. Raises
    InputError where the file is damaged.
    """
    try:
        with file.open("rb") as stream:
            for record in _sequence(stream):
                yield record
                if isinstance(record, Footer):
                    return
    except EndOfFile:
        return
    except OSError as error:
        raise InputError(f"{file}: {error.strerror}") from None
    except (McapError, ZstdError, struct.error, ValueError, RuntimeError) as error:
        raise InputError(f"{file}: damaged: {' '.join(str(error).split())}") from None


def is_finished(file: Path) -> bool:
    """Return whether an .mcap file was written to its end; what is cut off lacks the end's magic.

    Raises InputError for a file that cannot be read.
    """
    try:
        with file.open("rb") as stream:
            stream.seek(-min(len(MAGIC), file.stat().st_size), os.SEEK_END)
            return stream.read() == MAGIC
    except OSError as error:
        raise InputError(f"{file}: {error.strerror}") from None


def _messages(file: Path, topics: Collection[str] | None) -> Iterator[tuple[str, Message]]:
    factory = DecoderFactory()
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    for record in records(file):
        if isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel):
            channels[record.id] = record
        elif isinstance(record, McapMessage):
            channel = channels.get(record.channel_id)
            if channel is None:
                raise InputError(f"{file}: damaged: a message of no known topic")
            if topics is None or channel.topic in topics:
                data = _decoded(file, channel, schemas.get(channel.schema_id), record, factory)
                stamp = _header_stamp(data, record.log_time)
                yield channel.topic, Message(stamp, record.log_time, data)


def _decoded(
    file: Path,
    channel: Channel,
    schema: Schema | None,
    record: McapMessage,
    factory: DecoderFactory,
) -> Any:
    decoder = factory.decoder_for(channel.message_encoding, schema)
    if decoder is None:
        raise InputError(f"{file}: topic {channel.topic}: not a ROS 2 message in CDR")
    try:
        return decoder(record.data)
    except (struct.error, ValueError, IndexError) as error:
        raise InputError(f"{file}: topic {channel.topic}: broken message ({error})") from None


def _header_stamp(data: Any, log_time: int) -> int:
    header = getattr(data, "header", None)
    if header is None:
        return log_time
    return int(header.stamp.sec) * 1_000_000_000 + int(header.stamp.nanosec)


def _sequence(stream: IO[bytes]) -> Iterator[McapRecord]:
    reader = StreamReader(cast("IO[bytes]", _Stream(stream)), validate_crcs=True)
    yield from reader.records

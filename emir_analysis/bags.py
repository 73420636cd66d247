"""Reading rosbag2 recordings in MCAP: messages with their times, and what was stored beside."""

import os
import struct
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import IO, Any, NamedTuple, cast

import yaml
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Attachment, Channel, Chunk, Footer, McapRecord, Metadata, Schema
from mcap.records import Message as McapMessage
from mcap.stream_reader import StreamReader, get_chunk_data_stream
from mcap_ros2.decoder import DecoderFactory
from zstandard import ZstdError

from emir_analysis.errors import InputError
from emir_msgs_py.conversions import stamp_ns

RECORD = struct.Struct("<BQ")  # opcode and length of any record
MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
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


class Raw(NamedTuple):
    """A message as it stands in the file; times in ns."""

    channel_id: int
    log_time: int
    publish_time: int
    data: bytes


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
            raise not_recorded(path, topic)
    for messages in found.values():
        messages.sort(key=lambda message: message.log_time)
    return found


def metadata(path: Path) -> dict[str, dict[str, str]]:
    """Return the MCAP metadata records of a recording by name. Raises InputError as `read`."""
    return {
        record.name: dict(record.metadata)
        for record in _beside_messages(path)
        if isinstance(record, Metadata)
    }


def attachments(path: Path) -> list[Attachment]:
    """Return the attachments of a recording, each once by its name. Raises InputError as `read`."""
    found = {r.name: r for r in _beside_messages(path) if isinstance(r, Attachment)}
    return list(found.values())


def files(path: Path) -> list[Path]:
    """Return the .mcap files of a recording. Raises InputError when there are none."""
    if not path.exists():
        raise InputError(f"{path}: no such recording")
    found = [path] if path.is_file() else sorted(path.glob("*.mcap"), key=_place)
    listed = _listed(path / "metadata.yaml")
    other = next((name for name in listed if not name.endswith(".mcap")), None)
    if other is not None and not found:
        raise InputError(f"{path}: {other} is no .mcap file; `ros2 bag convert` makes one of it")
    if not found or found[0].suffix != ".mcap":
        raise InputError(f"{path}: not a recording: no .mcap file")
    missing = [name for name in listed if not (path / name).exists()]
    if missing:
        raise InputError(f"{path}: {missing[0]}, which its metadata.yaml lists, is missing")
    return found


def _listed(file: Path) -> list[str]:
    """Return the names of a recording's files as its metadata.yaml has them; none without one."""
    try:
        content = yaml.safe_load(file.read_text(encoding="utf-8"))
        names = content["rosbag2_bagfile_information"]["relative_file_paths"]
        return [Path(name).name for name in names]
    except (OSError, UnicodeDecodeError, yaml.YAMLError, KeyError, TypeError):
        return []  # the files say for themselves what is in them


def _place(file: Path) -> tuple[int, str]:
    """Order the files of a split recording: NAME_2.mcap comes before NAME_10.mcap."""
    number = file.stem.rpartition("_")[2]
    return (int(number) if number.isdecimal() else 0, file.name)


def recorded_topics(path: Path) -> set[str]:
    """Return the names of the topics in a recording. Raises InputError as `read`."""
    return {record.topic for record in _beside_messages(path) if isinstance(record, Channel)}


def not_recorded(path: Path, topic: str) -> InputError:
    """Return the error that a recording has no message of a topic."""
    there = recorded_topics(path)
    if topic in there:
        return InputError(f"{path}: no message of topic {topic} in it")
    shown = ", ".join(sorted(there)) or "none (cut off before the first?)"
    return InputError(f"{path}: topic {topic} is not recorded; there are: {shown}")


def records(file: Path) -> Iterator[McapRecord | Raw]:
    """Yield the records of a file in their order, up to where it was cut off; messages as `Raw`.

    Read in sequence and not by the index at the end, which a cut-off file does not have. Raises
    InputError where the file is damaged.
    """
    with _told(file), file.open("rb") as stream:
        if stream.read(len(MAGIC)) != MAGIC:
            raise McapError("not an MCAP file, or an empty one")
        stream.seek(0)
        for record in _sequence(stream):
            if isinstance(record, Chunk):
                yield from _in_chunk(record)
            elif isinstance(record, McapMessage):
                yield Raw(record.channel_id, record.log_time, record.publish_time, record.data)
            else:
                yield record
                if isinstance(record, Footer):
                    return


def _beside_messages(path: Path) -> Iterator[McapRecord]:
    """Yield channels, metadata and attachments; by the index at the end of a file that has one."""
    for file in files(path):
        if is_finished(file):
            with _told(file), file.open("rb") as stream:
                reader = make_reader(stream)
                summary = reader.get_summary()
                if summary is not None and summary.channels:
                    yield from summary.channels.values()
                    yield from reader.iter_metadata()
                    yield from reader.iter_attachments()
                    continue
        yield from (record for record in records(file) if not isinstance(record, Raw))


@contextmanager
def _told(file: Path) -> Iterator[None]:
    """Say in one line what is wrong with a file; its end in mid-record is nothing wrong."""
    try:
        yield
    except EndOfFile:
        return
    except OSError as error:
        raise InputError(f"{file}: {error.strerror}") from None
    except (McapError, ZstdError, struct.error, ValueError, RuntimeError) as error:
        raise InputError(f"{file}: damaged: {' '.join(str(error).split())}") from None


def _in_chunk(chunk: Chunk) -> Iterator[McapRecord | Raw]:
    """Yield what is in a chunk; mcap's own way builds an object a record, at thrice the time."""
    stream, size = get_chunk_data_stream(chunk, validate_crc=True)
    data = stream.read(size)
    at = 0
    while at < size:
        opcode, length = RECORD.unpack_from(data, at)
        begin, at = at + RECORD.size, at + RECORD.size + length
        if at > size:
            raise McapError("a record beyond its chunk")
        if opcode == Opcode.MESSAGE:
            channel, _, log_time, publish_time = MESSAGE.unpack_from(data, begin)
            yield Raw(channel, log_time, publish_time, data[begin + MESSAGE.size : at])
        elif opcode == Opcode.SCHEMA:
            yield Schema.read(ReadDataStream(BytesIO(data[begin:at])))
        elif opcode == Opcode.CHANNEL:
            yield Channel.read(ReadDataStream(BytesIO(data[begin:at])))


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


def decoder(file: Path, channel: Channel, schema: Schema | None) -> Callable[[bytes], Any]:
    """Return what decodes a channel's messages, fields as attributes.

    Raises InputError for what is no ROS 2 message, and when called for a broken one.
    """
    found = DecoderFactory().decoder_for(channel.message_encoding, schema)
    if found is None:
        raise InputError(f"{file}: topic {channel.topic}: not a ROS 2 message in CDR")

    def decode(data: bytes) -> Any:
        try:
            return found(data)
        except (struct.error, ValueError, IndexError) as error:
            raise InputError(f"{file}: topic {channel.topic}: broken message ({error})") from None

    return decode


def _messages(file: Path, topics: Collection[str] | None) -> Iterator[tuple[str, Message]]:
    schemas: dict[int, Schema] = {}
    channels: dict[int, tuple[str, Callable[[bytes], Any]] | None] = {}
    for record in records(file):
        if isinstance(record, Raw):
            if record.channel_id not in channels:
                raise InputError(f"{file}: damaged: a message of no known topic")
            wanted = channels[record.channel_id]
            if wanted is not None:
                topic, decode = wanted
                data = decode(record.data)
                yield topic, Message(_header_stamp(data, record.log_time), record.log_time, data)
        elif isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel) and record.id not in channels:
            channels[record.id] = None
            if topics is None or record.topic in topics:
                of = decoder(file, record, schemas.get(record.schema_id))
                channels[record.id] = record.topic, of


def _header_stamp(data: Any, log_time: int) -> int:
    return log_time if getattr(data, "header", None) is None else stamp_ns(data)


def _sequence(stream: IO[bytes]) -> Iterator[McapRecord]:
    reader = StreamReader(cast("IO[bytes]", _Stream(stream)), emit_chunks=True, validate_crcs=True)
    yield from reader.records

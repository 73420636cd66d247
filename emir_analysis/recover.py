"""A complete rosbag2 recording from one that was cut off, without ROS: all it needs is in it."""

from pathlib import Path
from typing import NamedTuple

from mcap.records import Attachment, Channel, Metadata, Schema

from emir_analysis import bags
from emir_analysis.errors import InputError
from emir_analysis.rosbag2_writer import Rosbag2Writer, WriteError

OWN = "rosbag2"  # the metadata record that the writer itself makes


class Recovery(NamedTuple):
    """What was saved; damage: why a file was not read to where it was cut off."""

    messages: int
    duration_ns: int
    damage: tuple[str, ...]


def recover(bag: Path, folder: Path) -> Recovery:
    """Write every message of the recording that is readable to a new folder, as it was recorded.

    bag: as `bags.read`. A file is read up to its first damage. Raises InputError when no message
    is readable or the folder lies in the recording, ParameterError when it exists, WriteError for
    such as a full disk.
    """
    files = bags.files(bag)
    if folder.resolve().is_relative_to(bag.resolve()):
        raise InputError(f"{folder}: lies in {bag}, which is read")
    damage = []
    with Rosbag2Writer(folder) as writer:
        for file in files:
            try:
                _copy(file, writer)
            except WriteError:
                raise
            except InputError as error:
                damage.append(str(error))
    if not writer.message_count:
        raise InputError(damage[0] if damage else f"{bag}: no message is readable")
    return Recovery(writer.message_count, writer.duration_ns, tuple(damage))


def _copy(file: Path, writer: Rosbag2Writer) -> None:
    schemas: dict[int, Schema] = {}
    topics: dict[int, str] = {}
    for record in bags.records(file):
        if isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel):
            if record.id not in topics:  # the index at the end names them again
                topics[record.id] = _announced(file, record, schemas, writer)
        elif isinstance(record, bags.Raw):
            if record.channel_id not in topics:
                raise InputError(f"{file}: damaged: a message of no known topic")
            topic = topics[record.channel_id]
            writer.write(topic, record.data, record.log_time, record.publish_time)
        elif isinstance(record, Metadata) and record.name != OWN:
            writer.add_metadata(record.name, record.metadata)
        elif isinstance(record, Attachment):
            writer.add_attachment(record)


def _announced(
    file: Path, channel: Channel, schemas: dict[int, Schema], writer: Rosbag2Writer
) -> str:
    """Announce a channel's topic, once for all files of the recording, and return its name."""
    schema = schemas.get(channel.schema_id)
    if channel.message_encoding != "cdr" or schema is None:
        raise InputError(f"{file}: topic {channel.topic}: not a ROS 2 message in CDR")
    if channel.topic not in writer.topics:
        writer.add_topic(channel.topic, schema, channel.metadata)
    return channel.topic

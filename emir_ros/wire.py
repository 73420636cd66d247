"""A topic's messages as the bytes on the wire (CDR), without building message objects.

Building a message and having it serialized takes longer than all else that a node does in a
period. But of a topic's message only the stamp and the signals ever change. So a serializer is
asked once, for a message of marked numbers, which shows where they stand; it is mcap's, since
the middleware's own leaves whatever was in memory between the fields.
"""

import struct
from collections.abc import Callable, Mapping
from functools import cached_property
from io import BytesIO
from typing import Any

from mcap.reader import make_reader
from mcap_ros2.writer import Writer
from rclpy.serialization import deserialize_message

from emir_msgs_py import conversions
from emir_msgs_py.conversions import NANOSECONDS
from emir_msgs_py.topics import Topic
from emir_ros.message_definitions import definition

STAMP = struct.Struct("<4xiI")  # encapsulation, then the header's sec and nanosec
_CLOCK = struct.Struct("<4siI")
_LITTLE_ENDIAN = b"\0\1\0\0"  # CDR's encapsulation
_NO_FRAME = b"\1\0\0\0\0"  # an empty text: its length with the zero at its end, that zero
_MARKED_STAMP = 1_234_567_891_123_456_789  # ns
_MARK = -1.2345678912345678e-123  # times the signal's number


def stamp_ns(data: bytes) -> int:
    """Return the header stamp, ns, of any serialized message that begins with a header."""
    sec, nanosec = STAMP.unpack_from(data)
    stamp: int = sec * NANOSECONDS + nanosec
    return stamp


def clock_message(stamp: int) -> bytes:
    """Return a serialized rosgraph_msgs/Clock of a time in ns."""
    return _CLOCK.pack(_LITTLE_ENDIAN, *divmod(stamp, NANOSECONDS))


def header_message(stamp: int) -> bytes:
    """Return a serialized std_msgs/Header, stamped in ns."""
    return clock_message(stamp) + _NO_FRAME


def sender(publisher: Any) -> Callable[[bytes], None]:
    """Return what publishes a serialized message, by the publisher's handle.

    What `Publisher.publish` does besides, to guard the handle and to tell bytes from messages,
    takes longer than sending.
    """
    send: Callable[[bytes], None] = publisher.handle.publish_raw
    return send


class Wire:
    """Signals of one topic to bytes and back.

    Bytes of another layout than the topic's own (another frame, more joints) are left to the
    middleware's deserializer, and so is a topic that keeps a signal in anything but a double.
    """

    def __init__(self, topic: Topic) -> None:
        self._topic = topic

    def encode(self, stamp: int, signals: Mapping[str, float]) -> bytes:
        """Return the topic's message, stamped in ns; raises KeyError for a missing signal."""
        if self._layout is None:
            return _serialized(self._topic, stamp, signals)
        form, blank, places = self._layout
        parts = blank.copy()
        parts[1], parts[2] = divmod(stamp, NANOSECONDS)
        for name, k in places:
            parts[k] = signals[name]
        return form.pack(*parts)

    def decode(self, data: bytes) -> dict[str, float]:
        """Return the signals by name; raises LookupError when a field is missing."""
        if self._layout is not None:
            form, blank, places = self._layout
            if len(data) == form.size:
                parts = form.unpack(data)
                if all(parts[k] == blank[k] for k in self._constants):
                    return {name: parts[k] for name, k in places}
        return conversions.values(self._topic, _deserialized(self._topic, data))

    @cached_property
    def _layout(self) -> tuple[struct.Struct, list[Any], list[tuple[str, int]]] | None:
        """The form of the bytes, its parts with constants in place, each signal's part.

        None where a signal does not stand in the bytes as a double of its own.
        """
        marks = {name: _MARK * k for k, name in enumerate(self._topic.fields, 1)}
        data = _serialized(self._topic, _MARKED_STAMP, marks)
        found = sorted((data.find(_double(mark)), name) for name, mark in marks.items())
        once = all(data.count(_double(mark)) == 1 for mark in marks.values())
        if not once or stamp_ns(data) != _MARKED_STAMP:
            return None
        form, blank, places, at = "<4siI", [data[:4], 0, 0], [], STAMP.size
        for place, name in found:
            if place > at:
                form += f"{place - at}s"
                blank.append(data[at:place])
            form += "d"
            places.append((name, len(blank)))
            blank.append(0.0)
            at = place + 8
        return struct.Struct(f"{form}{len(data) - at}s"), [*blank, data[at:]], places

    @cached_property
    def _constants(self) -> list[int]:
        """The numbers of the parts that are the same in every message."""
        _, blank, _ = self._layout or (None, [], None)
        return [k for k, part in enumerate(blank) if isinstance(part, bytes) and part]


def _double(value: float) -> bytes:
    return struct.pack("<d", value)


def _serialized(topic: Topic, stamp: int, signals: Mapping[str, float]) -> bytes:
    return as_cdr(topic.type, conversions.message(topic, stamp, signals))


def as_cdr(type_name: str, message: Any) -> bytes:
    """Return a message by way of a file in memory, the serializer's public door."""
    stream = BytesIO()
    writer = Writer(stream)
    kind = writer.register_msgdef(type_name, definition(type_name))
    writer.write_message("message", kind, message)
    writer.finish()
    stream.seek(0)
    ((_, _, written),) = make_reader(stream).iter_messages()
    return written.data


def _deserialized(topic: Topic, data: bytes) -> Any:
    return deserialize_message(data, conversions.message_class(topic.type))

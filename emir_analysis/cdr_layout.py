"""Where numbers stand in the bytes of ROS 2 messages (CDR), so that many are read at once.

Messages of a topic are as a rule all of one shape: the same strings, arrays of the same length.
Then a number stands at the same place in each, and numpy takes it out of all of them. A message is
walked by its definition only to find these places; the lengths that were met on the way are the
guards by which other messages are known to be of the same shape.
"""

import re
import struct
from collections.abc import Collection
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

NUMBERS = {  # ROS's primitive types -> numpy's
    "bool": "u1", "byte": "u1", "char": "u1", "uint8": "u1", "int8": "i1", "uint16": "<u2",
    "int16": "<i2", "uint32": "<u4", "int32": "<i4", "uint64": "<u8", "int64": "<i8",
    "float32": "<f4", "float64": "<f8",
}  # fmt: skip
LITTLE_ENDIAN = b"\x00\x01"  # how plain CDR begins; the only one read here
HEADER = 4  # bytes, from which alignment counts
MOST_ENTRIES = 10_000  # of an array of numbers, of which any may be wanted
LENGTH = struct.Struct("<I")
_TYPE = re.compile(r"(?P<name>[\w/]+)(<=\d+)?(?P<array>\[(?P<bound><=)?(?P<size>\d*)\])?$")

Bytes = NDArray[np.uint8]


class UnknownShapeError(ValueError):
    """A message or a definition that this module does not read."""


class FieldType(NamedTuple):
    """A field of a definition. size: of an array; 0: any length; None: no array."""

    name: str
    type: str
    size: int | None


@dataclass(frozen=True)
class Definition:
    """A message type and those that it contains, by full name without `msg/`."""

    name: str
    types: dict[str, list[FieldType]]


class Place(NamedTuple):
    """Where a number stands: bytes from the message's begin; its numpy type."""

    at: int
    kind: str


@dataclass
class Layout:
    """The shape of one message. places: by path; guards: length words by their place."""

    size: int
    places: dict[str, Place] = field(default_factory=dict)
    guards: dict[int, int] = field(default_factory=dict)

    def fits(self, messages: Bytes) -> NDArray[np.bool_]:
        """Return which of the messages, (n, size), have this shape."""
        same = np.ones(len(messages), bool)
        for at, value in self.guards.items():
            same &= _taken(messages, Place(at, "<u4")) == value
        return same

    def column(self, messages: Bytes, path: str) -> NDArray[np.float64] | None:
        """Return a number of each message, (n,); None where there is no such number."""
        place = self.places.get(path)
        return None if place is None else _taken(messages, place).astype(np.float64)


def _taken(messages: Bytes, place: Place) -> NDArray[np.generic]:
    width = np.dtype(place.kind).itemsize
    columns = np.ascontiguousarray(messages[:, place.at : place.at + width])
    return columns.view(place.kind)[:, 0]


def definition(name: str, text: str) -> Definition:
    """Return a type from its definition as MCAP files hold it (`ros2msg`).

    name: such as `sensor_msgs/msg/JointState`. Raises UnknownShapeError for what cannot be read.
    """
    parts = re.split(r"^=+\s*\nMSG: *(\S+)\s*$", text, flags=re.MULTILINE)
    own = name.replace("/msg/", "/")
    texts = {own: parts[0]} | {
        key.replace("/msg/", "/"): body for key, body in zip(parts[1::2], parts[2::2], strict=True)
    }
    types = {key: [*_fields(key.split("/")[0], body)] for key, body in texts.items()}
    for key, fields in types.items():
        for entry in fields:
            if entry.type not in NUMBERS and entry.type not in {"string", *types}:
                raise UnknownShapeError(f"{key}: {entry.type} is not known")
    return Definition(own, types)


def _fields(package: str, text: str) -> list[FieldType]:
    found = []
    for line in text.splitlines():
        kind, _, rest = line.split("#")[0].strip().partition(" ")
        rest = rest.strip()
        if not rest or re.match(r"\w+\s*=", rest):  # nothing, or a constant
            continue
        match = _TYPE.match(kind)
        if match is None:
            raise UnknownShapeError(f"{package}: {kind} is not a type")
        name = match["name"].replace("/msg/", "/")
        if name not in NUMBERS and name not in {"string", "wstring"} and "/" not in name:
            name = "std_msgs/Header" if name == "Header" else f"{package}/{name}"
        size = None if match["array"] is None else 0
        if match["size"] and not match["bound"]:
            size = int(match["size"])
        found.append(FieldType(rest.split()[0], name, size))
    return found


def layout(of: Definition, message: bytes, wanted: Collection[str]) -> Layout:
    """Return the shape of a message, with the places of the paths that are wanted and are there.

    Raises UnknownShapeError for what is not plain CDR.
    """
    if message[:2] != LITTLE_ENDIAN:
        raise UnknownShapeError("not little-endian CDR")
    walk = _Walk(of.types, message, frozenset(wanted), Layout(len(message)))
    try:
        walk.through(of.name, "")
    except (struct.error, RecursionError) as error:
        raise UnknownShapeError(str(error)) from None
    if walk.at > len(message):
        raise UnknownShapeError("ends before its last field")
    return walk.layout


@dataclass
class _Walk:
    """A way through one message, field by field."""

    types: dict[str, list[FieldType]]
    message: bytes
    wanted: frozenset[str]
    layout: Layout
    at: int = HEADER

    def through(self, type_name: str, prefix: str) -> None:
        for entry in self.types[type_name]:
            path = f"{prefix}{entry.name}"
            if entry.size is None:
                self._one(entry.type, path)
                continue
            count = entry.size or self._length()
            if entry.type in NUMBERS:
                self._numbers(entry.type, path, count)
                continue
            for k in range(count):
                self._one(entry.type, f"{path}[{k}]")

    def _one(self, kind: str, path: str) -> None:
        if kind in NUMBERS:
            self._align(np.dtype(NUMBERS[kind]).itemsize)
            self._note(path, self.at, kind)
            self.at += np.dtype(NUMBERS[kind]).itemsize
        elif kind == "string":
            length = self._length()  # which itself goes on
            self.at += length
        else:
            self.through(kind, f"{path}.")

    def _numbers(self, kind: str, path: str, count: int) -> None:
        width = np.dtype(NUMBERS[kind]).itemsize
        if count:
            self._align(width)
        if self.at + count * width > len(self.message):
            raise UnknownShapeError(f"{path} ends beyond the message")
        for k in range(min(count, MOST_ENTRIES)):
            self._note(f"{path}[{k}]", self.at + k * width, kind)
        self.at += count * width

    def _note(self, path: str, at: int, kind: str) -> None:
        if path in self.wanted:
            self.layout.places[path] = Place(at, NUMBERS[kind])

    def _length(self) -> int:
        self._align(LENGTH.size)
        (value,) = LENGTH.unpack_from(self.message, self.at)
        self.layout.guards[self.at] = value
        self.at += LENGTH.size
        if self.at + value > len(self.message):
            raise UnknownShapeError("a length beyond the message")
        return int(value)

    def _align(self, width: int) -> None:
        self.at += -(self.at - HEADER) % width

"""The numbers of a recording as columns, message by message read but never held as an object."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap.records import Channel, Schema
from numpy.typing import NDArray

from emir_analysis import bags, cdr_layout
from emir_analysis.cdr_layout import Definition, Layout, UnknownShapeError
from emir_analysis.errors import InputError
from emir_msgs_py.conversions import NANOSECONDS, field_value

STAMP = ("header.stamp.sec", "header.stamp.nanosec")
BATCH = 8192  # messages of a topic that are taken apart together
KEPT = 8  # shapes of a topic's messages that are remembered

Times = NDArray[np.int64]
Values = NDArray[np.float64]


class Columns(NamedTuple):
    """One topic. stamp, log_time: (n,) ns, as of `bags.Message`. values: by path, (n,) each."""

    stamp: Times
    log_time: Times
    values: dict[str, Values]


def read(path: Path, wanted: Mapping[str, Collection[str]]) -> dict[str, Columns]:
    """Return fields of topics, in the order of their log times.

    wanted: paths such as `position[0]` or `pose.position.x`, by topic. Raises InputError as
    `bags.read`, and for a path at which a message has no number.
    """
    topics = {topic: _Topic(topic, tuple(paths)) for topic, paths in wanted.items()}
    for file in bags.files(path):
        _read(file, topics)
    for name, topic in topics.items():
        if not topic.log_times:
            raise bags.not_recorded(path, name)
    return {name: topic.columns() for name, topic in topics.items()}


def _read(file: Path, topics: Mapping[str, "_Topic"]) -> None:
    schemas: dict[int, Schema] = {}
    known: set[int] = set()
    batches: dict[int, _Batch] = {}
    for record in bags.records(file):
        if isinstance(record, bags.Raw):
            batch = batches.get(record.channel_id)
            if batch is not None:
                batch.add(record)
            elif record.channel_id not in known:
                raise InputError(f"{file}: damaged: a message of no known topic")
        elif isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel) and record.id not in known:
            known.add(record.id)
            if record.topic in topics:
                schema = schemas.get(record.schema_id)
                batches[record.id] = _Batch(file, record, schema, topics[record.topic])
    for batch in batches.values():
        batch.finish()


@dataclass
class _Topic:
    """What is found of a topic, piece by piece. rows: of `paths`, then of what the stamp needs."""

    name: str
    paths: tuple[str, ...]
    log_times: list[Times] = field(default_factory=list)
    stamps: list[Times] = field(default_factory=list)
    pieces: list[Values] = field(default_factory=list)

    def columns(self) -> Columns:
        log_time, stamp = np.concatenate(self.log_times), np.concatenate(self.stamps)
        table = np.concatenate(self.pieces, axis=1)
        self.pieces.clear()
        if np.any(np.diff(log_time) < 0):
            order = np.argsort(log_time, kind="stable")
            log_time, stamp, table = log_time[order], stamp[order], table[:, order]
        return Columns(stamp, log_time, dict(zip(self.paths, table, strict=True)))


@dataclass
class _Batch:
    """Messages of a channel that wait to be taken apart."""

    file: Path
    channel: Channel
    schema: Schema | None
    topic: _Topic
    waiting: list[bags.Raw] = field(default_factory=list)
    layouts: list[Layout] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._decode = bags.decoder(self.file, self.channel, self.schema)
        self._definition: Definition | None = None
        if self.schema is not None:
            try:
                text = self.schema.data.decode()
                self._definition = cdr_layout.definition(self.schema.name, text)
            except UnknownShapeError:
                pass  # left to the decoder of any message
        self._read = (*self.topic.paths, *STAMP)

    def add(self, message: bags.Raw) -> None:
        self.waiting.append(message)
        if len(self.waiting) == BATCH:
            self.finish()

    def finish(self) -> None:
        """Take apart what waits."""
        if not self.waiting:
            return
        table = np.full((len(self._read), len(self.waiting)), np.nan)
        for places, messages in self._by_size():
            self._fill(table, places, messages)
        log_time = np.array([message.log_time for message in self.waiting], dtype=np.int64)
        sec, nanosec = table[-2:]
        has_stamp = ~np.isnan(sec)
        stamp = np.where(has_stamp, 0, log_time)
        stamp[has_stamp] = sec[has_stamp].astype(np.int64) * NANOSECONDS
        stamp[has_stamp] += nanosec[has_stamp].astype(np.int64)
        self.topic.log_times.append(log_time)
        self.topic.stamps.append(stamp)
        self.topic.pieces.append(table[:-2])
        self.waiting = []

    def _by_size(self) -> Iterator[tuple[NDArray[np.intp], NDArray[np.uint8]]]:
        """Yield which messages have the same size, and these as rows of bytes."""
        sizes = np.array([len(message.data) for message in self.waiting])
        for size in np.unique(sizes):
            places = np.flatnonzero(sizes == size)
            data = b"".join([self.waiting[k].data for k in places])
            yield places, np.frombuffer(data, np.uint8).reshape(len(places), size)

    def _fill(self, table: Values, places: NDArray[np.intp], messages: NDArray[np.uint8]) -> None:
        """Fill in the columns of messages of one size, shape by shape."""
        for layout in self.layouts:
            if places.size and layout.size == messages.shape[1]:
                places, messages = self._take(layout, table, places, messages)
        while places.size:
            found = self._layout(messages[0].tobytes())
            if found is None:
                for k in places:
                    self._fill_one(table, int(k))
                return
            self.layouts = [found, *self.layouts][:KEPT]
            places, messages = self._take(found, table, places, messages)

    def _take(
        self,
        layout: Layout,
        table: Values,
        places: NDArray[np.intp],
        messages: NDArray[np.uint8],
    ) -> tuple[NDArray[np.intp], NDArray[np.uint8]]:
        """Fill in the columns of those that have this shape; returns the others."""
        fits = layout.fits(messages)
        mine = messages if fits.all() else messages[fits]
        for row, path in enumerate(self._read):
            column = layout.column(mine, path)
            if column is not None:
                table[row, places[fits]] = column
            elif path not in STAMP and len(mine):
                self._complain(int(places[fits][0]), path)
        return places[~fits], messages[~fits]

    def _layout(self, message: bytes) -> Layout | None:
        if self._definition is None:
            return None
        try:
            return cdr_layout.layout(self._definition, message, self._read)
        except UnknownShapeError:
            return None

    def _fill_one(self, table: Values, k: int) -> None:
        message: Any = self._decode(self.waiting[k].data)
        for row, path in enumerate(self._read):
            try:
                table[row, k] = field_value(message, path)
            except (LookupError, TypeError, ValueError):
                if path not in STAMP:
                    self._complain(k, path)

    def _complain(self, k: int, path: str) -> None:
        before = sum(times.size for times in self.topic.log_times)
        raise InputError(
            f"{self.file}: {self.topic.name}: message {before + k} has no number in field {path}"
        )

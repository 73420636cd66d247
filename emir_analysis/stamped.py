"""The signals of a lock-step recording by stamp, and recorded beside replayed."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from emir_analysis import columns
from emir_analysis.control_protocols import Signals
from emir_analysis.graph_topics import graph_topics
from emir_msgs_py.topics import Topic

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FieldComparison:
    """A signal as recorded and as replayed, (n,) each, one value a period.

    n = 0: an older recording that does not have the topic.
    """

    topic: str
    name: str
    unit: str
    recorded: Array
    replayed: Array

    @property
    def equal(self) -> int:
        """Return how many samples agree in every bit."""
        return int(np.sum(self.recorded.view(np.int64) == self.replayed.view(np.int64)))

    @property
    def largest_difference(self) -> float:
        """Return the largest difference; nan where one of the two is not a number."""
        differ = self.recorded.view(np.int64) != self.replayed.view(np.int64)
        return float(np.max(np.abs(self.replayed - self.recorded)[differ], initial=0.0))


def same(fields: Iterable[FieldComparison]) -> bool:
    """Return whether every sample agrees in every bit."""
    return all(field.equal == field.recorded.size for field in fields)


def compared(
    topics: Sequence[Topic], rows: Sequence[tuple[Signals, Signals]]
) -> list[FieldComparison]:
    """Return field by field what `rows`, recorded and replayed signals by period, hold."""
    return [
        FieldComparison(
            topic.name,
            name,
            field.unit,
            np.array([recorded[name] for recorded, _ in rows if name in recorded], dtype=float),
            np.array([answer[name] for recorded, answer in rows if name in recorded], dtype=float),
        )
        for topic in topics
        for name, field in topic.fields.items()
    ]


def by_stamp(bag: Path, topics: Sequence[Topic], period: int) -> dict[int, Signals]:
    """Return the signals of each period, ns, in which every topic was recorded.

    Raises InputError for a topic that is not recorded or lacks a field.
    """
    there = graph_topics(bag)
    names = {topic.name: there.needed(topic) for topic in topics}
    paths = {topic.name: [about.path for about in topic.fields.values()] for topic in topics}
    recorded = columns.read(bag, {full: paths[name] for name, full in names.items()})
    found = [_rows(topic, recorded[names[topic.name]], period) for topic in topics]
    stamps = set(found[0]).intersection(*found[1:])
    return {
        stamp: {name: value for of_topic in found for name, value in of_topic[stamp].items()}
        for stamp in stamps
    }


def _rows(topic: Topic, recorded: columns.Columns, period: int) -> dict[int, Signals]:
    """Return a topic's signals by those stamps that are multiples of the period, ns."""
    due = recorded.stamp % period == 0
    series = [recorded.values[about.path][due].tolist() for about in topic.fields.values()]
    rows = zip(*series, strict=True)
    names = tuple(topic.fields)
    return {
        stamp: dict(zip(names, row, strict=True))
        for stamp, row in zip(recorded.stamp[due].tolist(), rows, strict=True)
    }

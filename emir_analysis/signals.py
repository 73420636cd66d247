"""From recorded messages to named signals: time, value, unit."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from emir_analysis import columns
from emir_analysis.errors import InputError
from emir_common.quantity import ParameterError
from emir_common.yaml_file import read_map

Array = NDArray[np.float64]

FEWEST_SAMPLES = 2
TIME = "time"  # the entry of a signal map that is no signal: where a table has its times


class Source(NamedTuple):
    """Where a signal stands in a recording; field is a path such as `position[0]`."""

    topic: str
    field: str
    unit: str


SignalMap = Mapping[str, Source | tuple[str, str, str]]


@dataclass(frozen=True)
class Signal:
    """One quantity over time. time: (n,) s from the recording's start, increasing. value: (n,)."""

    name: str
    time: Array
    value: Array
    unit: str


@dataclass(frozen=True)
class Recording:
    """Signals by name; start_ns: the earliest header stamp among them, ns."""

    signals: dict[str, Signal]
    start_ns: int

    def __getitem__(self, name: str) -> Signal:
        return self.signals[name]


def load(path: Path, signal_map: SignalMap) -> Recording:
    """Read the mapped signals of a recording, timed by the stamps in the messages' headers.

    Raises InputError, naming topic and field, for what is missing, no number, not finite, out
    of order in time or shorter than two samples.
    """
    sources = {name: Source(*source) for name, source in signal_map.items()}
    wanted: dict[str, list[str]] = {}
    for source in sources.values():
        wanted.setdefault(source.topic, []).append(source.field)
    found = columns.read(path, {topic: dict.fromkeys(paths) for topic, paths in wanted.items()})
    start = min(int(of_topic.stamp[0]) for of_topic in found.values())
    times = {
        topic: _times(f"{path}: {topic}", of_topic.stamp, start)
        for topic, of_topic in found.items()
    }
    signals = {}
    for name, source in sources.items():
        time, value = times[source.topic], found[source.topic].values[source.field]
        _check_finite(f"{path}: {source.topic}", source.field, time, value)
        signals[name] = Signal(name, time, value, source.unit)
    return Recording(signals, start)


def read_signal_map(file: Path) -> dict[str, Source]:
    """Read a YAML map `name: {topic, field, unit}`. Raises InputError naming file and entry."""
    try:
        content = read_map(file, what="signals")
    except ParameterError as error:
        raise InputError(str(error)) from None
    found = {
        str(name): _source(file, name, entry) for name, entry in content.items() if name != TIME
    }
    shown: dict[tuple[str, str], str] = {}
    for name, source in found.items():
        other = shown.setdefault(source[:2], name)
        if other != name:
            raise InputError(
                f"{file}: {other} and {name} stand in one field, {source.field} of {source.topic}"
            )
    return found


def _source(file: Path, name: str, entry: Any) -> Source:
    if not isinstance(entry, dict) or not {"topic", "field", "unit"} <= entry.keys():
        raise InputError(f"{file}: {name}: needs topic, field and unit")
    return Source(str(entry["topic"]), str(entry["field"]), str(entry["unit"]))


def _times(where: str, stamps: columns.Times, start: int) -> Array:
    """Return the stamps as times from the start, ns, in s."""
    if stamps.size < FEWEST_SAMPLES:
        raise InputError(f"{where}: {stamps.size} message, too few for a signal")
    if not np.any(stamps):
        raise InputError(f"{where}: the headers' stamps are not set, all are 0; record with stamps")
    time = np.asarray((stamps - start) * 1e-9)
    gaps = np.diff(time)
    behind = np.flatnonzero(gaps <= 0.0)
    if behind.size:
        first = int(behind[0])
        what = "stamps out of order" if gaps[first] < 0.0 else "two messages with one stamp"
        raise InputError(f"{where}: {what} at {time[first + 1]:.3f} s")
    return time


def _check_finite(where: str, field: str, time: Array, value: Array) -> None:
    bad = np.flatnonzero(~np.isfinite(value))
    if bad.size:
        raise InputError(
            f"{where}: {field} is {value[bad[0]]} at {time[bad[0]]:.3f} s"
            f" ({bad.size} of {value.size} samples)"
        )

"""`emir import`: a table of measurements becomes a recording, by a signal map.

The map is the one that `emir diagnose` reads, with the column of each signal and the time:

    time: {column: t, unit: s}          # or {period: 0.01, unit: s}
    oil_pressure: {column: p, column_unit: bar, topic: /rig/pressure, field: fluid_pressure,
                   unit: Pa}

Without a time the rows are samples; a sample stands in the recording as one second.
"""

import json
import math
import re
from argparse import ArgumentParser
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Schema
from mcap_ros2._dynamic import serialize_dynamic

from emir_analysis.csv_table import read_columns
from emir_analysis.errors import InputError
from emir_analysis.info import FIELDS
from emir_analysis.rosbag2_writer import Rosbag2Writer, channel_metadata
from emir_analysis.signals import TIME, Array, Source, read_signal_map
from emir_common.yaml_file import read_map
from emir_msgs_py.conversions import NANOSECONDS
from emir_msgs_py.definitions import DEFINITIONS, FLOAT64, HASHES
from emir_msgs_py.topics import FLUID_PRESSURE, JOINT_STATE

METADATA = "emir.import"  # the record that says where a recording came from
LAST_STAMP = 2**31  # s, of a ROS stamp
SHORTEST = 1e-9  # s, that two stamps can be apart
LAST_INDEX = 99  # of a field: a JointState with a hundred joints
TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "sample": 1.0}
UNITS = {  # a column's unit -> SI unit, factor
    "bar": ("Pa", 1e5), "mbar": ("Pa", 100.0), "kPa": ("Pa", 1e3), "MPa": ("Pa", 1e6),
    "psi": ("Pa", 6894.757293168), "mm": ("m", 1e-3), "cm": ("m", 1e-2), "kN": ("N", 1e3),
    "deg": ("rad", math.pi / 180.0), "mrad": ("rad", 1e-3), "mm/s": ("m/s", 1e-3),
    "deg/s": ("rad/s", math.pi / 180.0), "l/min": ("m^3/s", 1e-3 / 60.0), "%": ("1", 0.01),
}  # fmt: skip
ARRAYS = ("position", "velocity", "effort")  # of a JointState
_FIELD = re.compile(r"(\w+)(?:\[(\d+)\])?")
_FOREVER = {"sec": 9223372036, "nsec": 854775807}
_SYSTEM_DEFAULT = [
    {"history": 3, "depth": 0, "reliability": 1, "durability": 2, "deadline": _FOREVER,
     "lifespan": _FOREVER, "liveliness": 1, "liveliness_lease_duration": _FOREVER,
     "avoid_ros_namespace_conventions": False}
]  # fmt: skip


@dataclass(frozen=True)
class Column:
    """Where a signal comes from and where it goes. factor: from the column's unit to the map's."""

    name: str
    source: Source
    factor: float


@dataclass(frozen=True)
class Imported:
    """What was written: rows, the time of the first and of the last, in s or samples.

    left_out: messages for which a cell was blank.
    """

    rows: int
    start: float
    end: float
    unit: str
    left_out: int


def command(words: Sequence[str]) -> str:
    """Import, return what was written. Raises InputError or ParameterError."""
    options = _parser().parse_args(words)
    made = import_csv(options.table, options.signals, options.out, _rows(options.rows))
    left = f"; {made.left_out} messages left out for blank cells" if made.left_out else ""
    times = f"time {made.start:g} ... {made.end:g} {made.unit}"
    return f"{options.out}: {made.rows} rows, {times}{left}"


def _rows(text: str | None) -> slice | None:
    """Return the rows that A:B means; None: all."""
    if text is None:
        return None
    try:
        first, behind = (int(n) if n else None for n in text.split(":"))
    except ValueError:
        raise InputError(f"--rows {text}: not of the form A:B") from None
    return slice(first, behind)


def _parser() -> ArgumentParser:
    parser = ArgumentParser(
        prog="emir import",
        description="A CSV file as a recording that every other command takes (rosbag2, MCAP), by a"
        " signal map. A blank cell is no sample.",
    )
    parser.add_argument("table", type=Path, metavar="CSV", help="its first line names the columns")
    parser.add_argument(
        "--signals", type=Path, required=True, metavar="FILE",
        help="signal map, YAML: of each signal column, topic, field, unit; the column of time",
    )  # fmt: skip
    parser.add_argument(
        "--out", type=Path, required=True, metavar="BAG", help="folder to write; must not exist"
    )
    parser.add_argument("--rows", metavar="A:B", help="from row A (the first is 0) up to before B")
    return parser


def import_csv(table: Path, signals: Path, out: Path, rows: slice | None = None) -> Imported:
    """Write the mapped columns of a CSV file as a rosbag2 recording in the folder `out`.

    A blank cell is no message: signals may have been sampled at different times.
    rows: which of the table's rows; all when not given. Raises InputError or ParameterError,
    one line each, for a map or a table that cannot be used and for a folder that exists.
    """
    columns = _columns(signals)
    clock = _clock(signals)
    wanted = [column.name for column in columns.values()]
    if clock.column is not None:
        wanted.append(clock.column)
    read = read_columns(table, dict.fromkeys(wanted), sparse=wanted[: len(columns)])
    count = next(iter(read.values())).size
    chosen = np.arange(count)[rows or slice(None)]
    if chosen.size == 0:
        raise InputError(f"{table}: none of its {count} rows is among those asked for")
    time = _time(table, clock, read, count)[chosen]
    values = {name: column.factor * read[column.name][chosen] for name, column in columns.items()}
    sources = {name: column.source for name, column in columns.items()}
    origin = {name: f"column {column.name}" for name, column in columns.items()}
    left_out = write_signals(out, time, values, sources, origin | {
        "file": table.name,
        "time": "a sample stands as one second" if clock.unit == "sample" else "s",
    })  # fmt: skip
    unit = "samples" if clock.unit == "sample" else "s"
    return Imported(chosen.size, float(time[0]), float(time[-1]), unit, left_out)


def write_signals(
    out: Path,
    time: Array,
    values: dict[str, Array],
    sources: dict[str, Source],
    about: dict[str, str],
) -> int:
    """Write signals that share their times (n,), s, as a recording of standard messages.

    Return how many messages were left out.

    values: (n,) by name, NaN where there is none: its topic then has no message. sources: topic
    and field of each. about: stored as metadata; what it says of a signal's name is stored with
    the field, too. Raises InputError for a field that no supported message has, ParameterError
    for an existing folder.
    """
    stamps = np.round(time * 1e9).astype(np.int64)
    topics = {source.topic for source in sources.values()}
    members = {t: {n: s for n, s in sources.items() if s.topic == t} for t in sorted(topics)}
    kinds = {topic: _message_type(topic, signals) for topic, signals in members.items()}
    left_out = 0
    encoders = {k: serialize_dynamic(k, DEFINITIONS[k])[k] for k in set(kinds.values())}
    with Rosbag2Writer(out) as writer:
        writer.add_metadata(METADATA, about)
        for topic, signals in members.items():
            _add_topic(writer, topic, kinds[topic], signals, about)
        for k, stamp in enumerate(stamps.tolist()):
            for topic, signals in members.items():
                now = {signals[name].field: float(values[name][k]) for name in signals}
                if any(map(math.isnan, now.values())):
                    left_out += 1
                    continue
                message = _message(kinds[topic], stamp, list(signals), now)
                writer.write(topic, encoders[kinds[topic]](message), stamp, stamp)
    return left_out


def _add_topic(
    writer: Rosbag2Writer, topic: str, kind: str, signals: dict[str, Source], about: dict[str, str]
) -> None:
    """Announce a topic of a message type, with the signals in its fields."""
    schema = Schema(0, DEFINITIONS[kind].encode(), "ros2msg", kind)
    fields = {
        n: {"path": s.field, "unit": s.unit, "meaning": about.get(n, "")}
        for n, s in signals.items()
    }
    metadata = channel_metadata(_SYSTEM_DEFAULT, HASHES[kind])
    writer.add_topic(topic, schema, metadata | {FIELDS: json.dumps(fields)})


@dataclass(frozen=True)
class _Clock:
    """column: with the time, or None where rows follow each other in a fixed period, s."""

    column: str | None
    period: float
    unit: str


def _clock(file: Path) -> _Clock:
    entry = read_map(file, what="signals").get(TIME, {"unit": "sample"})
    if not isinstance(entry, dict):
        raise InputError(f"{file}: {TIME}: needs column or period, and unit")
    unit = str(entry.get("unit", "s"))
    if unit not in TIME_UNITS:
        raise InputError(f"{file}: {TIME} in {unit}; known are {', '.join(TIME_UNITS)}")
    if "column" in entry:
        return _Clock(str(entry["column"]), TIME_UNITS[unit], unit)
    period = entry.get("period", 1.0 if unit == "sample" else None)
    if not isinstance(period, int | float) or not 0.0 < period < math.inf:
        raise InputError(f"{file}: {TIME}: needs the column of the times or the period of the rows")
    return _Clock(None, period * TIME_UNITS[unit], unit)


def _columns(file: Path) -> dict[str, Column]:
    entries = read_map(file, what="signals")
    found = {}
    for name, source in read_signal_map(file).items():
        entry = entries[name]
        if "column" not in entry:
            raise InputError(f"{file}: {name}: needs the column of the table")
        if source.unit in UNITS:
            raise InputError(
                f"{file}: {name}: unit: {source.unit}, but a recording is in SI units; write"
                f" column_unit: {source.unit}, unit: {UNITS[source.unit][0]}"
            )
        unit = str(entry.get("column_unit", source.unit))
        si, factor = UNITS.get(unit, (unit, 1.0))
        if si != source.unit:
            raise InputError(f"{file}: {name}: a column in {unit} is no signal in {source.unit}")
        found[name] = Column(str(entry["column"]), source, factor)
    if not found:
        raise InputError(f"{file}: no signal in it")
    taken: dict[str, str] = {}
    for name, column in found.items():
        if column.name in taken:
            raise InputError(
                f"{file}: {taken[column.name]} and {name} are one column, {column.name}"
            )
        taken[column.name] = name
    return found


def _time(table: Path, clock: _Clock, read: dict[str, Array], count: int) -> Array:
    name, time = "period", clock.period * np.arange(count, dtype=np.float64)
    if clock.column is not None:
        name, time = clock.column, clock.period * read[clock.column]
    apart = np.diff(time)
    behind = np.flatnonzero(apart <= 0.0)
    if behind.size:
        raise InputError(f"{table}: {name} does not increase at row {behind[0] + 1}")
    if np.any(apart < SHORTEST):
        raise InputError(f"{table}: {name}: rows are less than {SHORTEST:g} s apart")
    if time[0] < 0.0 or time[-1] >= LAST_STAMP:
        raise InputError(
            f"{table}: {name}: a stamp holds 0 ... {LAST_STAMP} s; let the times begin at 0"
        )
    return np.asarray(time)


def _message_type(topic: str, signals: dict[str, Source]) -> str:
    names = [_step(signal) for signal in signals.values()]
    if len(set(names)) < len(names):
        raise InputError(f"{topic}: two signals in one field")
    attributes = {name for name, _ in names}
    if attributes <= set(ARRAYS) and all(index is not None for _, index in names):
        return JOINT_STATE
    if attributes == {"fluid_pressure"}:
        return FLUID_PRESSURE
    if attributes == {"data"}:
        return FLOAT64
    fields = ", ".join(source.field for source in signals.values())
    known = "position[0], velocity[0], effort[0], fluid_pressure or data"
    raise InputError(f"{topic}: no message for {fields}; write to {known}")


def _step(source: Source) -> tuple[str, int | None]:
    match = _FIELD.fullmatch(source.field)
    if match is None:
        raise InputError(f"{source.topic}: {source.field!r} is not a field")
    index = None if match[2] is None else int(match[2])
    if index is not None and index > LAST_INDEX:
        raise InputError(f"{source.topic}: {source.field}: an index is at most {LAST_INDEX}")
    return match[1], index


def _message(kind: str, stamp: int, names: list[str], fields: dict[str, float]) -> dict[str, Any]:
    if kind == FLOAT64:
        return {"data": fields["data"]}
    seconds, nanoseconds = divmod(stamp, NANOSECONDS)
    header = {"stamp": {"sec": seconds, "nanosec": nanoseconds}, "frame_id": ""}
    if kind == FLUID_PRESSURE:
        return {"header": header, "fluid_pressure": fields["fluid_pressure"], "variance": 0.0}
    message: dict[str, Any] = {"header": header, "name": names}
    for array in ARRAYS:
        given = {path: value for path, value in fields.items() if path.startswith(array)}
        size = 1 + max((int(path[len(array) + 1 : -1]) for path in given), default=-1)
        message[array] = [given.get(f"{array}[{k}]", math.nan) for k in range(size)]
    return message

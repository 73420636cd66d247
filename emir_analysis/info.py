"""What a recording says of itself, and what is in it."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml
from mcap.records import Channel, Metadata, Schema

from emir_analysis import bags
from emir_analysis.machine_record import PLANT, machine_record

DESCRIPTION = "emir"  # the metadata record in which the graph describes its run
MACHINE = "emir.machine"  # the one with the effects that are on, and the seed
PARAMETERS = "emir.parameters"  # the one with the parameters of its nodes, JSON by node
CHANGE = "emir.parameter_change"  # with a number behind it: one that was set during the run
FIELDS = "fields"  # the channel metadata with path, unit and meaning by signal, JSON

Fields = dict[str, dict[str, str]]


@dataclass
class TopicInfo:
    """A recorded topic. first, last: log times, ns."""

    type: str
    fields: Fields = field(default_factory=dict)
    count: int = 0
    first: int = 0
    last: int = 0

    @property
    def rate(self) -> float | None:
        """Return messages per second between the first and the last, Hz; None for too few."""
        span = self.last - self.first
        return (self.count - 1) / (span * 1e-9) if span > 0 else None

    def add(self, time: int) -> None:
        """Count a message with its log time, ns."""
        self.first = min(self.first, time) if self.count else time
        self.last = max(self.last, time) if self.count else time
        self.count += 1


@dataclass(frozen=True)
class Change:
    """A parameter that was set during the run. time: of the recording, ns. value: JSON."""

    time: int
    node: str
    name: str
    value: str

    def as_metadata(self) -> dict[str, str]:
        """Return it as texts by key."""
        return {"time": str(self.time), "node": self.node, "name": self.name, "value": self.value}


@dataclass(frozen=True)
class Info:
    """about: the run's own description. unfinished: the files that were cut off.

    parameters: value by name, by node.
    """

    bag: Path
    about: dict[str, str]
    topics: dict[str, TopicInfo]
    unfinished: list[Path] = field(default_factory=list)
    parameters: dict[str, dict[str, Any]] = field(default_factory=dict)
    changes: dict[str, Change] = field(default_factory=dict)

    @property
    def start(self) -> int:
        """Return the first message's time, ns."""
        return min((topic.first for topic in self.topics.values() if topic.count), default=0)

    @property
    def duration(self) -> float:
        """Return the time between the first and the last message, s."""
        filled = [topic for topic in self.topics.values() if topic.count]
        if not filled:
            return 0.0
        return (max(t.last for t in filled) - min(t.first for t in filled)) * 1e-9


def info(bag: Path) -> Info:
    """Count what is in a recording. Raises InputError as `bags.read`."""
    found = Info(bag, {}, {})
    for file in bags.files(bag):
        _count(file, found)
        if not bags.is_finished(file):
            found.unfinished.append(file)
    return found


def _count(file: Path, found: Info) -> None:
    types: dict[int, str] = {}
    topics: dict[int, TopicInfo] = {}
    for record in bags.records(file):
        if isinstance(record, Schema):
            types[record.id] = record.name
        elif isinstance(record, Channel):
            kind = types.get(record.schema_id, "unknown type")
            new = TopicInfo(kind, _fields(record.metadata.get(FIELDS, "{}")))
            topics[record.id] = found.topics.setdefault(record.topic, new)
        elif isinstance(record, bags.Raw) and record.channel_id in topics:
            topics[record.channel_id].add(record.log_time)
        elif isinstance(record, Metadata) and record.name == DESCRIPTION:
            found.about.update(record.metadata)
        elif isinstance(record, Metadata) and record.name == PARAMETERS:
            values = {node: json.loads(text) for node, text in record.metadata.items()}
            found.parameters.update(values)
        elif isinstance(record, Metadata) and record.name.startswith(CHANGE):
            m = record.metadata  # by name: a split recording repeats it in every file
            found.changes[record.name] = Change(int(m["time"]), m["node"], m["name"], m["value"])


def _fields(told: str) -> Fields:
    """Return what a channel tells of its fields; others keep something else under that name."""
    try:
        fields: Fields = json.loads(told)
        known = all({"path", "unit", "meaning"} <= entry.keys() for entry in fields.values())
    except (ValueError, AttributeError):
        return {}
    return fields if known else {}


def text(found: Info) -> str:
    """Return what is known as lines of text."""
    messages = sum(topic.count for topic in found.topics.values())
    lines = [f"{key}: {value}" for key, value in found.about.items() if key != "duration"]
    machine = machine_record(found.parameters.get(PLANT, {}))
    lines += [f"{key}: {value}" for key, value in machine.items()]
    lines.append(f"recorded: {found.duration:.3f} s, {messages} messages")
    lines.append(f"file: {_state(found)}")
    for change in found.changes.values():
        at = (change.time - found.start) * 1e-9
        lines.append(f"set at {at:.3f} s: {change.node} {change.name} = {change.value}")
    wide = max(map(len, found.topics), default=0)
    kinds = max((len(topic.type) for topic in found.topics.values()), default=0)
    for name, topic in sorted(found.topics.items()):
        rate = "-" if topic.rate is None else f"{topic.rate:.2f}"
        lines.append(f"  {name:{wide}}  {topic.type:{kinds}}  {topic.count:>8} {rate:>9} Hz")
    return "\n".join([f"{found.bag}:", *lines])


def fields_text(found: Info) -> str:
    """Return a line per recorded signal: topic and field, unit, meaning."""
    lines = [
        f"{name} {entry['path']} [{entry['unit']}]  {signal}: {entry['meaning']}"
        for name, topic in sorted(found.topics.items())
        for signal, entry in topic.fields.items()
    ]
    return "\n".join(lines) or f"{found.bag}: does not say what its fields mean"


def parameters_text(found: Info) -> str:
    """Return the parameters of the nodes as a ROS 2 parameter file."""
    if not found.parameters:
        return f"# {found.bag}: holds no parameters"
    tree = {node: {"ros__parameters": values} for node, values in found.parameters.items()}
    return yaml.safe_dump(tree, sort_keys=False).rstrip()


def _state(found: Info) -> str:
    if found.unfinished:
        names = ", ".join(file.name for file in found.unfinished)
        return f"cut off ({names}); emir bag recover makes it whole"
    if found.bag.is_dir() and not (found.bag / "metadata.yaml").exists():
        return "finished, but metadata.yaml is missing; emir bag recover makes it whole"
    return "finished"

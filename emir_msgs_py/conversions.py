"""Signals by name to standard messages and back, by the table of topics.

Works on any object with the message's fields: rclpy's messages and those that a bag reader
decodes. Only `message` needs ROS, and imports it when called.
"""

import re
from collections.abc import Mapping
from functools import cache
from importlib import import_module
from types import SimpleNamespace
from typing import Any

from emir_msgs_py.topics import JOINT_STATE, Field, Topic

NANOSECONDS = 1_000_000_000
_FIELD = re.compile(r"(\w+)(?:\[(\d+)\])?")


def field_value(message: Any, path: str) -> float:
    """Return the number at a path such as `position[0]` or `pose.position.x`.

    Raises LookupError (AttributeError, IndexError made into one) when there is no such field.
    """
    value = message
    for attribute, index in _steps(path):
        try:
            value = getattr(value, attribute)
            value = value if index is None else value[index]
        except (AttributeError, IndexError):
            raise LookupError(f"the message has no {path}") from None
    return float(value)


@cache
def _steps(path: str) -> tuple[tuple[str, int | None], ...]:
    steps = []
    for part in path.split("."):
        match = _FIELD.fullmatch(part)
        if match is None:
            raise LookupError(f"{path!r} is not a field path")
        steps.append((match[1], None if match[2] is None else int(match[2])))
    return tuple(steps)


def values(topic: Topic, message: Any) -> dict[str, float]:
    """Return the topic's signals by name; raises LookupError when a field or a joint is missing."""
    ordered = _in_order(topic, message)
    return {name: _value(ordered, field) for name, field in topic.fields.items()}


def _in_order(topic: Topic, message: Any) -> Any:
    """Return a JointState's numbers in the topic's order; without names they are in that order."""
    given = list(getattr(message, "name", ())) if topic.type == JOINT_STATE else []
    if not given or given == list(topic.names):
        return message
    for name in topic.names:
        if name not in given:
            raise LookupError(f"the message has no {name}, but {', '.join(given)}")
        if given.count(name) > 1:
            raise LookupError(f"the message names {name} more than once")
    order = [given.index(name) for name in topic.names]
    arrays = {name: getattr(message, name) for name in ("position", "velocity", "effort")}
    # an array that lacks one of them would put the others in the wrong places: as if not given
    return SimpleNamespace(
        **{
            name: [of[k] for k in order] if len(of) > max(order) else []
            for name, of in arrays.items()
        }
    )


def _value(message: Any, field: Field) -> float:
    try:
        return field_value(message, field.path)
    except LookupError:
        if field.absent is None:
            raise
        return field.absent


def stamp_ns(message: Any) -> int:
    """Return the message's header stamp in ns."""
    stamp = message.header.stamp
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def set_stamp(message: Any, stamp: int) -> None:
    """Stamp the message's header with a time in ns."""
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, NANOSECONDS)


@cache
def message_class(type_name: str) -> Any:
    """Return the rclpy class of a type such as `sensor_msgs/msg/JointState`."""
    package, _, name = type_name.split("/")
    return getattr(import_module(f"{package}.msg"), name)


def message(topic: Topic, stamp: int, signals: Mapping[str, float]) -> Any:
    """Return the topic's message, stamped in ns, from signals by name.

    Raises KeyError when a signal of the topic is missing.
    """
    result = message_class(topic.type)()
    set_stamp(result, stamp)
    result.header.frame_id = topic.frame
    arrays: dict[str, list[float]] = {}
    for name, field in topic.fields.items():
        *parents, (attribute, index) = _steps(field.path)
        if index is not None:
            arrays.setdefault(attribute, []).append(float(signals[name]))
            continue
        owner = result
        for parent, _ in parents:
            owner = getattr(owner, parent)
        setattr(owner, attribute, float(signals[name]))
    for attribute, numbers in arrays.items():
        setattr(result, attribute, numbers)
    if topic.type == JOINT_STATE:
        result.name = list(topic.names)
    return result

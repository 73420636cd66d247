"""The bytes on the wire against the middleware's own serializer, and against rosbags'."""

import math

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from rclpy.serialization import deserialize_message, serialize_message
from rosbags.typesys import Stores, get_typestore
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Header

from emir_msgs_py import conversions
from emir_msgs_py.topics import JOINT_STATES, TOPICS, TRUTH, Topic
from emir_ros.wire import Wire, clock_message, header_message, stamp_ns

STAMP = 12_345_678_901


def _signals(topic: Topic) -> dict[str, float]:
    return {name: (-1.0) ** k * 10.0 ** (k - 6) / 3.0 for k, name in enumerate(topic.fields)}


@pytest.mark.parametrize("topic", TOPICS, ids=lambda topic: topic.name)
def test_the_middleware_reads_what_is_written(topic: Topic) -> None:
    data = Wire(topic).encode(STAMP, _signals(topic))
    expected = conversions.message(topic, STAMP, _signals(topic))
    assert deserialize_message(data, type(expected)) == expected
    assert stamp_ns(data) == STAMP


@pytest.mark.parametrize("topic", TOPICS, ids=lambda topic: topic.name)
def test_nothing_stands_between_or_behind_the_fields(topic: Topic) -> None:
    data = Wire(topic).encode(STAMP, _signals(topic))
    types = get_typestore(Stores.ROS2_JAZZY)
    assert types.serialize_cdr(types.deserialize_cdr(data, topic.type), topic.type) == data


@pytest.mark.parametrize("topic", TOPICS, ids=lambda topic: topic.name)
def test_what_the_middleware_writes_is_read(topic: Topic) -> None:
    message = conversions.message(topic, STAMP, _signals(topic))
    assert Wire(topic).decode(serialize_message(message)) == _signals(topic)


@pytest.mark.parametrize("value", [math.nan, math.inf, -0.0, 5e-324])
def test_any_double_comes_through(value: float) -> None:
    wire = Wire(JOINT_STATES)
    shown = wire.decode(wire.encode(STAMP, {"angle": value}))["angle"]
    assert math.copysign(1.0, shown) == math.copysign(1.0, value)
    assert shown == value or (math.isnan(value) and math.isnan(shown))


def test_another_layout_is_left_to_the_middleware() -> None:
    message = conversions.message(JOINT_STATES, STAMP, {"angle": 0.5})
    for frame in ("base_linc", "somewhere else"):  # as long, and longer
        message.header.frame_id = frame
        assert Wire(JOINT_STATES).decode(serialize_message(message)) == {"angle": 0.5}
    message.name, message.position = ["joint1", "joint2"], [0.5, 0.7]
    assert Wire(JOINT_STATES).decode(serialize_message(message)) == {"angle": 0.5}


def test_a_signal_that_is_not_there_is_named() -> None:
    message = conversions.message(JOINT_STATES, STAMP, {"angle": 0.5})
    message.position = []
    with pytest.raises(LookupError, match=r"position\[0\]"):
        Wire(JOINT_STATES).decode(serialize_message(message))
    with pytest.raises(KeyError):
        Wire(TRUTH).encode(STAMP, {})


def test_a_time_alone_is_read_by_the_middleware() -> None:
    clock = deserialize_message(clock_message(STAMP), Clock).clock
    header = deserialize_message(header_message(STAMP), Header)
    assert (clock.sec, clock.nanosec) == divmod(STAMP, 10**9)
    assert header.stamp == clock
    assert not header.frame_id
    types = get_typestore(Stores.ROS2_JAZZY)
    read = types.deserialize_cdr(header_message(STAMP), "std_msgs/msg/Header")
    assert types.serialize_cdr(read, "std_msgs/msg/Header") == header_message(STAMP)

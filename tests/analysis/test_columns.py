"""Fields as columns: what `rosbags` wrote comes back, whatever shape the messages have."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from emir_analysis import columns
from emir_analysis.errors import InputError
from emir_analysis.thinning import thinned

STORE = get_typestore(Stores.ROS2_JAZZY)
TYPES = STORE.types
SECOND = 1_000_000_000
COUNT = 40


def _header(k: int, frame: str) -> Any:
    stamp = TYPES["builtin_interfaces/msg/Time"](sec=1_700_000_000 + k, nanosec=999_999_999 - k)
    return TYPES["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)


def _joints(k: int, random: np.random.Generator) -> Any:
    """Names and arrays of other lengths in every message, the size now and then the same."""
    count = 1 + int(random.integers(3))
    names = ["".join(random.choice(list("abc"), int(random.integers(1, 9)))) for _ in range(count)]
    numbers = [random.normal(size=n) for n in (count, int(random.integers(3)), 1)]
    return TYPES["sensor_msgs/msg/JointState"](_header(k, "x" * (k % 5)), names, *numbers)


def _imu(k: int, random: np.random.Generator) -> Any:
    """Nested, with arrays of a fixed length behind strings of any."""
    vector = TYPES["geometry_msgs/msg/Vector3"]
    quaternion = TYPES["geometry_msgs/msg/Quaternion"](*random.normal(size=4))
    parts = [(vector(*random.normal(size=3)), random.normal(size=9)) for _ in range(2)]
    return TYPES["sensor_msgs/msg/Imu"](
        _header(k, "y" * (k % 4)), quaternion, random.normal(size=9), *parts[0], *parts[1]
    )


def _joy(k: int, random: np.random.Generator) -> Any:
    """Single precision and integers."""
    axes = random.normal(size=3).astype(np.float32)
    buttons = random.integers(-5, 5, 2).astype(np.int32)
    return TYPES["sensor_msgs/msg/Joy"](_header(k, "joystick"), axes, buttons)


def _bare(k: int, random: np.random.Generator) -> Any:
    return TYPES["std_msgs/msg/Float64"](float(random.normal()))


CASES = {
    "sensor_msgs/msg/JointState": (_joints, {
        "position[0]": lambda m: m.position[0], "effort[0]": lambda m: m.effort[0],
    }),
    "sensor_msgs/msg/Imu": (_imu, {
        "angular_velocity.y": lambda m: m.angular_velocity.y,
        "linear_acceleration_covariance[8]": lambda m: m.linear_acceleration_covariance[8],
    }),
    "sensor_msgs/msg/Joy": (_joy, {
        "axes[2]": lambda m: m.axes[2], "buttons[1]": lambda m: m.buttons[1],
    }),
    "std_msgs/msg/Float64": (_bare, {"data": lambda m: m.data}),
}  # fmt: skip


def _written(folder: Path, kind: str, messages: list[Any], *, little_endian: bool = True) -> Path:
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/topic", kind, typestore=STORE)
        for k, message in enumerate(messages):
            data = STORE.serialize_cdr(message, kind, little_endian=little_endian)
            writer.write(connection, (k + 1) * SECOND, data)
    return folder


@pytest.mark.parametrize("order", ["little-endian", "big-endian"])
@pytest.mark.parametrize("kind", CASES)
def test_numbers_come_back_from_messages_of_any_shape(
    kind: str, order: str, tmp_path: Path
) -> None:
    make, fields = CASES[kind]
    random = np.random.default_rng(5)
    messages = [make(k, random) for k in range(COUNT)]
    little = order == "little-endian"
    bag = _written(tmp_path / "bag", kind, messages, little_endian=little)
    found = columns.read(bag, {"/topic": list(fields)})["/topic"]
    for path, get in fields.items():
        np.testing.assert_array_equal(found.values[path], [float(get(m)) for m in messages])
    log_times = [(k + 1) * SECOND for k in range(COUNT)]
    assert found.log_time.tolist() == log_times
    stamps = [
        m.header.stamp.sec * SECOND + m.header.stamp.nanosec if hasattr(m, "header") else log_time
        for m, log_time in zip(messages, log_times, strict=True)
    ]
    assert found.stamp.tolist() == stamps


def test_the_message_without_the_number_is_told(tmp_path: Path) -> None:
    random = np.random.default_rng(1)
    kind = "sensor_msgs/msg/Joy"
    messages = [_joy(k, random) for k in range(12)]
    messages[7].axes = messages[7].axes[:2]
    bag = _written(tmp_path / "bag", kind, messages)
    assert columns.read(bag, {"/topic": ["axes[1]"]})["/topic"].log_time.size == 12
    with pytest.raises(InputError, match=r"/topic: message 7 has no number in field axes\[2\]"):
        columns.read(bag, {"/topic": ["axes[2]"]})


def test_a_thinned_curve_keeps_every_pixels_peaks() -> None:
    time = np.linspace(0.0, 1.0, 100_003)
    value = np.sin(40.0 * time)
    peaks = [11, 50_000, 99_990]
    value[peaks] = [7.0, -9.0, 5.0]
    x, y = thinned(time, value, 500)
    assert x.size <= 4 * 500
    assert np.all(np.diff(x) > 0.0)
    assert set(zip(x, y, strict=True)) <= set(zip(time, value, strict=True))
    assert {7.0, -9.0, 5.0} <= set(y)
    assert (x[0], x[-1]) == (time[0], time[-1])
    edges = np.linspace(0, time.size, 501).astype(int)
    for low, high in pairwise(edges):
        shown = y[(x >= time[low]) & (x <= time[high - 1])]
        assert (shown.min(), shown.max()) == (value[low:high].min(), value[low:high].max())
    assert thinned(time[:2000], value[:2000], 500)[0].size == 2000

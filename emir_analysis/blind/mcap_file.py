"""Signals as stamped ROS 2 messages in one MCAP file."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from mcap_ros2.writer import Writer
from numpy.typing import NDArray

START = 1_700_000_000_000_000_000  # ns
_HEADER = """\
std_msgs/Header header
{fields}
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
_JOINT = "string[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort"
_PRESSURE = "float64 fluid_pressure\nfloat64 variance"


class Sampled(NamedTuple):
    """A signal. period: between samples, s. values: (n,). begin: stamp of the first, s."""

    period: float
    values: NDArray[np.float64]
    begin: float = 0.0


def write_signals(path: Path, topics: Mapping[str, Sampled]) -> None:
    """Write signals by topic: a pressure as `fluid_pressure`, any other as `position[0]`."""
    with path.open("wb") as stream, Writer(stream) as writer:
        joint = writer.register_msgdef("sensor_msgs/msg/JointState", _HEADER.format(fields=_JOINT))
        pressure = writer.register_msgdef(
            "sensor_msgs/msg/FluidPressure", _HEADER.format(fields=_PRESSURE)
        )
        for topic, signal in topics.items():
            schema = pressure if "pressure" in topic else joint
            for k, value in enumerate(signal.values.tolist()):
                ns = START + round((signal.begin + k * signal.period) * 1e9)
                stamp = {"sec": ns // 10**9, "nanosec": ns % 10**9}
                header = {"stamp": stamp, "frame_id": ""}
                if schema is pressure:
                    message = {"header": header, "fluid_pressure": value, "variance": 0.0}
                else:
                    message = {
                        "header": header,
                        "name": ["joint"],
                        "position": [value],
                        "velocity": [],
                        "effort": [],
                    }
                writer.write_message(topic, schema, message, ns, ns)

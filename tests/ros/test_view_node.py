"""`emir view --live`: what is published is what the page shows."""

import math
import socket
import time
from collections.abc import Iterator

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")
pytest.importorskip("viser", reason="needs the extra `view`")

import rclpy
from rclpy.executors import SingleThreadedExecutor

from emir_common.quantity import ParameterError
from emir_msgs_py.topics import CYLINDER_STATES, JOINT_STATES, PRESSURE_LIFTING
from emir_ros.shell import Shell
from emir_ros.view_node import ViewNode

SENT = [JOINT_STATES, CYLINDER_STATES, PRESSURE_LIFTING]
SIGNALS = {"angle": 0.8, "stroke": 0.3, "force": 1e5, "pressure_lifting": 1.1e7}
DEADLINE = 30.0  # s


@pytest.fixture
def port() -> Iterator[int]:
    """A port that nobody uses, and a running ROS."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        number = probe.getsockname()[1]
    rclpy.init()
    yield number
    rclpy.try_shutdown()


def test_the_page_shows_what_is_published(port: int) -> None:
    view = ViewNode(["--ros-args", "-p", f"port:={port}"])
    machine = Shell("machine", SENT)
    executor = SingleThreadedExecutor()
    executor.add_node(view)
    executor.add_node(machine)
    stamp = 0
    deadline = time.monotonic() + DEADLINE
    while "110.0" not in view.shown or "300.0" not in view.shown:
        assert time.monotonic() < deadline, view.shown
        stamp += 8_000_000
        for topic in SENT:
            machine.publish(topic, stamp, SIGNALS)
        executor.spin_once(timeout_sec=0.05)
    assert f"| joint angle | {math.degrees(0.8):.2f} | deg |" in view.shown
    assert "| valve | - | % |" in view.shown  # nobody publishes it
    view.close()


def test_a_port_that_is_taken_is_told(port: int) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", port))
        other.listen()
        with pytest.raises(ParameterError, match=f"view_node: --port {port}: Address already"):
            ViewNode(["--ros-args", "-p", f"port:={port}"])

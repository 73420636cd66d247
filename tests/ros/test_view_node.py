"""`emir view --live`: what is published is what the page shows."""

import itertools
import math
import socket
import threading
import time
from collections.abc import Callable

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")
pytest.importorskip("viser", reason="needs the extra `view`")

pytest.importorskip("playwright", reason="needs playwright and a browser")

from browser import page
from rclpy.executors import SingleThreadedExecutor
from waiting import until

from emir_analysis.view.robot import TOPICS as ROBOT_LIVE
from emir_common.quantity import ParameterError
from emir_msgs_py.robot_topics import JOINTS
from emir_msgs_py.topics import CYLINDER_STATES, JOINT1, JOINT_STATES, PRESSURE_LIFTING, ROBOT
from emir_ros import qos
from emir_ros.shell import Shell
from emir_ros.view_node import PERIOD, ViewNode
from emir_ros.view_node import SHOWN as LIVE

SENT = [JOINT_STATES, CYLINDER_STATES, PRESSURE_LIFTING]
SIGNALS = {"angle": 0.8, "stroke": 0.3, "force": 1e5, "pressure_lifting": 1.1e7}


@pytest.fixture
def port(ros: None) -> int:
    """A port that nobody uses, and a running ROS."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def test_the_page_shows_what_is_published(port: int, executor: SingleThreadedExecutor) -> None:
    view = ViewNode(["--ros-args", "-p", f"port:={port}"])
    machine = Shell("machine", SENT)
    executor.add_node(view)
    executor.add_node(machine)
    stamps = itertools.count(8_000_000, 8_000_000)

    def go_on() -> None:
        machine.publish_all(next(stamps), SIGNALS)
        executor.spin_once(timeout_sec=0.05)

    until(lambda: "110.0" in view.shown and "300.0" in view.shown, go_on, lambda: view.shown)
    assert f"| joint angle | {math.degrees(0.8):.2f} | deg |" in view.shown
    assert "| valve | - | % |" in view.shown  # nobody publishes it
    view.close()


def test_inactive_it_takes_nothing_in(port: int, executor: SingleThreadedExecutor) -> None:
    view = ViewNode(["--ros-args", "-p", f"port:={port}", "-p", "autostart:=false"])
    machine, ticks, heard = Shell("machine", SENT), [], []
    machine.hear(CYLINDER_STATES, heard.append, qos.requested(CYLINDER_STATES, lockstep=False))
    machine.create_timer(PERIOD, lambda: ticks.append(time.monotonic()))
    for node in (view, machine):
        executor.add_node(node)
    stamps = itertools.count(8_000_000, 8_000_000)

    def go_on() -> None:
        machine.publish_all(next(stamps), SIGNALS)
        executor.spin_once(timeout_sec=0.05)

    until(lambda: len(heard) > 20, go_on)
    ticks.clear()
    until(lambda: len(ticks) > 5, go_on)  # the page's own timer has come as often
    assert "300.0" not in view.shown
    view.trigger_configure()
    view.trigger_activate()
    until(lambda: "300.0" in view.shown, go_on)
    view.close()


def test_what_is_no_longer_published_is_no_longer_shown(
    port: int, executor: SingleThreadedExecutor
) -> None:
    """One topic that falls silent has a dash, all of them are told of; the next run is shown."""
    view = ViewNode(["--ros-args", "-p", f"port:={port}"])
    machine, other = Shell("machine", [CYLINDER_STATES]), Shell("other", [PRESSURE_LIFTING])
    for node in (view, machine, other):
        executor.add_node(node)
    stamps = itertools.count(5_000_000_000_000, 8_000_000)

    def publish_until(condition: Callable[[], bool], *nodes: Shell) -> None:
        def go_on() -> None:
            for node in nodes:
                node.publish_all(next(stamps), SIGNALS)
            executor.spin_once(timeout_sec=0.02)

        until(condition, go_on, lambda: (view.note, view.shown))

    publish_until(lambda: "nothing heard yet" in view.note)
    both = ("300.0", "110.0")
    publish_until(lambda: all(s in view.shown for s in both) and not view.note, machine, other)
    publish_until(lambda: "| lifting chamber | - |" in view.shown, machine)
    assert "300.0" in view.shown
    publish_until(lambda: "nothing heard for" in view.note)
    assert "300.0" in view.shown  # the last stays
    stamps = itertools.count(0, 8_000_000)
    publish_until(lambda: _time(view) < 1000.0 and not view.note, machine, other)
    view.close()


def _time(view: ViewNode) -> float:
    """Return the time on the page, s."""
    return float(view.shown.split("| time | ")[1].split()[0])


SHOWN = {
    JOINT1: (list(LIVE), {"angle": 0.8, "stroke": 0.3}, "joint angle"),
    ROBOT: (
        list(ROBOT_LIVE),
        {f"{joint}_angle": 0.8 if joint == "joint1" else -0.1 for joint in JOINTS},
        "joint1",
    ),
}


@pytest.mark.parametrize("model", SHOWN)
def test_a_browser_shows_the_running_graph(
    port: int, executor: SingleThreadedExecutor, model: str
) -> None:
    """What changes in the graph changes on the open page, and its controls do not stop it."""
    topics, given, name = SHOWN[model]
    everything = {signal: 0.1 for topic in topics for signal in topic.fields} | given
    view_node = ViewNode(["--ros-args", "-p", f"port:={port}", "-p", f"model:={model}"])
    machine = Shell("machine", topics)
    for node in (view_node, machine):
        executor.add_node(node)
    stamps = itertools.count(0, 8_000_000)
    machine.create_timer(0.02, lambda: machine.publish_all(next(stamps), everything))
    over = threading.Event()

    def spin() -> None:
        while not over.is_set():
            executor.spin_once(timeout_sec=0.05)

    spinning = threading.Thread(target=spin)
    spinning.start()
    try:
        with page() as view:
            view.goto(f"http://localhost:{port}")
            row = view.locator("tr", has=view.get_by_text(name, exact=True))
            row.get_by_text(f"{math.degrees(0.8):.2f}").wait_for()
            assert view.locator("canvas").count() >= 5  # the arm and the plots
            everything.update({key: 0.9 for key, value in given.items() if value == 0.8})
            row.get_by_text(f"{math.degrees(0.9):.2f}").wait_for()
            entry = view.locator("input[type=text]").first  # beside the bending's slider
            entry.fill("20")
            entry.press("Enter")
            everything.update({key: 1.0 for key, value in given.items() if value == 0.8})
            row.get_by_text(f"{math.degrees(1.0):.2f}").wait_for()  # it still goes on
    finally:
        over.set()
        spinning.join()
        view_node.close()


def test_a_port_that_is_taken_is_told(port: int) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", port))
        other.listen()
        with pytest.raises(ParameterError, match=f"view_node: --port {port}: Address already"):
            ViewNode(["--ros-args", "-p", f"port:={port}"])

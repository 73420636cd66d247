"""Nodes in real time on the /clock of a recording: its pace is theirs, and its pauses."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import waiting

pytest.importorskip("rclpy", reason="needs ROS 2")

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState
from sim_clock import SIM_TIME, SimClock

from emir_msgs_py.conversions import stamp_ns
from emir_msgs_py.topics import CONTROL_PERIOD_NS, VELOCITY_COMMAND
from emir_ros.cascade_node import CascadeNode
from emir_ros.plant_node import PlantNode
from emir_ros.replay_node import ReplayNode

pytestmark = pytest.mark.usefixtures("ros")

OWN_BAG = Path(__file__).parents[2] / "bags" / "lift"  # 3.2 s
END = 3_200_000_000  # ns
HOUR = 3600 * 1_000_000_000  # ns


def _words(**parameters: Any) -> list[str]:
    pairs = [("-p", f"{name}:={value}") for name, value in parameters.items()]
    return ["--ros-args", *(word for pair in pairs for word in pair)]


def test_a_controller_lives_in_the_recordings_time(executor: SingleThreadedExecutor) -> None:
    """Renamed and in a namespace as well; in its own time the inputs would be stale at once."""
    topics = "['/cylinder_reference','/cylinder_states']"
    replay = ReplayNode(
        [*_words(bag=OWN_BAG, topics=topics, rate=0.5, start_paused="true"), "-r", "__ns:=/left"]
    )
    cascade = CascadeNode(
        [
            *_words(use_sim_time="true"),
            "-r",
            "__ns:=/left",
            "-r",
            f"{VELOCITY_COMMAND.name}:=wanted/speed",
        ]
    )
    listener, stamps = Node("listener"), []
    listener.create_subscription(
        JointState, "/left/wanted/speed", lambda m: stamps.append(stamp_ns(m)), 100
    )
    nodes = (replay, cascade, listener)
    for node in nodes:
        executor.add_node(node)

    def until(condition: Callable[[], object]) -> None:
        waiting.until(condition, lambda: executor.spin_once(timeout_sec=0.01))

    try:
        until(lambda: cascade.count_publishers("/left/cylinder_reference") == 1)
        until(lambda: cascade.count_subscribers("/left/wanted/speed") == 1)
        assert not stamps  # the clock stands still
        replay._paused = False
        until(lambda: len(stamps) >= 3)
        replay._paused = True
        for _ in range(50):
            executor.spin_once(timeout_sec=0.01)
        standing = len(stamps)
        for _ in range(50):
            executor.spin_once(timeout_sec=0.01)
        assert len(stamps) == standing
        replay._paused = False
        until(lambda: replay.done)
        replay.check()
        assert len(stamps) > standing
        assert stamps[0] > 0
        assert stamps[-1] < END + 10 * CONTROL_PERIOD_NS
        assert stamps == sorted(stamps)
    finally:
        for node in nodes:
            node.destroy_node()


@pytest.mark.parametrize("jump", [0, -HOUR, 1000 * HOUR], ids=["on", "set back", "set on"])
def test_the_machine_lives_in_the_clocks_time(executor: SingleThreadedExecutor, jump: int) -> None:
    """A plant period of /clock is one of the machine, also after the clock was set."""
    listener, plant = Node("listener"), PlantNode(SIM_TIME)
    for node in (plant, listener):
        executor.add_node(node)
    clock = SimClock(listener, executor)
    try:
        for step in (1, jump + 1, 1):  # from the first on the node has a time
            clock.advance([plant], step)
        clock.settle()
        before = plant.tick
        for _ in range(50):
            clock.advance([plant])
            clock.settle()
        assert abs(plant.tick - before - 50) <= 1
        plant.check()
    finally:
        for node in (plant, listener):
            node.destroy_node()

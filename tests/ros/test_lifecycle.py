"""Nodes as lifecycle nodes: inactive ones do nothing, and deactivating shuts the valve."""

import gc
from collections.abc import Callable
from pathlib import Path

import pytest
import waiting

pytest.importorskip("rclpy", reason="needs ROS 2")

import rclpy
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter

from emir_common.quantity import ParameterError
from emir_msgs_py import conversions
from emir_msgs_py.topics import VALVE_COMMAND
from emir_ros.cascade_node import CascadeNode
from emir_ros.force_loop_node import ForceLoopNode
from emir_ros.plant_node import PlantNode
from emir_ros.trajectory_node import TrajectoryNode

LATER = ["--ros-args", "-p", "autostart:=false"]
AT_ONCE = ["--ros-args", "-p", "delay:=0.2", "-p", "distance:=0.2"]


def test_activated_and_deactivated_by_its_services() -> None:
    rclpy.init()
    client, valve = Node("client"), []
    kind = conversions.message_class(VALVE_COMMAND.type)
    client.create_subscription(kind, VALVE_COMMAND.name, lambda m: valve.append(m.position[0]), 10)
    loop = ForceLoopNode(LATER)
    nodes = [client, PlantNode(), TrajectoryNode(AT_ONCE), CascadeNode(), loop]
    executor = SingleThreadedExecutor()
    for node in nodes:
        executor.add_node(node)

    def until(condition: Callable[[], object]) -> None:
        waiting.until(condition, lambda: executor.spin_once(timeout_sec=0.02))

    def call(kind: type, name: str, request: object) -> object:
        service = client.create_client(kind, f"/force_loop_node/{name}")
        until(service.service_is_ready)
        future = service.call_async(request)
        until(future.done)
        return future.result()

    def change(transition: int) -> bool:
        request = ChangeState.Request(transition=Transition(id=transition))
        return call(ChangeState, "change_state", request).success

    def state() -> int:
        return call(GetState, "get_state", GetState.Request()).current_state.id

    try:
        assert state() == State.PRIMARY_STATE_UNCONFIGURED
        assert change(Transition.TRANSITION_CONFIGURE)
        assert state() == State.PRIMARY_STATE_INACTIVE
        assert valve == []
        assert change(Transition.TRANSITION_ACTIVATE)
        until(lambda: valve and valve[-1] > 0.3)
        assert not change(Transition.TRANSITION_CONFIGURE)  # an active one
        assert not change(99)
        assert state() == State.PRIMARY_STATE_ACTIVE
        assert change(Transition.TRANSITION_DEACTIVATE)
        until(lambda: valve[-1] == 0.0)
        assert state() == State.PRIMARY_STATE_INACTIVE  # with what was still under way
        count = len(valve)
        assert state() == State.PRIMARY_STATE_INACTIVE
        assert len(valve) == count
        assert change(Transition.TRANSITION_ACTIVATE)
        until(lambda: valve[-1] > 0.3)
        with pytest.raises(ParameterError, match="autostart: lock step needs every node"):
            CascadeNode([*LATER, "-p", "lockstep:=true"])
    finally:
        executor.shutdown()
        for node in nodes:
            node.destroy_node()
        rclpy.shutdown()


def test_the_clock_stays_what_it_was_at_the_start() -> None:
    """Else inputs would have no age where there is no /clock."""
    rclpy.init()
    node = ForceLoopNode()
    try:
        (answer,) = node.set_parameters([Parameter("use_sim_time", value=True)])
        assert not answer.successful
        assert "chosen at the start" in answer.reason
        assert not node.get_parameter("use_sim_time").value
    finally:
        node.destroy_node()
        rclpy.shutdown()


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="needs Linux's list of threads")
def test_a_destroyed_node_leaves_no_threads_behind() -> None:
    """As many as rclpy's own node: left at work, they may crash a process that ends."""

    def left_by(make: Callable[[], Node]) -> int:
        make().destroy_node()
        return len(list(Path("/proc/self/task").iterdir()))

    gc.collect()  # what a test before this one has left
    rclpy.init()
    try:
        plain = left_by(lambda: Node("plain"))
        assert left_by(CascadeNode) == plain
    finally:
        rclpy.shutdown()

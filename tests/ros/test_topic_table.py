"""The table of topics against the running graph: who publishes what, and of which type."""

import gc
import importlib
import importlib.util
import time
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

import rclpy
from rclpy.node import Node

from emir_msgs_py.topics import JOINT1, OFFERED_COMMANDS, ORDERS, RECORDED, ROBOT
from emir_ros.graph import CONTROLLERS, MODELS, NODES, ROBOT_CONTROLLERS
from emir_ros.shell import Shell

EVERYBODYS = {"/parameter_events", "/rosout", "/diagnostics", "/clock"}
FOR_THE_EYE = {"/robot_description", "/description_joint_states"}
OFFERED = {topic.name for topic in OFFERED_COMMANDS.values()}  # by one of several controllers


def _make(name: str, model: str, bag: Path) -> Shell:
    words = ["--ros-args", "-p", f"model:={model}"]
    if name == "recorder_node":
        words += ["-p", f"bag:={bag}"]
    module = importlib.import_module(f"emir_ros.{name}")
    return getattr(module, name.title().replace("_", ""))(words)


@pytest.mark.parametrize("model", [JOINT1, ROBOT])
def test_the_graph_publishes_what_the_table_says(model: str, tmp_path: Path) -> None:
    names = list(NODES)
    if model == ROBOT:
        pytest.importorskip("pinocchio", reason="pip install 'emir_ros[robot]'")
        others = {f"{name}_node" for name in CONTROLLERS.keys() - set(ROBOT_CONTROLLERS)}
        names = [name for name in names if name not in {*others, "selector_node"}]
    names = [name for name in names if _is_there(name)]
    gc.collect()  # else nodes of an earlier test may still be in the graph of this domain
    rclpy.init()
    nodes = [_make(name, model, tmp_path / "run") for name in names]
    observer = Node("observer")
    wanted = {
        (name, f"/{topic.name}", topic.type)
        for topic in MODELS[model]
        for name in topic.publishers
        if name in names and topic.name not in OFFERED
    }
    try:
        deadline = time.monotonic() + 120.0
        found = _published(observer, names)
        while not wanted <= found and time.monotonic() < deadline:
            rclpy.spin_once(observer, timeout_sec=0.1)
            found = _published(observer, names)
    finally:
        for node in nodes:
            node.close()
        for node in (observer, *nodes):
            node.destroy_node()
        rclpy.shutdown()
    beside = {f"/{RECORDED}", f"/{ORDERS}", *FOR_THE_EYE, *EVERYBODYS}
    beside |= {f"/{name}/transition_event" for name in names}
    assert {entry for entry in found if entry[1] not in beside} == wanted


def _is_there(name: str) -> bool:
    """Return whether a node has what it needs; the model predictive one asks for a solver."""
    return name != "mpc_node" or importlib.util.find_spec("osqp") is not None


def _published(observer: Node, names: list[str]) -> set[tuple[str, str, str]]:
    there = set(observer.get_node_names()) & set(names)
    return {
        (name, topic, kind)
        for name in there
        for topic, kinds in observer.get_publisher_names_and_types_by_node(name, "/")
        for kind in kinds
    }

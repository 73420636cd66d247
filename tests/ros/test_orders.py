"""What is ordered or set during a run in lock step is recorded with its period, and replayed."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

import numpy as np
from mcap.reader import make_reader
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from emir_analysis.cli import main
from emir_analysis.recorded_orders import orders
from emir_analysis.replay import replay
from emir_analysis.rosbag2_writer import Rosbag2Writer
from emir_analysis.run_signals import load_run
from emir_analysis.stamped import same
from emir_analysis.switching import Switch
from emir_msgs_py.topics import CONTROL_PERIOD, CONTROL_PERIOD_NS, ROBOT
from emir_ros.graph import Plan, ros_arguments
from emir_ros.main import make_executor
from emir_ros.run import _node_class

pytestmark = pytest.mark.usefixtures("ros")

AT_REST = 1e-6  # m/s


class Run:
    """A run in lock step in this process; `at` gives orders when the machine's time has come.

    The machine stands still until an order has reached its node.
    """

    def __init__(self, plan: Plan) -> None:
        self.client = Node("operator")
        self.nodes: dict[str, Any] = {}
        self._plan = plan
        self._due: list[tuple[float, Callable[[], Any]]] = []
        self._services = {
            verb: self.client.create_client(Trigger, f"/trajectory_node/{verb}")
            for verb in ("start", "hold", "stop")
        }
        self._waypoints = self.client.create_publisher(JointTrajectory, "joint_trajectory", 10)

    def at(self, time: float, order: Callable[[], Any]) -> None:
        """Give an order as soon as the machine is there, s."""
        self._due.append((time, order))

    def call(self, verb: str) -> Callable[[], Any]:
        """Return the order that calls a service; each order returns whether it was heard."""
        return lambda: self._services[verb].call_async(Trigger.Request()).done

    def send(self, names: list[str], place: list[float], seconds: int) -> Callable[[], Any]:
        """Return the order that sends one waypoint."""
        message = JointTrajectory(joint_names=names)
        message.points.append(JointTrajectoryPoint(positions=place))
        message.points[0].time_from_start.sec = seconds

        def order() -> Callable[[], bool]:
            node = self.nodes["trajectory_node"]
            before = node.waypoints_heard
            self._waypoints.publish(message)
            return lambda: node.waypoints_heard > before

        return order

    def set(self, node: str, name: str, value: Any) -> Callable[[], Any]:
        """Return the order that sets a parameter."""

        def order() -> Callable[[], bool]:
            self.nodes[node].set_parameters([Parameter(name, value=value)])
            return lambda: True

        return order

    def run(self) -> Path:
        """Run to the end; returns the recording."""
        with ros_arguments(self._plan) as words, make_executor() as executor:
            try:
                for name in self._plan.nodes:
                    self.nodes[name] = _node_class(name)(words)
                    if name != "plant_node":
                        executor.add_node(self.nodes[name])
                executor.add_node(self.client)
                while not self._heard():
                    executor.spin_once(timeout_sec=0.1)
                executor.add_node(self.nodes["plant_node"])
                while not self.nodes["plant_node"].done:
                    executor.spin_once(timeout_sec=0.1)
                    self._give_orders(executor)
                    for node in self.nodes.values():
                        node.check()
            finally:
                for node in (*self.nodes.values(), self.client):
                    getattr(node, "close", lambda: None)()
                    node.destroy_node()
        return self._plan.bag

    def _heard(self) -> bool:
        ready = all(service.service_is_ready() for service in self._services.values())
        return ready and self._waypoints.get_subscription_count() == 1

    def _give_orders(self, executor: Any) -> None:
        plant = self.nodes["plant_node"]
        while self._due and self._due[0][0] <= plant.last_stamp * 1e-9:
            executor.remove_node(plant)
            heard = self._due.pop(0)[1]()
            while not heard():
                executor.spin_once(timeout_sec=0.1)
            executor.add_node(plant)


def test_orders_and_settings_replay_bit_for_bit(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    run = Run(Plan(tmp_path / "run", duration=9.6))
    run.at(1.6, run.set("cascade_node", "gain", 1.0))
    run.at(1.8, run.set("force_loop_node", "gain", 5e-8))
    run.at(2.2, run.call("hold"))
    run.at(4.0, run.send(["cylinder1"], [0.42], 3))
    run.at(5.0, run.call("stop"))
    run.at(6.4, run.call("start"))
    bag = run.run()
    given = orders(bag, "trajectory_node")
    assert [order.what for order in given] == ["hold", "follow", "stop", "start"]
    assert all(order.stamp % CONTROL_PERIOD_NS == 0 for order in given)
    for order, earliest in zip(given, (2.2, 4.0, 5.0, 6.4), strict=True):
        assert earliest < order.stamp * 1e-9 <= earliest + 2.5 * CONTROL_PERIOD
    recorded = load_run(bag)["reference_velocity"]
    stopped = (recorded.time > given[2].stamp * 1e-9 + 0.8) & (recorded.time < 6.4)
    assert np.abs(recorded.value[stopped]).max() < AT_REST
    assert np.abs(recorded.value[recorded.time > 8.5]).max() > 0.02  # started anew
    for node in ("trajectory", "cascade", "force_loop", "plant"):
        assert same(replay(bag, node, {})), node
    capfd.readouterr()
    assert main(["replay", str(bag), "--node", "cascade"]) == 0
    first = capfd.readouterr().out.splitlines()[0]
    assert re.fullmatch(r"from 1\.\d+ s: set gain = 1\.0", first)
    unheard = _without(bag, tmp_path / "unheard", "/orders")
    assert not same(replay(unheard, "trajectory", {}))


def test_a_switch_by_hand_replays_bit_for_bit(tmp_path: Path) -> None:
    """Planned to pfc, by hand back to cascade: the selector and those whom it tells."""
    plan = Plan(tmp_path / "run", duration=3.2, switches=(Switch(1.6, "pfc"),))
    run = Run(plan)
    run.at(2.2, run.set("selector_node", "controller", "cascade"))
    bag = run.run()
    (order,) = orders(bag, "selector_node")
    for node in ("trajectory", "cascade", "pfc", "selector", "force_loop", "plant"):
        assert same(replay(bag, node, {})), node
    active = {f.name: f for f in replay(bag, "selector", {})}["cascade_active"].recorded
    after = order.stamp // CONTROL_PERIOD_NS
    assert active.tolist() == [1.0] * 50 + [0.0] * (after - 50) + [1.0] * (len(active) - after)


def test_what_was_set_without_its_period_is_refused(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Recordings of before, and of nodes that do not tell."""
    run = Run(Plan(tmp_path / "run", duration=1.6))
    run.at(0.6, run.set("cascade_node", "gain", 1.0))
    bag = _without(run.run(), tmp_path / "old", "/orders")
    assert main(["replay", str(bag), "--node", "cascade"]) == 1
    told = capfd.readouterr().err
    assert "cascade_node: gain was set during the run, and not from which period on" in told
    assert len(told.splitlines()) == 1
    assert main(["replay", str(bag), "--node", "trajectory"]) == 0


def test_orders_to_the_whole_robot_replay_bit_for_bit(tmp_path: Path) -> None:
    pytest.importorskip("pinocchio", reason="pip install 'emir_ros[robot]'")
    run = Run(Plan(tmp_path / "run", duration=3.2, model=ROBOT))
    run.at(0.9, run.set("cascade_node", "gain", 0.5))
    run.at(1.6, run.call("hold"))
    run.at(2.4, run.call("start"))
    bag = run.run()
    assert [order.what for order in orders(bag, "trajectory_node")] == ["hold", "start"]
    for node in ("trajectory", "cascade", "force_loop", "plant"):
        assert same(replay(bag, node, {})), node


def _without(bag: Path, folder: Path, topic: str) -> Path:
    """Return a copy that lacks a topic."""
    with (bag / "run_0.mcap").open("rb") as stream, Rosbag2Writer(folder) as writer:
        reader = make_reader(stream)
        for record in reader.iter_metadata():
            if record.name != "rosbag2":
                writer.add_metadata(record.name, record.metadata)
        for schema, channel, message in reader.iter_messages():
            if channel.topic == topic or schema is None:
                continue
            if channel.topic not in writer.topics:
                writer.add_topic(channel.topic, schema, channel.metadata)
            writer.write(channel.topic, message.data, message.log_time, message.publish_time)
    return folder

"""Time given to nodes on /clock, so that the computer's load has no part in a test."""

import time
from collections.abc import Collection

from rclpy.executors import SingleThreadedExecutor, TimeoutException
from rclpy.node import Node
from rosgraph_msgs.msg import Clock

from emir_msgs_py.topics import PLANT_PERIOD_NS
from emir_ros.wire import clock_message, sender

SIM_TIME = ["--ros-args", "-p", "use_sim_time:=true"]
DEADLINE = 120.0  # s, on a busy computer
QUIET = 0.002  # s


class SimClock:
    """The one who publishes /clock, by which nodes with `use_sim_time` live."""

    def __init__(self, node: Node, executor: SingleThreadedExecutor) -> None:
        """node: has the publisher; executor: spins the nodes that shall notice."""
        self.now = 3600 * 1_000_000_000  # ns
        self._executor = executor
        self._send = sender(node.create_publisher(Clock, "/clock", 10))

    def advance(self, nodes: Collection[Node], step: int = PLANT_PERIOD_NS) -> None:
        """Let time go on by a step, ns, and spin until the nodes have noticed."""
        self.now += step
        deadline = time.monotonic() + DEADLINE
        while any(node.get_clock().now().nanoseconds != self.now for node in nodes):
            assert time.monotonic() < deadline, "a node does not hear /clock"
            self._send(clock_message(self.now))  # again: one may have joined after the first
            self.settle()

    def settle(self) -> None:
        """Call back what is ready, and what gets ready by that, until nothing is for a while."""
        while True:
            try:
                call, *_ = self._executor.wait_for_ready_callbacks(timeout_sec=QUIET)
            except TimeoutException:
                return
            call()
            call.result()

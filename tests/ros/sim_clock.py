"""Time given to nodes on /clock, so that the computer's load has no part in a test."""

from collections.abc import Collection

from rclpy.executors import SingleThreadedExecutor, TimeoutException
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from waiting import until

from emir_msgs_py.topics import PLANT_PERIOD_NS
from emir_ros.wire import clock_message, sender

SIM_TIME = ["--ros-args", "-p", "use_sim_time:=true"]
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

        def noticed() -> bool:
            return all(node.get_clock().now().nanoseconds == self.now for node in nodes)

        def tell() -> None:  # again: one may have joined after the first
            self._send(clock_message(self.now))
            self.settle()

        until(noticed, tell, lambda: "a node does not hear /clock")

    def settle(self) -> None:
        """Call back what is ready, and what gets ready by that, until nothing is for a while."""
        while True:
            try:
                call, *_ = self._executor.wait_for_ready_callbacks(timeout_sec=QUIET)
            except TimeoutException:
                return
            call()
            call.result()

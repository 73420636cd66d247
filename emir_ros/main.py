"""How a node runs as a process of its own, and how it ends."""

import sys
from collections.abc import Callable
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

from emir_common.quantity import ParameterError
from emir_plant.plant import SimulationError
from emir_ros.shell import NodeFailure, Shell

try:
    from rclpy.experimental import EventsExecutor
except ImportError:  # an older Jazzy: everything works, lock step is slower
    EventsExecutor = SingleThreadedExecutor


def make_executor(lockstep: bool) -> Any:
    """Return the executor to spin with `spin_once`: lock step takes the faster, newer one."""
    return EventsExecutor() if lockstep else SingleThreadedExecutor()


def run(node_class: Callable[[], Shell]) -> None:
    """Run one node until it is done or told to stop by SIGINT or SIGTERM, then exit.

    Exit code 0; 1 with one line on standard error for a bad parameter or a node that failed.
    """
    sys.exit(_run(node_class))


def _run(node_class: Callable[[], Shell]) -> int:
    node: Shell | None = None
    try:
        rclpy.init()
        node = node_class()
        executor = make_executor(node.lockstep)
        executor.add_node(node)
        while rclpy.ok() and not node.done:
            executor.spin_once(timeout_sec=0.1)
    except (KeyboardInterrupt, ExternalShutdownException):
        return 0
    except (ParameterError, NodeFailure, SimulationError) as error:
        sys.stderr.write(f"{error}\n")
        return 1
    finally:
        if node is not None:
            node.close()
            node.destroy_node()
        rclpy.try_shutdown()
    return 0

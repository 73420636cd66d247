"""How a node runs as a process of its own, and how it ends."""

import gc
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from types import FrameType
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rclpy.utilities import remove_ros_args

from emir_ros.shell import FAILURES, NodeError, Shell, starting

try:
    from rclpy.experimental import EventsExecutor
except ImportError:  # an older Jazzy: everything works, but slower
    EventsExecutor = SingleThreadedExecutor

LOOK_PERIOD = 0.1  # s, between two looks at whether to stop
QUIET = 0.2  # s without a message, after which all that was sent counts as received
LONGEST_REST = 5.0  # s that is waited for that
LONGEST_END = 10  # s to the end of the process, once nothing is left that could be lost


class StopRequest:
    """SIGINT or SIGTERM, taken note of; whoever spins looks at it from time to time.

    rclpy's own handlers would shut the context down under a callback that is publishing.
    """

    def __init__(self) -> None:
        self.made = False
        signal.signal(signal.SIGINT, self._make)
        signal.signal(signal.SIGTERM, self._make)

    def _make(self, _number: int, _frame: FrameType | None) -> None:
        self.made = True


def start_ros() -> StopRequest:
    """Initialize rclpy; returns what SIGINT and SIGTERM set from now on.

    Before that: an exception out of it would leave a context that nobody shuts down.
    """
    stop = StopRequest()
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    return stop


@contextmanager
def make_executor() -> Iterator[Any]:
    """Give the newer executor, which has less to do per message.

    It is shut down before the nodes and the context are: left over, it may complain at exit.
    """
    executor: Any = EventsExecutor()
    try:
        yield executor
    finally:
        executor.shutdown()


@contextmanager
def out_of_garbage_collection() -> Iterator[None]:
    """Let the collector pass over what stands now.

    Going through all of that (libraries, nodes) takes longer than a control period.
    """
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


def spin(executor: Any, node: Shell, ended: Future, stop: StopRequest) -> None:
    """Spin until a node has ended; node: any of them, for a timer.

    Not message by message: entering and leaving the executor takes longer than many a callback.
    While messages keep coming it does not leave in time by itself, so a timer ends it; and it
    cannot be entered without a time: then it hangs. Raises KeyboardInterrupt when the process is
    told to stop.
    """

    def look() -> None:  # not the signal's handler: it may interrupt who holds the future's lock
        if stop.made and not ended.done():
            ended.set_result(None)

    timer = node.start_steady_timer(LOOK_PERIOD, look)
    while not ended.done():
        executor.spin_until_future_complete(ended, timeout_sec=LOOK_PERIOD)
    node.destroy_timer(timer)
    if stop.made:
        raise KeyboardInterrupt


def take_the_rest(executor: Any, *nodes: Shell) -> None:
    """Let nodes that hear everybody take what has arrived; the others are over."""
    hearing = [node for node in nodes if node.hears_everybody]
    if not hearing:
        return
    for node in nodes:
        if node not in hearing:
            executor.remove_node(node)
    heard, end = -1, time.monotonic() + LONGEST_REST
    while time.monotonic() < end and sum(node.heard for node in hearing) > heard:
        heard = sum(node.heard for node in hearing)
        quiet = time.monotonic() + QUIET
        while time.monotonic() < quiet:
            executor.spin_once(timeout_sec=QUIET)


def run(node_class: Callable[[], Shell]) -> None:
    """Run one node until it is done or told to stop by SIGINT or SIGTERM, then exit.

    Exit code 0; 1 with one line on standard error for a bad parameter or a node that failed. A
    process that the middleware does not let end is ended by SIGALRM.
    """
    sys.exit(_run(node_class))


def _check_words(words: list[str]) -> None:
    """Raise NodeError for words that no node knows: parameters without --ros-args among them."""
    if words:
        raise NodeError(
            f"cannot start: {' '.join(words)}: not known; parameters are given by"
            " --ros-args -p NAME:=VALUE"
        )


def _run(node_class: Callable[[], Shell]) -> int:
    node: Shell | None = None
    try:
        with starting():
            stop = start_ros()
            _check_words(remove_ros_args(sys.argv)[1:])
            node = node_class()
        with closing(node), make_executor() as executor:
            executor.add_node(node)
            with out_of_garbage_collection(), suppress(KeyboardInterrupt):
                spin(executor, node, node.ended, stop)
            node.check()
            take_the_rest(executor, node)
    except (KeyboardInterrupt, ExternalShutdownException):
        return 0
    except FAILURES as error:
        sys.stderr.write(f"{error}\n")
        return 1
    finally:
        if node is not None:
            # Where many nodes end at once, Fast DDS may wait for its own thread, and never get it.
            signal.alarm(LONGEST_END)
            node.destroy_node()
        rclpy.try_shutdown()
    return 0

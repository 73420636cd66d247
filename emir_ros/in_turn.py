"""Spinning the nodes of one process in lock step: their messages are taken in turn.

The middleware tells an executor of every message; that queues it, takes the message and looks up
whom to call, which takes longer than most callbacks. In lock step, with all nodes in one process,
somebody has a message to take until the run is over, so nobody has to be told: all subscriptions
are asked one after the other. Services and timers stay with the executor, which is entered from
time to time, and whenever there was no message.
"""

import time
from collections.abc import Sequence
from typing import Any

from rclpy.task import Future

from emir_ros.main import StopRequest
from emir_ros.shell import Shell

LOOK_PERIOD = 0.05  # s, between two looks at the executor while messages keep coming
REST = 0.001  # s, that it may wait for something when none came


def spin_in_turn(executor: Any, nodes: Sequence[Shell], ended: Future, stop: StopRequest) -> None:
    """Spin nodes until one has ended; quickest in the order in which they act.

    They must not be with the executor yet. Raises KeyboardInterrupt when the process is told to
    stop.
    """
    inputs = [
        (s.handle.take_message, s.msg_type, s.raw, s.callback)
        for node in nodes
        for s in node.subscriptions
    ]
    for node in nodes:
        node.taken_in_turn = True
        executor.add_node(node)
    look = 0.0
    while not ended.done():
        if stop.made:
            raise KeyboardInterrupt
        idle = True
        for take, kind, raw, receive in inputs:
            while (found := take(kind, raw)) is not None:
                receive(found[0])
                idle = False
        if idle or time.monotonic() > look:
            executor.spin_once(timeout_sec=REST if idle else 0.0)
            look = time.monotonic() + LOOK_PERIOD

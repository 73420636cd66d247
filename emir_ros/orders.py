"""What a node was ordered while it runs, on the topic `orders`, so that a replay can do the same.

A message is a DiagnosticArray of one status: the node's name, the order in `message`, what belongs
to it in `values` as JSON. Its stamp is, in lock step, the period from which the order is in force.
"""

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from emir_msgs_py.conversions import set_stamp
from emir_msgs_py.topics import ORDERS
from emir_ros import qos

if TYPE_CHECKING:
    from emir_ros.control_shell import ControlNode


class Orders:
    """Tells the orders of one node."""

    def __init__(self, node: "ControlNode") -> None:
        self._node = node
        self._publisher = node.create_publisher(DiagnosticArray, ORDERS, qos.offered(lockstep=True))

    def tell(self, order: str, values: Mapping[str, Any]) -> None:
        """Publish an order that the node has taken; values: what JSON can hold."""
        pairs = [KeyValue(key=key, value=json.dumps(value)) for key, value in values.items()]
        name = self._node.get_fully_qualified_name()
        array: Any = DiagnosticArray()
        set_stamp(array, self._node.next_stamp)
        array.status.append(DiagnosticStatus(name=name, message=order, values=pairs))
        self._publisher.publish(array)

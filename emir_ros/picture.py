"""What shows the machine in RViz: its description, and where all joints of that stand.

As robot_state_publisher wants them: `robot_description` (std_msgs/String, latched) and
`description_joint_states`, every joint of the description with the boom's bending in it. They
serve the eye alone: the topic table does without, and of them a recording keeps the description.
"""

from collections.abc import Callable, Mapping
from typing import Any

from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from emir_msgs_py.conversions import set_stamp
from emir_ros import qos

DESCRIPTION = "robot_description"


class Picture:
    """Publishes both; see above. positions: m or rad of all joints, by name."""

    def __init__(
        self, node: Node, description: str, positions: Callable[[], Mapping[str, float]]
    ) -> None:
        self._positions = positions
        self._description = node.create_publisher(String, DESCRIPTION, qos.latched())
        self._description.publish(String(data=description))
        profile = qos.offered(lockstep=False)
        self._joints = node.create_publisher(JointState, "description_joint_states", profile)

    def publish(self, stamp: int) -> None:
        """Publish where the joints are, stamped in ns, if anybody listens."""
        if not self._joints.get_subscription_count():
            return
        positions = self._positions()
        message: Any = JointState(name=list(positions), position=list(positions.values()))
        set_stamp(message, stamp)
        self._joints.publish(message)

"""What shows the whole robot in RViz: its description, and where all joints of that stand.

As robot_state_publisher wants them: `robot_description` (std_msgs/String, latched) and
`description_joint_states`, every joint of the description with the boom's bending in it. They
serve the eye alone; the topic table and recordings do without.
"""

from typing import Any

from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from emir_msgs_py.conversions import NANOSECONDS
from emir_plant.robot.actuators import SIZE
from emir_plant.robot.dynamics import Mechanics
from emir_plant.robot.urdf import joint_positions, urdf
from emir_ros import qos


class RobotPicture:
    """Publishes both; see above."""

    def __init__(self, node: Node, mechanics: Mechanics) -> None:
        self._mechanics = mechanics
        latched = qos.offered(lockstep=True)
        latched.depth = 1
        self._description = node.create_publisher(String, "robot_description", latched)
        self._description.publish(String(data=urdf(mechanics)))
        profile = qos.offered(lockstep=False)
        self._joints = node.create_publisher(JointState, "description_joint_states", profile)

    def publish(self, stamp: int, state: Any) -> None:
        """Publish the joints of the robot's state, stamped in ns, if anybody listens."""
        if not self._joints.get_subscription_count():
            return
        coordinates = state[SIZE : SIZE + self._mechanics.size]
        positions = joint_positions(self._mechanics, coordinates)
        message: Any = JointState(name=list(positions), position=list(positions.values()))
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, NANOSECONDS)
        self._joints.publish(message)

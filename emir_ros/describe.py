"""The machine's description on standard output, as plant_node would publish it.

    python3 -m emir_ros.describe --ros-args -p model:=robot --params-file FILE

It declares what plant_node declares and runs nothing.
"""

import sys
from collections.abc import Sequence

import rclpy
from rclpy.node import Node

from emir_common.quantity import ParameterError
from emir_msgs_py.topics import JOINT1, ROBOT
from emir_plant.boom_urdf import boom_urdf
from emir_plant.robot import require_pinocchio
from emir_ros.machines import declare_joint1, declare_whole_robot, robot_description
from emir_ros.node_parameters import declare


def description(node: Node) -> str:
    """Return the URDF of the machine that the node's parameters set up.

    Raises ParameterError.
    """
    model: str = declare(node, "model", JOINT1, f"{JOINT1} or {ROBOT}")
    if model == JOINT1:
        return boom_urdf(declare_joint1(node).geometry)
    if model != ROBOT:
        raise ParameterError(f"model {model!r}: there are {JOINT1}, {ROBOT}")
    require_pinocchio()
    from emir_plant.robot.dynamics import Mechanics  # noqa: PLC0415 (needs Pinocchio)

    return robot_description(Mechanics(declare_whole_robot(node)))


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the description; returns the exit code."""
    rclpy.init(args=None if arguments is None else list(arguments))
    node = Node("plant_node", enable_rosout=False, start_parameter_services=False)
    try:
        print(description(node))  # noqa: T201 (a command prints)
    except ParameterError as error:
        sys.stderr.write(f"emir_ros.describe: {error}\n")
        return 1
    finally:
        node.destroy_node()
        rclpy.shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())

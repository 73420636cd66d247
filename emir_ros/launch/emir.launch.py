"""The whole graph in real time, each node a process of its own.

ros2 launch emir_ros emir.launch.py bag:=my_run controller:=cascade namespace:=arm
ros2 launch emir_ros emir.launch.py bag:=my_run model:=robot

With `standby:=pfc` a second controller holds its state ready, and selector_node, whose parameter
`controller` may be set at any time, chooses. With `transforms:=true` robot_state_publisher gives
the frames of all links, bent as the arm is, for RViz and Foxglove.
"""

import sys
from pathlib import Path
from typing import List  # noqa: UP035 (see TEXTS)

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import (
    Command,
    LaunchConfiguration,
    NotEqualsSubstitution,
    PythonExpression,
)
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

PACKAGE = "emir_ros"
TEXTS = List[str]  # noqa: UP006 (launch takes list[str] for none)


def generate_launch_description() -> LaunchDescription:
    """Return the launch arguments and the nodes: five, or seven with a second controller."""
    config = Path(get_package_share_directory(PACKAGE)) / "config"
    parameters = [f"{config}/", LaunchConfiguration("model"), ".yaml"]
    controller, second = LaunchConfiguration("controller"), LaunchConfiguration("standby")
    two = NotEqualsSubstitution(second, "")
    if_two, as_bool = IfCondition(two), ParameterValue(two, value_type=bool)
    return LaunchDescription(
        [
            _argument("bag", None, "folder of the recording; must not exist"),
            _argument("controller", "cascade", "cascade, pfc, pfc_tip, lqg, mpc"),
            _argument("standby", "", "a second one beside it, to switch to; empty: none"),
            _argument("namespace", "", "namespace of all nodes and topics"),
            _argument("model", "joint1", "joint1, or robot: the whole robot, cascade or pfc"),
            _argument("params", parameters, "YAML file with the nodes' parameters"),
            _argument("transforms", "false", "frames on /tf, by robot_state_publisher"),
            _node("recorder_node", _recorded(controller, second)),
            _node("plant_node"),
            _node("force_loop_node", {"standby": as_bool}, _if_damped(controller, second)),
            _node([controller, "_node"], {"standby": as_bool}),
            _node([second, "_node"], {"standby": True}, if_two),
            _node("selector_node", _chosen_from(controller, second), if_two),
            _node("trajectory_node"),
            _transforms(),
        ]
    )


def _recorded(controller: LaunchConfiguration, second: LaunchConfiguration) -> dict[str, object]:
    """Return the recorder's parameters: what the recording says of itself."""
    nodes = [
        "['plant_node', 'trajectory_node', '", controller, "_node']",
        " + (['", second, "_node', 'selector_node'] if '", second, "' else [])",
        " + (['force_loop_node'] if ", *_damped(controller, second), " else [])",
    ]  # fmt: skip
    about = [
        '{"model": "', LaunchConfiguration("model"), '", "controller": "', controller,
        '", "standby": "', second, '", "time": "realtime"}',
    ]  # fmt: skip
    return {
        "bag": LaunchConfiguration("bag"),
        "nodes": ParameterValue(PythonExpression(nodes), value_type=TEXTS),
        "description": ParameterValue(about, value_type=str),
    }


def _chosen_from(controller: LaunchConfiguration, second: LaunchConfiguration) -> dict[str, object]:
    """Return the selector's parameters."""
    both = PythonExpression(["['", controller, "', '", second, "']"])
    return {"controller": controller, "controllers": ParameterValue(both, value_type=TEXTS)}


def _transforms() -> Node:
    """Return ROS's own node that turns description and joints into frames."""
    words = [
        f"{sys.executable} -P -m emir_ros.describe --ros-args -p model:=",
        LaunchConfiguration("model"),
        " --params-file ",
        LaunchConfiguration("params"),
    ]
    return Node(
        package="robot_state_publisher",
        executable="robot_state_publisher",
        namespace=LaunchConfiguration("namespace"),
        parameters=[{"robot_description": ParameterValue(Command(words), value_type=str)}],
        remappings=[("joint_states", "description_joint_states")],
        condition=IfCondition(LaunchConfiguration("transforms")),
        output="screen",
    )


def _if_damped(controller: LaunchConfiguration, second: LaunchConfiguration) -> IfCondition:
    return IfCondition(PythonExpression(_damped(controller, second)))


def _damped(controller: LaunchConfiguration, second: LaunchConfiguration) -> list[object]:
    """Return whether the force loop is there: lqg or mpc alone gives the valve command itself."""
    return ["('", second, "' != '' or '", controller, "' not in ('lqg', 'mpc'))"]


def _argument(
    name: str, default: str | list[object] | None, description: str
) -> DeclareLaunchArgument:
    return DeclareLaunchArgument(name, default_value=default, description=description)


def _node(
    executable: str | list[object],
    parameters: dict[str, object] | None = None,
    condition: IfCondition | None = None,
) -> Node:
    return Node(
        package=PACKAGE,
        executable=executable,
        namespace=LaunchConfiguration("namespace"),
        parameters=[
            LaunchConfiguration("params"),
            {"model": LaunchConfiguration("model")} | (parameters or {}),
        ],
        condition=condition,
        output="screen",
    )

"""The simulated machines behind plant_node: joint 1 alone or the whole robot, by their signals."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from rclpy.node import Node

from emir_analysis.control_protocols import Signals
from emir_analysis.node_controls import plant_signals
from emir_analysis.robot_setup import Posture
from emir_common.quantity import check_ranges, quantity
from emir_msgs_py.robot_topics import GROUND, ROBOT_VALVE_COMMAND
from emir_msgs_py.topics import VALVE_COMMAND, Topic
from emir_plant import core
from emir_plant.boom_urdf import bending, boom_urdf
from emir_plant.parameters import Machine as JointParameters
from emir_plant.parameters import cautions
from emir_plant.plant import Plant
from emir_plant.robot import require_pinocchio
from emir_plant.robot.actuators import SIZE
from emir_plant.robot.parameters import Robot
from emir_plant.sensors import measure
from emir_plant.sheet import joint1, load_sheet
from emir_ros.node_parameters import declare, declare_robot_sheet, declare_tree
from emir_ros.picture import Picture


class Machine(Protocol):
    """What plant_node steps."""

    command: Topic
    plant: Any
    state: Any
    truth: Any

    def step(self, commands: Signals, dt: float) -> None:
        """Go on by dt, s, under the signals of the command topic."""

    def signals(self, tick: int) -> Signals:
        """Return the signals of sensors and truth at a plant period."""

    def show(self, stamp: int) -> None:
        """Publish what is for the eye alone, stamped in ns."""


@dataclass(frozen=True, kw_only=True)
class Joint1Start:
    """Where joint 1 stands."""

    initial_angle: float = quantity("rad", -0.5, 1.6, "boom angle at the start",
                                    default=math.pi / 4)  # fmt: skip

    def __post_init__(self) -> None:
        check_ranges(self)


@dataclass(frozen=True, kw_only=True)
class RobotStart:
    """Where the robot stands."""

    initial_angles: Posture = Posture()


def declare_joint1(node: Node) -> JointParameters:
    """Declare joint 1's file and parameters; return the machine as they set it up."""
    sheet = declare(node, "machine_file", "", "YAML of the machine; empty: EMIR's joint 1")
    return declare_tree(node, load_sheet(Path(sheet)).machine if sheet else joint1())


def declare_whole_robot(node: Node) -> Robot:
    """Declare the robot's files and parameters; return it as they set it up."""
    return declare_tree(node, declare_robot_sheet(node), without="main.")


def robot_description(mechanics: Any) -> str:
    """Return the robot as URDF, its root by the name that messages give the ground."""
    from emir_plant.robot.urdf import urdf  # noqa: PLC0415 (needs Pinocchio)

    return urdf(mechanics).replace('"world"', f'"{GROUND}"')


class Joint1Machine:
    """Joint 1, boom stretched, set up by the node's parameters."""

    command = VALVE_COMMAND

    def __init__(self, node: Node, pressure_lowering: float) -> None:
        start = declare_tree(node, Joint1Start())
        self.plant = Plant(declare_joint1(node))
        for line in cautions(self.plant.machine):
            node.get_logger().warning(line)
        self.state = self.plant.initial(start.initial_angle, pressure_lowering)
        self.truth = self.plant.outputs(self.state)
        geometry = self.plant.machine.geometry
        self._bending = bending(geometry)
        self._picture = Picture(node, boom_urdf(geometry), self._positions)

    def step(self, commands: Signals, dt: float) -> None:
        """Go on by dt, s."""
        self.state, self.truth = self.plant.step(self.state, commands["valve_command"], dt)

    def signals(self, tick: int) -> Signals:
        """Return the signals of sensors and truth at a plant period."""
        reading = measure(self.plant, self.truth, tick, self.state)
        return plant_signals(reading, self.truth)

    def show(self, stamp: int) -> None:
        """Publish the joints of the description, stamped in ns."""
        self._picture.publish(stamp)

    def _positions(self) -> Signals:
        names, angles = self._bending
        modes = angles.shape[1]
        position = angles @ self.state[core.MODES : core.MODES + modes]
        return dict(zip(names, position.tolist(), strict=True))


class RobotMachine:
    """The whole robot, set up by the node's parameters.

    Those of its main joint have the names that joint 1's own model has. Raises ParameterError
    without Pinocchio.
    """

    command = ROBOT_VALVE_COMMAND

    def __init__(self, node: Node, pressure_lowering: float) -> None:
        require_pinocchio()
        from emir_analysis import robot_machine  # noqa: PLC0415 (needs Pinocchio)
        from emir_plant.robot.plant import RobotPlant  # noqa: PLC0415
        from emir_plant.robot.urdf import joint_positions  # noqa: PLC0415

        self._by_signals = robot_machine
        start = declare_tree(node, RobotStart()).initial_angles
        self.plant = RobotPlant(declare_whole_robot(node))
        for line in cautions(self.plant.robot.main):
            node.get_logger().warning(line)
        self.state = self.plant.initial(start.angles, pressure_lowering)
        mechanics = self.plant.mechanics

        def positions() -> Signals:
            return joint_positions(mechanics, self.state[SIZE : SIZE + mechanics.size])

        self._picture = Picture(node, robot_description(mechanics), positions)
        self.truth = self.plant.outputs(self.state)

    def step(self, commands: Signals, dt: float) -> None:
        """Go on by dt, s."""
        valves = self._by_signals.commands(commands)
        self.state, self.truth = self.plant.step(self.state, valves, dt)

    def signals(self, tick: int) -> Signals:
        """Return the signals of sensors and truth at a plant period."""
        return self._by_signals.sensor_signals(self.plant, self.truth, tick)

    def show(self, stamp: int) -> None:
        """Publish the joints of the description, stamped in ns."""
        self._picture.publish(stamp)

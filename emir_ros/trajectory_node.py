"""trajectory_node: the desired motion of the pistons, from where the machine stands."""

from collections.abc import Sequence
from typing import Any

from emir_analysis.node_controls import NodeControl, TrajectoryControl
from emir_analysis.robot_controls import RobotTrajectoryControl
from emir_analysis.robot_setup import path_parameters, trajectory
from emir_control.trajectory import TrajectoryParameters, named
from emir_msgs_py.topics import ROBOT
from emir_ros.main import run
from emir_ros.node_parameters import declare, declare_robot, declare_tree, reject_unknown
from emir_ros.shell import ControlNode, Signals


class TrajectoryNode(ControlNode):
    """cylinder_states -> cylinder_reference, cylinder_preview.

    Of the whole robot: joint_states -> cylinder_reference, tcp_reference.
    """

    def __init__(self, arguments: Sequence[str] | None = None) -> None:
        mine, six = TrajectoryControl, RobotTrajectoryControl
        super().__init__("trajectory_node", mine.inputs, mine.outputs, arguments, six)
        known = "lift-lower, lower-lift or hold; of the whole robot also line"
        name = declare(self, "trajectory", "lift-lower", known)
        move = declare_tree(self, TrajectoryParameters())
        self.law: NodeControl
        if self.model == ROBOT:
            sheet = declare_robot(self)
            path = declare_tree(self, path_parameters(sheet))
            self.law = six(trajectory(sheet, name, move, path))
        else:
            self.law = mine(named(name, move))
        self.state: Any = None
        reject_unknown(self)

    def control(self, signals: Signals, dt: float) -> Signals:
        """Return the reference of this control period and of the next ones."""
        self.state, outputs = self.law.step(self.state, signals, dt)
        return outputs


def main() -> None:
    """Run the node until it is stopped."""
    run(TrajectoryNode)


if __name__ == "__main__":
    main()

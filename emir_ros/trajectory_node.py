"""trajectory_node: the desired piston motion, from where the machine stands."""

from collections.abc import Sequence
from typing import Any

from emir_analysis.node_controls import TrajectoryControl
from emir_control.trajectory import TrajectoryParameters, named
from emir_ros.main import run
from emir_ros.node_parameters import declare, declare_tree, reject_unknown
from emir_ros.shell import ControlNode, Signals


class TrajectoryNode(ControlNode):
    """cylinder_states -> cylinder_reference, cylinder_preview."""

    def __init__(self, arguments: Sequence[str] | None = None) -> None:
        super().__init__(
            "trajectory_node", TrajectoryControl.inputs, TrajectoryControl.outputs, arguments
        )
        name = declare(self, "trajectory", "lift-lower", "lift-lower, lower-lift or hold")
        self.law = TrajectoryControl(named(name, declare_tree(self, TrajectoryParameters())))
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

"""lqg_node: LQG control of the boom about a planned move; gives the valve command itself."""

from collections.abc import Sequence
from typing import Any

from emir_analysis.machine_model import lqg_parameters
from emir_analysis.node_controls import LqgControl
from emir_control.lqg import Lqg
from emir_plant.sheet import joint1
from emir_ros.main import run
from emir_ros.node_parameters import declare_tree, reject_unknown
from emir_ros.shell import ControlNode, Signals


class LqgNode(ControlNode):
    """Reference, move, joint_states, pressures, boom_deflection -> valve_command, lqg/terms."""

    def __init__(self, arguments: Sequence[str] | None = None) -> None:
        super().__init__("lqg_node", LqgControl.inputs, LqgControl.outputs, arguments)
        self.law = LqgControl(Lqg(declare_tree(self, lqg_parameters(joint1()))))
        self.state: Any = None
        reject_unknown(self)

    def control(self, signals: Signals, dt: float) -> Signals:
        """Return command and terms of this control period."""
        self.state, outputs = self.law.step(self.state, signals, dt)
        return outputs

    def stale(self, missing: Sequence[str]) -> None:
        """Publish nothing, so that the valve shuts; the control begins anew afterwards."""
        self.state = None


def main() -> None:
    """Run the node until it is stopped."""
    run(LqgNode)


if __name__ == "__main__":
    main()

"""lqg_node: LQG control of the boom about a planned move; gives the valve command itself."""

from collections.abc import Sequence

from emir_analysis.machine_model import lqg_parameters
from emir_analysis.node_controls import LqgControl
from emir_control.lqg import Lqg
from emir_plant.sheet import joint1
from emir_ros.main import run
from emir_ros.node_parameters import declare_tree, reject_unknown
from emir_ros.shell import ControlNode


class LqgNode(ControlNode):
    """Reference, move, joint_states, pressures, boom_deflection -> valve_command, lqg/terms."""

    def __init__(self, arguments: Sequence[str] | None = None) -> None:
        super().__init__("lqg_node", LqgControl.inputs, LqgControl.outputs, arguments)
        self.law = LqgControl(Lqg(declare_tree(self, lqg_parameters(joint1()))))
        reject_unknown(self)


def main() -> None:
    """Run the node until it is stopped."""
    run(LqgNode)


if __name__ == "__main__":
    main()

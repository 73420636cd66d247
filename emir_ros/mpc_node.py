"""mpc_node: model predictive control about a planned move; gives the valve command itself."""

from collections.abc import Sequence

from emir_analysis.machine_model import lqg_parameters
from emir_analysis.node_controls import MpcControl
from emir_control.mpc import Mpc
from emir_plant.sheet import joint1
from emir_ros.main import run
from emir_ros.node_parameters import declare_tree, reject_unknown
from emir_ros.shell import ControlNode


class MpcNode(ControlNode):
    """Reference, move, joint_states, pressures, boom_deflection -> valve_command, mpc/terms."""

    def __init__(self, arguments: Sequence[str] | None = None) -> None:
        super().__init__("mpc_node", MpcControl.inputs, MpcControl.outputs, arguments)
        self.law = MpcControl(Mpc(declare_tree(self, lqg_parameters(joint1()))))
        reject_unknown(self)


def main() -> None:
    """Run the node until it is stopped."""
    run(MpcNode)


if __name__ == "__main__":
    main()

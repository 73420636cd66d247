"""lqg_node: LQG control of the boom about a planned move; gives the valve command itself."""

from collections.abc import Sequence
from typing import ClassVar

import scipy.optimize  # noqa: F401 - loaded here, not when the first move is planned

from emir_analysis.control_protocols import Signals
from emir_analysis.machine_model import lqg_parameters
from emir_analysis.node_controls import LqgControl
from emir_control.lqg import Lqg
from emir_plant.sheet import joint1
from emir_ros.control_shell import ControlNode
from emir_ros.main import run
from emir_ros.node_parameters import declare_tree, reject_unknown


class LqgNode(ControlNode):
    """Reference, move, joint_states, pressures, boom_deflection -> valve_command, lqg/terms."""

    control_class: ClassVar[type[LqgControl]] = LqgControl
    law_class: ClassVar[type[Lqg]] = Lqg

    def __init__(self, arguments: Sequence[str] | None = None) -> None:
        kind = self.control_class
        super().__init__(f"{kind.name}_node", kind.inputs, kind.outputs, arguments)
        law = kind(self.law_class(declare_tree(self, lqg_parameters(joint1()))))
        self.law = self.standing_by(law)
        reject_unknown(self)

    def caution(self, outputs: Signals) -> str:
        """Return why the outputs are not what was asked for, if they are not."""
        limited = outputs[f"{self.control_class.name}_limited"] == 1.0
        return "held off the end of the stroke" if limited else ""


def main() -> None:
    """Run the node until it is stopped."""
    run(LqgNode)


if __name__ == "__main__":
    main()

"""cascade_node: conventional position control of the piston, law (11), or of all six."""

from collections.abc import Sequence

from emir_analysis.node_controls import CascadeControl
from emir_analysis.robot_controls import RobotCascadeControl
from emir_analysis.robot_setup import cascade_parameters
from emir_control.cascade import Cascade, CascadeParameters
from emir_msgs_py.topics import ROBOT
from emir_ros.control_shell import ControlNode
from emir_ros.live_parameters import LiveParameters
from emir_ros.main import run
from emir_ros.node_parameters import declare_tree, reject_unknown

LIVE = ("gain", "time_constant")


class CascadeNode(ControlNode):
    """cylinder_reference, cylinder_states -> velocity_command, cascade/terms."""

    def __init__(self, arguments: Sequence[str] | None = None) -> None:
        mine, six = CascadeControl, RobotCascadeControl
        super().__init__("cascade_node", mine.inputs, mine.outputs, arguments, six)
        robot = self.model == ROBOT
        default = cascade_parameters() if robot else CascadeParameters()
        parameters = declare_tree(self, default, live=LIVE)

        def tune(parameters: CascadeParameters) -> None:
            law = Cascade(parameters)
            self.law = six(law) if robot else self.standing_by(mine(law))

        tune(parameters)
        LiveParameters(self, parameters, LIVE, tune)
        reject_unknown(self)


def main() -> None:
    """Run the node until it is stopped."""
    run(CascadeNode)


if __name__ == "__main__":
    main()

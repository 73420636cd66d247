"""pfc_node: predictive functional control of the piston's stroke, law (12), or of all six."""

from collections.abc import Sequence

from emir_analysis.node_controls import PfcControl
from emir_analysis.robot_controls import RobotPfcControl
from emir_analysis.robot_setup import pfc_parameters
from emir_control.pfc import Pfc, PfcParameters
from emir_control.pfc_file import STROKE
from emir_control.scheduled_pfc import law_of
from emir_msgs_py.topics import ROBOT
from emir_ros.control_shell import ControlNode
from emir_ros.live_parameters import LiveParameters
from emir_ros.main import run
from emir_ros.node_parameters import declare_pfc, declare_tree, reject_unknown

LIVE = ("response_time", "speed_limit", "acceleration_limit")


class PfcNode(ControlNode):
    """cylinder_reference, cylinder_preview, cylinder_states -> velocity_command, pfc/terms."""

    def __init__(self, arguments: Sequence[str] | None = None) -> None:
        mine, six = PfcControl, RobotPfcControl
        super().__init__("pfc_node", mine.inputs, mine.outputs, arguments, six)
        robot = self.model == ROBOT
        if robot:
            parameters = declare_tree(self, pfc_parameters(), live=LIVE)
        else:
            parameters = declare_pfc(self, STROKE, LIVE)

        def tune(parameters: PfcParameters) -> None:
            self.law = six(Pfc(parameters)) if robot else self.standing_by(mine(law_of(parameters)))

        tune(parameters)
        LiveParameters(self, parameters, LIVE, tune)
        reject_unknown(self)


def main() -> None:
    """Run the node until it is stopped."""
    run(PfcNode)


if __name__ == "__main__":
    main()

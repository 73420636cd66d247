"""pfc_tip_node: predictive functional control of the TCP's angle alpha_6 (paper 3.3)."""

from collections.abc import Sequence

from emir_analysis.node_controls import PfcTipControl
from emir_control.pfc import PfcParameters
from emir_control.pfc_file import TIP_ANGLE
from emir_control.scheduled_pfc import law_of
from emir_control.tip import Tip
from emir_ros.control_shell import ControlNode
from emir_ros.live_parameters import LiveParameters
from emir_ros.main import run
from emir_ros.node_parameters import declare_pfc, reject_unknown

LIVE = ("response_time", "speed_limit", "acceleration_limit")


class PfcTipNode(ControlNode):
    """cylinder_reference and _preview, joint_states, boom_deflection -> velocity_command, terms."""

    def __init__(self, arguments: Sequence[str] | None = None) -> None:
        super().__init__("pfc_tip_node", PfcTipControl.inputs, PfcTipControl.outputs, arguments)
        parameters = declare_pfc(self, TIP_ANGLE, LIVE)

        def tune(parameters: PfcParameters) -> None:
            self.law = self.standing_by(PfcTipControl(Tip(law_of(parameters))))

        tune(parameters)
        LiveParameters(self, parameters, LIVE, tune)
        reject_unknown(self)


def main() -> None:
    """Run the node until it is stopped."""
    run(PfcTipNode)


if __name__ == "__main__":
    main()

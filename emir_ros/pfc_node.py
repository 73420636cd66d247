"""pfc_node: predictive functional control of the piston's stroke, law (12)."""

from collections.abc import Sequence

from emir_analysis.node_controls import PfcControl
from emir_control.pfc import PfcParameters
from emir_control.pfc_file import STROKE
from emir_control.scheduled_pfc import law_of
from emir_ros.live_parameters import LiveParameters
from emir_ros.main import run
from emir_ros.node_parameters import declare_pfc, reject_unknown
from emir_ros.shell import ControlNode

LIVE = ("response_time", "speed_limit", "acceleration_limit")


class PfcNode(ControlNode):
    """cylinder_reference, cylinder_preview, cylinder_states -> velocity_command, pfc/terms."""

    def __init__(self, arguments: Sequence[str] | None = None) -> None:
        super().__init__("pfc_node", PfcControl.inputs, PfcControl.outputs, arguments)
        parameters = declare_pfc(self, STROKE, LIVE)

        def tune(parameters: PfcParameters) -> None:
            self.law = self.standing_by(PfcControl(law_of(parameters)))

        tune(parameters)
        LiveParameters(self, parameters, LIVE, tune)
        reject_unknown(self)


def main() -> None:
    """Run the node until it is stopped."""
    run(PfcNode)


if __name__ == "__main__":
    main()

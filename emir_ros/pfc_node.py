"""pfc_node: predictive functional control of the piston's stroke, law (12)."""

from collections.abc import Sequence

from emir_analysis.outer_loop import pfc_signals
from emir_control.pfc import Pfc, PfcInputs, PfcState
from emir_control.pfc_file import STROKE
from emir_msgs_py.topics import (
    CYLINDER_PREVIEW,
    CYLINDER_REFERENCE,
    CYLINDER_STATES,
    PFC_TERMS,
    VELOCITY_COMMAND,
)
from emir_ros.main import run
from emir_ros.node_parameters import declare_pfc, reject_unknown
from emir_ros.shell import ControlNode, Signals

INPUTS = [CYLINDER_REFERENCE, CYLINDER_PREVIEW, CYLINDER_STATES]


class PfcNode(ControlNode):
    """cylinder_reference, cylinder_preview, cylinder_states -> velocity_command, pfc/terms."""

    def __init__(self, arguments: Sequence[str] | None = None) -> None:
        super().__init__("pfc_node", INPUTS, [PFC_TERMS, VELOCITY_COMMAND], arguments)
        self.pfc = Pfc(declare_pfc(self, STROKE))
        self.state: PfcState | None = None
        reject_unknown(self)

    def control(self, signals: Signals, dt: float) -> Signals:
        """Return command and terms of this control period."""
        inputs = PfcInputs(
            signals["reference_stroke"],
            signals["reference_velocity"],
            [signals[name] for name in CYLINDER_PREVIEW.fields],
            signals["stroke"],
        )
        self.state, outputs = self.pfc.step(self.state or self.pfc.initial(inputs), inputs, dt)
        return pfc_signals("pfc", outputs)

    def stale(self, missing: Sequence[str]) -> None:
        """Publish nothing, so that the valve shuts; the model starts anew afterwards."""
        self.state = None


def main() -> None:
    """Run the node until it is stopped."""
    run(PfcNode)


if __name__ == "__main__":
    main()

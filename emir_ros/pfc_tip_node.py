"""pfc_tip_node: predictive functional control of the TCP's angle alpha_6 (paper 3.3)."""

from collections.abc import Sequence

from emir_analysis.outer_loop import pfc_signals
from emir_control.pfc import Pfc
from emir_control.pfc_file import TIP_ANGLE
from emir_control.tip import Tip, TipInputs, TipState
from emir_control.trajectory import Reference
from emir_msgs_py.topics import (
    BOOM_DEFLECTION,
    CYLINDER_PREVIEW,
    CYLINDER_REFERENCE,
    JOINT_STATES,
    PFC_TIP_TERMS,
    VELOCITY_COMMAND,
)
from emir_ros.main import run
from emir_ros.node_parameters import declare_pfc, reject_unknown
from emir_ros.shell import ControlNode, Signals

INPUTS = [CYLINDER_REFERENCE, CYLINDER_PREVIEW, JOINT_STATES, BOOM_DEFLECTION]


class PfcTipNode(ControlNode):
    """cylinder_reference and _preview, joint_states, boom_deflection -> velocity_command, terms."""

    def __init__(self, arguments: Sequence[str] | None = None) -> None:
        super().__init__("pfc_tip_node", INPUTS, [PFC_TIP_TERMS, VELOCITY_COMMAND], arguments)
        self.tip = Tip(Pfc(declare_pfc(self, TIP_ANGLE)))
        self.state: TipState | None = None
        reject_unknown(self)

    def control(self, signals: Signals, dt: float) -> Signals:
        """Return command and terms of this control period."""
        inputs = TipInputs(
            Reference(signals["reference_stroke"], signals["reference_velocity"]),
            [signals[name] for name in CYLINDER_PREVIEW.fields],
            signals["angle"],
            signals["deflection"],
        )
        self.state, outputs = self.tip.step(self.state or self.tip.initial(inputs), inputs, dt)
        return pfc_signals("pfc_tip", outputs)

    def stale(self, missing: Sequence[str]) -> None:
        """Publish nothing, so that the valve shuts; the model starts anew afterwards."""
        self.state = None


def main() -> None:
    """Run the node until it is stopped."""
    run(PfcTipNode)


if __name__ == "__main__":
    main()

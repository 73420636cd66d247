"""force_loop_node: force feedback and static prefilter, from wanted velocity to valve current."""

from collections.abc import Sequence
from typing import Any

from emir_analysis.node_controls import ForceLoopControl, force_loop_signals
from emir_control.force_loop import ForceLoop, ForceLoopOutputs, ForceLoopParameters
from emir_ros.main import run
from emir_ros.node_parameters import declare_tree, reject_unknown
from emir_ros.shell import ControlNode, Signals

SHUT = ForceLoopOutputs(0.0, float("nan"), 0.0, 0.0, False)


class ForceLoopNode(ControlNode):
    """velocity_command, joint_states, pressures -> valve_command, force_loop/terms.

    Without fresh inputs it shuts the valve.
    """

    def __init__(self, arguments: Sequence[str] | None = None) -> None:
        super().__init__(
            "force_loop_node", ForceLoopControl.inputs, ForceLoopControl.outputs, arguments
        )
        self.law = ForceLoopControl(ForceLoop(declare_tree(self, ForceLoopParameters())))
        self.state: Any = None
        reject_unknown(self)

    def control(self, signals: Signals, dt: float) -> Signals:
        """Return command and terms of this control period."""
        self.state, outputs = self.law.step(self.state, signals, dt)
        return outputs

    def stale(self, missing: Sequence[str]) -> Signals:
        """Return the command that shuts the valve; the damping starts anew afterwards."""
        self.state = None
        return force_loop_signals(SHUT)


def main() -> None:
    """Run the node until it is stopped."""
    run(ForceLoopNode)


if __name__ == "__main__":
    main()

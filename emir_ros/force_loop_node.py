"""force_loop_node: force feedback and static prefilter, from wanted velocity to valve current."""

from collections.abc import Sequence

from emir_control.force_loop import (
    ForceLoop,
    ForceLoopInputs,
    ForceLoopOutputs,
    ForceLoopParameters,
    ForceLoopState,
)
from emir_msgs_py.topics import (
    FORCE_LOOP_TERMS,
    JOINT_STATES,
    PRESSURE_LIFTING,
    PRESSURE_LOWERING,
    VALVE_COMMAND,
    VELOCITY_COMMAND,
)
from emir_ros.main import run
from emir_ros.node_parameters import declare_tree, reject_unknown
from emir_ros.shell import ControlNode, Signals

INPUTS = [VELOCITY_COMMAND, JOINT_STATES, PRESSURE_LIFTING, PRESSURE_LOWERING]
SHUT = ForceLoopOutputs(0.0, float("nan"), 0.0, 0.0, False)


class ForceLoopNode(ControlNode):
    """velocity_command, joint_states, pressures -> valve_command, force_loop/terms.

    Without fresh inputs it shuts the valve.
    """

    def __init__(self, arguments: Sequence[str] | None = None) -> None:
        super().__init__("force_loop_node", INPUTS, [FORCE_LOOP_TERMS, VALVE_COMMAND], arguments)
        self.force_loop = ForceLoop(declare_tree(self, ForceLoopParameters()))
        self.state: ForceLoopState | None = None
        reject_unknown(self)

    def control(self, signals: Signals, dt: float) -> Signals:
        """Return command and terms of this control period."""
        inputs = ForceLoopInputs(
            signals["velocity_command"],
            0.0,
            signals["angle"],
            signals["pressure_lifting"],
            signals["pressure_lowering"],
        )
        state = self.state or self.force_loop.initial(inputs)
        self.state, outputs = self.force_loop.step(state, inputs, dt)
        return _signals(outputs)

    def stale(self, missing: Sequence[str]) -> Signals:
        """Return the command that shuts the valve; the damping starts anew afterwards."""
        self.state = None
        return _signals(SHUT)


def _signals(outputs: ForceLoopOutputs) -> Signals:
    return {
        "valve_command": outputs.valve_command,
        "measured_force": outputs.force,
        "force_feedback": outputs.feedback,
        "wanted_velocity": outputs.velocity,
        "saturated": float(outputs.saturated),
    }


def main() -> None:
    """Run the node until it is stopped."""
    run(ForceLoopNode)


if __name__ == "__main__":
    main()

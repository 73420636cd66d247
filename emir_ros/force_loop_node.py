"""force_loop_node: force feedback and static prefilter, from wanted velocity to valve current."""

from collections.abc import Sequence
from typing import Any

from emir_analysis.control_protocols import NodeControl, Signals
from emir_analysis.node_controls import ForceLoopControl, force_loop_signals
from emir_analysis.robot_controls import RobotForceLoopControl, shut_signals
from emir_analysis.robot_setup import force_loops
from emir_control.force_loop import ForceLoop, ForceLoopOutputs, ForceLoopParameters
from emir_msgs_py.topics import (
    CONTROL_PERIOD,
    PLANT_PERIOD,
    ROBOT,
    SELECTOR_TERMS,
    VELOCITY_COMMAND,
)
from emir_ros.control_shell import ControlNode
from emir_ros.live_parameters import LiveParameters
from emir_ros.main import run
from emir_ros.node_parameters import declare, declare_robot_sheet, declare_tree, reject_unknown

LIVE = ("gain",)  # the prefilter has none of that name
SHUT = ForceLoopOutputs(0.0, float("nan"), 0.0, 0.0, False)
# A command is due every period. Looked for every plant period, its absence shuts the valve
# within the period in which it was due.
TIMEOUT = 2.0 * CONTROL_PERIOD - PLANT_PERIOD  # s


class ForceLoopNode(ControlNode):
    """velocity_command, joint_states, pressures -> valve_command, force_loop/terms.

    Without fresh inputs it shuts the valve, within a control period. Of the whole robot it has six
    loops.
    """

    consequence = "valve shut"
    timeout = TIMEOUT

    def __init__(self, arguments: Sequence[str] | None = None) -> None:
        mine, six = ForceLoopControl, RobotForceLoopControl
        super().__init__("force_loop_node", mine.inputs, mine.outputs, arguments, six)
        robot = self.model == ROBOT
        default: Any = force_loops(declare_robot_sheet(self)) if robot else ForceLoopParameters()
        if declare(self, "standby", False, "of several controllers some may command the valve"):
            self.take(SELECTOR_TERMS)
        parameters = declare_tree(self, default, live=LIVE)

        def tune(parameters: Any) -> None:
            self.law: NodeControl = six(parameters) if robot else mine(ForceLoop(parameters))

        tune(parameters)
        LiveParameters(self, parameters, LIVE, tune)
        reject_unknown(self)
        if not self.lockstep:
            self.start_timer(PLANT_PERIOD, self._watch)

    def followed(self) -> str | None:
        """Return the name of the velocity command; joint by joint it acts more often than that."""
        return None if self.model == ROBOT else VELOCITY_COMMAND.name

    def _watch(self) -> None:
        missing = self.missing()
        if missing and self.state is not None:
            self.without(missing)

    def stale(self, missing: Sequence[str]) -> Signals:
        """Return the command that shuts the valve; the damping starts anew afterwards."""
        self.state = None
        return shut_signals() if self.model == ROBOT else force_loop_signals(SHUT)


def main() -> None:
    """Run the node until it is stopped."""
    run(ForceLoopNode)


if __name__ == "__main__":
    main()

"""lqg_node: LQG control of the boom about a planned move; gives the valve command itself."""

from collections.abc import Sequence
from typing import ClassVar

import scipy.optimize  # noqa: F401 - loaded here, not when the first move is planned

from emir_analysis.control_protocols import Signals
from emir_analysis.machine_model import lqg_parameters
from emir_analysis.node_controls import LqgControl
from emir_control.lqg import Lqg, LqgState, PlannedBeside
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
        law = self.law_class(declare_tree(self, lqg_parameters(joint1())))
        self._beside = None if self.lockstep else PlannedBeside(law)
        self.law = self.standing_by(kind(self._beside or law))
        self._move_runs = False
        reject_unknown(self)

    def control(self, signals: Signals, dt: float) -> Signals:
        """Return the output signals of one control period of dt, s."""
        self._move_runs = 0.0 < signals["move_since"] < signals["move_duration"]
        return super().control(signals, dt)

    def caution(self, outputs: Signals) -> str:
        """Return why the outputs are not what was asked for, if they are not."""
        if self._beside and self._beside.refused:
            return self._beside.refused
        if self._move_runs and isinstance(self.state, LqgState) and not self.state.moving:
            planning = self._beside is not None and self._beside.is_planning
            return f"at rest: the move {'is being planned' if planning else 'had begun before'}"
        limited = outputs[f"{self.control_class.name}_limited"] == 1.0
        return "held off the end of the stroke" if limited else ""


def main() -> None:
    """Run the node until it is stopped."""
    run(LqgNode)


if __name__ == "__main__":
    main()

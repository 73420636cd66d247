"""trajectory_node: the desired piston motion, from where the machine stands."""

from collections.abc import Sequence

from emir_control.trajectory import TrajectoryInputs, TrajectoryParameters, TrajectoryState, named
from emir_msgs_py.topics import CYLINDER_PREVIEW, CYLINDER_REFERENCE, CYLINDER_STATES
from emir_ros.main import run
from emir_ros.node_parameters import declare, declare_tree, reject_unknown
from emir_ros.shell import ControlNode, Signals


class TrajectoryNode(ControlNode):
    """cylinder_states -> cylinder_reference, cylinder_preview."""

    def __init__(self, arguments: Sequence[str] | None = None) -> None:
        outputs = [CYLINDER_REFERENCE, CYLINDER_PREVIEW]
        super().__init__("trajectory_node", [CYLINDER_STATES], outputs, arguments)
        name = declare(self, "trajectory", "lift-lower", "lift-lower, lower-lift or hold")
        self.trajectory = named(name, declare_tree(self, TrajectoryParameters()))
        self.state: TrajectoryState | None = None
        reject_unknown(self)

    def control(self, signals: Signals, dt: float) -> Signals:
        """Return the reference of this control period and of the next ones."""
        inputs = TrajectoryInputs(signals["stroke"])
        state = self.state or self.trajectory.initial(inputs)
        ahead = self.trajectory.ahead(state, len(CYLINDER_PREVIEW.fields), dt)
        self.state, reference = self.trajectory.step(state, inputs, dt)
        now = {"reference_stroke": reference.stroke, "reference_velocity": reference.velocity}
        return now | dict(zip(CYLINDER_PREVIEW.fields, ahead, strict=True))


def main() -> None:
    """Run the node until it is stopped."""
    run(TrajectoryNode)


if __name__ == "__main__":
    main()

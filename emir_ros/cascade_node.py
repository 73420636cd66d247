"""cascade_node: conventional position control of the piston, law (11)."""

from collections.abc import Sequence

from emir_control.cascade import Cascade, CascadeInputs, CascadeParameters, CascadeState
from emir_control.trajectory import Reference
from emir_msgs_py.topics import (
    CASCADE_TERMS,
    CYLINDER_REFERENCE,
    CYLINDER_STATES,
    VELOCITY_COMMAND,
)
from emir_ros.main import run
from emir_ros.node_parameters import declare_tree, reject_unknown
from emir_ros.shell import ControlNode, Signals


class CascadeNode(ControlNode):
    """cylinder_reference, cylinder_states -> velocity_command, cascade/terms."""

    def __init__(self, arguments: Sequence[str] | None = None) -> None:
        inputs, outputs = [CYLINDER_REFERENCE, CYLINDER_STATES], [CASCADE_TERMS, VELOCITY_COMMAND]
        super().__init__("cascade_node", inputs, outputs, arguments)
        self.cascade = Cascade(declare_tree(self, CascadeParameters()))
        self.state: CascadeState | None = None
        reject_unknown(self)

    def control(self, signals: Signals, dt: float) -> Signals:
        """Return command and terms of this control period."""
        reference = Reference(signals["reference_stroke"], signals["reference_velocity"])
        inputs = CascadeInputs(reference, signals["stroke"])
        state = self.state or self.cascade.initial(inputs)
        self.state, outputs = self.cascade.step(state, inputs, dt)
        return outputs._asdict()


def main() -> None:
    """Run the node until it is stopped."""
    run(CascadeNode)


if __name__ == "__main__":
    main()

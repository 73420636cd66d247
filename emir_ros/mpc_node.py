"""mpc_node: constrained predictive control of the boom about a planned move, on OSQP."""

from collections.abc import Sequence
from importlib import import_module
from importlib.util import find_spec

from emir_analysis.node_controls import MpcControl
from emir_control.mpc import Mpc
from emir_ros.lqg_node import LqgNode
from emir_ros.main import run


class MpcNode(LqgNode):
    """Reference, move, joint_states, pressures, boom_deflection -> valve_command, mpc/terms."""

    control_class = MpcControl
    law_class = Mpc

    def __init__(self, arguments: Sequence[str] | None = None) -> None:
        if find_spec("osqp"):  # else the law says what is missing
            import_module("osqp")  # takes half a second, here and not within the first move
        super().__init__(arguments)


def main() -> None:
    """Run the node until it is stopped."""
    run(MpcNode)


if __name__ == "__main__":
    main()

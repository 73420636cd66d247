"""selector_node: which of several controllers drives the machine.

    ros2 param set /selector_node controller pfc

changes it while the machine moves.
"""

from collections.abc import Collection, Sequence
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.parameter import Parameter

from emir_analysis.recorded_orders import SET
from emir_analysis.switching import Choosing, Selector, Switch
from emir_common.quantity import ParameterError
from emir_msgs_py.topics import OFFERED_COMMANDS, OUTER_LOOPS
from emir_ros.control_shell import ControlNode
from emir_ros.live_parameters import refused_by
from emir_ros.main import run
from emir_ros.node_parameters import declare, naming, reject_unknown


class SelectorNode(ControlNode):
    """<controller>/velocity_command of each -> velocity_command, selector/terms."""

    consequence = "no command"

    def __init__(self, arguments: Sequence[str] | None = None) -> None:
        # The controllers are known only once the node is there to read its parameters.
        super().__init__("selector_node", [], Selector.outputs, arguments)
        names: list[str] = declare(self, "controllers", list(OUTER_LOOPS), "those that run")
        times: list[float] = declare(self, "switch_times", [0.0], "when to switch [s]")
        switched: list[str] = declare(self, "switch_to", [names[0]], "to what, beginning with 0 s")
        if len(times) != len(switched):
            raise ParameterError("selector_node: switch_times and switch_to differ in length")
        with naming(self):
            switches = [Switch(*pair) for pair in zip(times, switched, strict=True)]
            self.selector = Selector(names, switches)
        about = f"which one drives, of {', '.join(names)}; may be set at any time"
        self.declare_parameter("controller", switched[0], ParameterDescriptor(description=about))
        first: str = self.get_parameter("controller").value
        self._check(first)
        self.law: Choosing = Choosing(self.selector, first)
        self.add_on_set_parameters_callback(refused_by(self._check_all))
        self.add_post_set_parameters_callback(self._choose)
        reject_unknown(self)
        for name in names:
            self.take(OFFERED_COMMANDS[name])

    @property
    def chosen(self) -> str:
        """Return who drives."""
        return self.state.drives if self.state else self.law.first

    @property
    def wanted(self) -> str:
        """Return who is to drive, as soon as that one is ready."""
        return self.state.name if self.state else self.law.first

    def followed(self) -> str:
        """Return the name of the command that is handed on."""
        return OFFERED_COMMANDS[self.chosen].name

    def stale(self, missing: Sequence[str]) -> None:
        """Publish nothing; who was chosen stays so."""

    def needed(self) -> Collection[str]:
        """Return the one command that matters; the others may be missing."""
        return (OFFERED_COMMANDS[self.chosen].name,)

    def without(self, missing: Sequence[str]) -> None:
        """Let who is wanted drive from the next period on where who drives is lost."""
        if self.state and not self.why_not(OFFERED_COMMANDS[self.wanted].name):
            self.state = self.law.at_once(self.state)
        super().without(missing)

    def status(self) -> str:
        """Return who drives, and who will."""
        now = f"{self.chosen} drives the machine"
        if self.wanted == self.chosen:
            return now
        return f"{now}; {self.wanted} will, at rest or early in a move"

    def _check(self, name: str) -> None:
        if name not in self.selector.controllers:
            known = ", ".join(self.selector.controllers)
            raise ParameterError(f"selector_node: controller {name!r}: running are {known}")

    def _check_all(self, parameters: list[Parameter]) -> None:
        for name in _controllers(parameters):
            self._check(name)

    def _choose(self, parameters: list[Parameter]) -> None:
        for name in _controllers(parameters):
            self.state = self.law.choose(self.state, name)
            self.orders.tell(SET, {"controller": name})


def _controllers(parameters: list[Parameter]) -> list[Any]:
    """Return what the parameter `controller` is set to, where it is among these."""
    return [parameter.value for parameter in parameters if parameter.name == "controller"]


def main() -> None:
    """Run the node until it is stopped."""
    run(SelectorNode)


if __name__ == "__main__":
    main()

"""Parameters that may be set while a node runs: checked as at its start, in force at a tick."""

from collections.abc import Callable, Collection
from typing import TYPE_CHECKING, Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter

from emir_analysis.recorded_orders import SET
from emir_common.parameter_tree import declared, with_values
from emir_common.quantity import ParameterError

if TYPE_CHECKING:
    from emir_ros.control_shell import ControlNode

Refusal = Callable[[list[Parameter]], SetParametersResult]


class LiveParameters:
    """Quantities of a dataclass, already declared, of which some may change.

    live: the last parts of their paths; the rest is declared read-only. apply(tree) is called with
    the new values; a node's callbacks take turns, so that is between two of its periods.
    """

    def __init__(
        self,
        node: "ControlNode",
        tree: Any,
        live: Collection[str],
        apply: Callable[[Any], None],
    ) -> None:
        self._node, self._tree, self._apply = node, tree, apply
        self._paths = {path for path in declared(tree) if is_live(path, live)}
        node.add_on_set_parameters_callback(refused_by(self._changed))
        node.add_post_set_parameters_callback(self._take)

    def _take(self, parameters: list[Parameter]) -> None:
        values = self._mine(parameters)
        if values:
            self._tree = self._changed(parameters)
            self._apply(self._tree)
            self._node.orders.tell(SET, values)

    def _changed(self, parameters: list[Parameter]) -> Any:
        return with_values(self._tree, self._mine(parameters))

    def _mine(self, parameters: list[Parameter]) -> dict[str, Any]:
        return {p.name: p.value for p in parameters if p.name in self._paths}


def refused_by(check: Callable[[list[Parameter]], object]) -> Refusal:
    """Return the callback that refuses the parameters for which a check raises ParameterError."""

    def refuse(parameters: list[Parameter]) -> SetParametersResult:
        try:
            check(parameters)
        except ParameterError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    return refuse


def is_live(path: str, live: Collection[str]) -> bool:
    """Return whether the last part of a dotted path is one of those that may change."""
    return path.rpartition(".")[2] in live

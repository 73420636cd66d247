"""All parameters of other nodes, asked for by the standard parameter services."""

import json
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient

if TYPE_CHECKING:
    from rclpy.task import Future

PERIOD = 0.02  # s between looks whether the nodes have been discovered
PATIENCE = 50  # looks without an answer, after which a node is asked again


class ParameterRecord:
    """Asks the named nodes as soon as they are there, and hands over what they answered.

    A node is asked again when no answer comes: the middleware drops one that is given before its
    way back has been discovered.

    nodes: names, in the namespace of `node`. found(answers) is called once, when all have
    answered: {node: {parameter: value}}, both in alphabetical order.
    """

    def __init__(
        self,
        node: Node,
        nodes: Sequence[str],
        found: Callable[[dict[str, dict[str, Any]]], None],
    ) -> None:
        self._clients = {name: AsyncParameterClient(node, name) for name in nodes}
        self._waiting = set(nodes)
        self._looks = dict.fromkeys(nodes, PATIENCE)  # since each was asked
        self._answers: dict[str, dict[str, Any]] = {}
        self._found = found
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # /clock waits for the recorder
        self._timer = node.create_timer(PERIOD, self._look, clock=steady)
        self._futures: list[Future] = []  # kept: nobody else holds them until they are done

    @property
    def waiting(self) -> list[str]:
        """Return the nodes that have not answered."""
        return sorted(self._waiting)

    @property
    def answers(self) -> dict[str, dict[str, Any]]:
        """Return what has been answered so far."""
        return dict(sorted(self._answers.items()))

    def _look(self) -> None:
        for name in sorted(self._waiting):
            self._looks[name] += 1
            if self._looks[name] > PATIENCE and self._clients[name].services_are_ready():
                self._looks[name] = 0
                self._futures.append(
                    self._clients[name].list_parameters(
                        callback=lambda future, name=name: self._listed(name, future.result())
                    )
                )
        if not self._waiting:
            self._timer.cancel()

    def _listed(self, node: str, answer: ListParameters.Response) -> None:
        names = sorted(answer.result.names)
        self._futures.append(
            self._clients[node].get_parameters(
                names, callback=lambda future: self._got(node, names, future.result())
            )
        )

    def _got(self, node: str, names: list[str], answer: GetParameters.Response) -> None:
        if node not in self._waiting:  # the answer to an earlier question, after all
            return
        self._waiting.remove(node)
        values = map(parameter_value_to_python, answer.values)
        self._answers[node] = dict(zip(names, values, strict=True))
        if not self._waiting:
            self._found(self.answers)


def as_metadata(answers: dict[str, dict[str, Any]]) -> dict[str, str]:
    """Return the answers as a metadata record holds them: JSON by node."""
    return {node: json.dumps(values, default=list) for node, values in answers.items()}

"""What nodes were ordered during a run, as a recording holds it, and doing the same once more."""

import json
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from emir_analysis import bags
from emir_analysis.control_protocols import Signals
from emir_analysis.errors import InputError
from emir_analysis.graph_topics import graph_topics
from emir_analysis.info import CHANGE
from emir_analysis.switching import Choosing
from emir_control.waypoints import Waypoints
from emir_msgs_py.topics import ORDERS

START, FOLLOW, SET = "start", "follow", "set"  # and what brings to rest: hold, stop


class Order(NamedTuple):
    """What a node was ordered. stamp: of the first period in which it was in force, ns."""

    stamp: int
    what: str
    values: dict[str, Any]

    @property
    def line(self) -> str:
        """Return what it was and since when."""
        set_ = ", ".join(f"{name} = {value}" for name, value in self.values.items())
        detail = f" {set_}" if self.what == SET else ""
        return f"from {self.stamp * 1e-9:.3f} s: {self.what}{detail}"


def as_values(points: Waypoints) -> dict[str, Any]:
    """Return waypoints as JSON can hold them."""
    return {
        "names": list(points.names),
        "times": points.times.tolist(),
        "positions": points.positions.tolist(),
        "velocities": points.velocities.tolist(),
    }


def as_waypoints(values: Mapping[str, Any]) -> Waypoints:
    """Return the waypoints again."""
    arrays = (np.array(values[name]) for name in ("times", "positions", "velocities"))
    return Waypoints(values["names"], *arrays)


def orders(bag: Path, node: str) -> list[Order]:
    """Return what a node was ordered, in that order.

    Raises InputError for a parameter that was set without a word from when on.
    """
    topic = graph_topics(bag).full_name(ORDERS)
    found = []
    for message in bags.read(bag, {topic})[topic] if topic else ():
        for status in message.data.status:
            if status.name.rpartition("/")[2] == node:
                values = {entry.key: json.loads(entry.value) for entry in status.values}
                found.append(Order(message.stamp, status.message, values))
    _check_complete(bag, node, found)
    return found


def _check_complete(bag: Path, node: str, found: list[Order]) -> None:
    told = {
        (name, json.dumps(value))
        for order in found
        if order.what == SET
        for name, value in order.values.items()
    }
    for name, entry in bags.metadata(bag).items():
        if not name.startswith(CHANGE) or entry["node"].rpartition("/")[2] != node:
            continue
        if (entry["name"], entry["value"]) not in told:
            raise InputError(
                f"{bag}: {node}: {entry['name']} was set during the run, and not from which period"
                " on: this cannot be replayed"
            )


class Obedience:
    """A control under the orders that its node was given.

    make(values): the control with these parameters. values: as at the start. fixed: what prevails
    over whatever was set.
    """

    def __init__(
        self,
        make: Callable[[dict[str, Any]], Any],
        values: Mapping[str, Any],
        fixed: Mapping[str, Any],
        given: list[Order],
    ) -> None:
        self._make, self._values, self._fixed = make, dict(values), fixed
        self._waiting = sorted(given, key=lambda order: order.stamp)  # stable
        self.control = self._made()

    def answers(
        self, inputs: Iterable[tuple[int, Signals]], recorded: Mapping[int, Signals], dt: float
    ) -> list[tuple[Signals, Signals]]:
        """Return recorded and replayed outputs of the periods of dt, s, that were recorded.

        inputs: signals with their stamps, ns, in that order. recorded: outputs by stamp.
        """
        state, rows = None, []
        for stamp, signals in inputs:
            state = self._obeyed(stamp, state, dt)
            state, answer = self.control.step(state, signals, dt)
            if stamp in recorded:
                rows.append((recorded[stamp], answer))
        return rows

    def _obeyed(self, stamp: int, state: Any, dt: float) -> Any:
        """Do what is in force from a period's stamp, ns, on; return the state of the control."""
        while self._waiting and self._waiting[0].stamp <= stamp:
            state = self._done(self._waiting.pop(0), state, dt)
        return state

    def _done(self, order: Order, state: Any, dt: float) -> Any:
        if order.what == SET and isinstance(self.control, Choosing):
            return self.control.choose(state, order.values["controller"])
        if order.what == SET:
            self._values |= order.values
            self.control = self._made()
            return state
        if order.what == START:
            return None
        if order.what == FOLLOW:
            return self.control.follow(state, as_waypoints(order.values), dt)
        return self.control.held(state, dt)

    def _made(self) -> Any:
        return self._make({**self._values, **self._fixed})

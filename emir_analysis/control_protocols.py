"""What is expected of a controller by those who run it: nodes, loop, replay, switching."""

from typing import Any, ClassVar, Protocol, runtime_checkable

from emir_control.waypoints import Waypoints
from emir_msgs_py.topics import Topic

Signals = dict[str, float]
Topics = tuple[Topic, ...]


class Stepping(Protocol):
    """From the signals of a period to others."""

    def step(self, state: Any, signals: Signals, dt: float) -> tuple[Any, Signals]:
        """Return the next state and the outputs of one period of dt, s; None: begin here."""


class NodeControl(Stepping, Protocol):
    """What a node computes, from the signals of its inputs to those of its outputs."""

    inputs: ClassVar[Topics]
    outputs: ClassVar[Topics]


AT_REST = "at rest"  # state of a trajectory that is to begin where the machine stands, and stay


class Guidable(NodeControl, Protocol):
    """A trajectory that can be stopped and given another way."""

    def held(self, state: Any, dt: float) -> Any:
        """Return the state in which the reference comes to rest and stays there.

        AT_REST where it has not begun: state None, or AT_REST itself.
        """

    def follow(self, state: Any, points: Waypoints, dt: float) -> Any:
        """Return the state that follows the waypoints from here. Raises WaypointError."""


@runtime_checkable
class Switchable(NodeControl, Protocol):
    """A controller that can hold its state ready while another one moves the machine.

    state None: begin here. command: in force, m/s.
    """

    def follow(self, state: Any, signals: Signals, command: float, dt: float) -> Any:
        """Return the next state when that command was applied in this period."""

    def take_over(self, state: Any, signals: Signals, command: float, dt: float) -> Any:
        """Return the state whose next command is the one in force."""


@runtime_checkable
class PlansMoves(NodeControl, Protocol):
    """A controller that plans whole moves: it says itself when it may take over."""

    def stand_by(self, state: Any, signals: Signals) -> tuple[Any, Signals]:
        """Return the next state while another drives, and what is offered. state None: begin."""

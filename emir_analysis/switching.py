"""Several outer loops of which one drives the machine and the others hold their state ready.

In each period every controller says what it would command; the selector passes on one of these.
A controller learns a period later what was applied: where that was another's command, its own
state follows it, and what it offers is then the command with which it would take over without a
jump.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

from emir_analysis.control_protocols import NodeControl, PlansMoves, Signals, Switchable, Topics
from emir_common.quantity import ParameterError
from emir_msgs_py.topics import (
    OFFERED_COMMANDS,
    OUTER_LOOPS,
    SELECTOR_TERMS,
    VELOCITY_COMMAND,
)


class ReadyState(NamedTuple):
    """A controller's state at the last period's begin, after its own step, and its inputs then."""

    before: Any
    own: Any
    signals: Signals


@dataclass(frozen=True)
class Ready:
    """A controller of those names among which a selector chooses."""

    name: str
    control: NodeControl

    def step(self, state: Any, signals: Signals, dt: float) -> tuple[ReadyState, Signals]:
        """Return the next state and what is offered; signals: the selector's of a period ago, too.

        A controller that is not `Switchable` begins anew when it is chosen.
        """
        if isinstance(self.control, PlansMoves):
            return self._step_planned(self.control, state, signals, dt)
        before = start = self._caught_up(state, signals, dt)
        stands_by = "applied_command" in signals and not self._drives(signals)
        if stands_by and isinstance(self.control, Switchable):
            start = self.control.take_over(before, signals, signals["applied_command"], dt)
        own, outputs = self.control.step(start, signals, dt)
        offered = {f"{self.name}_command": outputs["velocity_command"]}
        terms = {name: value for name, value in outputs.items() if name != "velocity_command"}
        return ReadyState(before, own, signals), terms | offered

    def _step_planned(
        self, control: PlansMoves, state: ReadyState | None, signals: Signals, dt: float
    ) -> tuple[ReadyState, Signals]:
        own = state.own if state else None
        if self._drives(signals):
            own, outputs = control.step(own, signals, dt)
        else:
            own, outputs = control.stand_by(own, signals)
        terms = {name: value for name, value in outputs.items() if name != "valve_command"}
        return ReadyState(None, own, signals), terms

    def _caught_up(self, state: ReadyState | None, signals: Signals, dt: float) -> Any:
        """Return the controller's state after the period that has passed."""
        if state is None or "applied_command" not in signals:
            return None
        if self._drives(signals):
            return state.own
        if not isinstance(self.control, Switchable):
            return None
        applied = signals["applied_command"]
        return self.control.follow(state.before, state.signals, applied, dt)

    def _drives(self, signals: Signals) -> bool:
        return signals.get(f"{self.name}_active", 0.0) == 1.0


class Switch(NamedTuple):
    """Which controller drives from a time on, s after the start."""

    time: float
    name: str


@dataclass(frozen=True)
class Selector:
    """selector_node: hands on the command of one controller.

    switches: in the order of time, the first at 0. Raises ParameterError for a name that is not
    among the controllers or times that do not rise.
    """

    inputs: ClassVar[Topics] = tuple(OFFERED_COMMANDS.values())  # those of the controllers there
    outputs: ClassVar[Topics] = (SELECTOR_TERMS, VELOCITY_COMMAND)
    controllers: Sequence[str]
    switches: Sequence[Switch]

    def __post_init__(self) -> None:
        for name in self.controllers:
            if name not in OUTER_LOOPS:
                raise ParameterError(f"controller {name!r}: there are {', '.join(OUTER_LOOPS)}")
        for switch in self.switches:
            if switch.name not in self.controllers:
                known = ", ".join(self.controllers)
                raise ParameterError(f"controller {switch.name!r}: running are {known}")
        times = [switch.time for switch in self.switches]
        rising = times == sorted(set(times)) and times[:1] == [0.0]
        if not rising or not all(map(math.isfinite, times)):
            raise ParameterError(f"times of switching {times}: have to rise from 0 s")

    @staticmethod
    def driver(driving: str, wanted: str, signals: Signals) -> str:
        """Return who drives: the one that is wanted, as soon as it is ready."""
        ready = signals.get(f"{wanted}_ready", 1.0) == 1.0
        return wanted if ready and f"{wanted}_command" in signals else driving

    def due(self, ticks: int, dt: float) -> str:
        """Return who drives after a number of periods of dt, s, by the switches alone."""
        return [s.name for s in self.switches if round(s.time / dt) <= ticks][-1]

    @staticmethod
    def selected(name: str, signals: Signals) -> Signals:
        """Return the command of one controller, and that it is the one."""
        command = signals[f"{name}_command"]
        active = {f"{other}_active": float(other == name) for other in OUTER_LOOPS}
        return {"velocity_command": command, "applied_command": command} | active


class Chosen(NamedTuple):
    """How many periods have passed, who is to drive, and whose command is handed on."""

    ticks: int
    name: str
    drives: str


@dataclass(frozen=True)
class Choosing:
    """selector_node as it runs: by the switches, or by who was chosen last. first: who begins."""

    outputs: ClassVar[Topics] = Selector.outputs
    selector: Selector
    first: str

    @property
    def inputs(self) -> Topics:
        """Return the commands of the controllers that are there."""
        return tuple(OFFERED_COMMANDS[name] for name in self.selector.controllers)

    def step(self, state: Chosen | None, signals: Signals, dt: float) -> tuple[Chosen, Signals]:
        """Return the next state and the chosen controller's command; state None: begin here."""
        ticks, name, drives = state or Chosen(0, self.first, self.first)
        due = self.selector.due(ticks, dt)
        if ticks and due != self.selector.due(ticks - 1, dt):
            name = due
        drives = self.selector.driver(drives, name, signals)
        return Chosen(ticks + 1, name, drives), self.selector.selected(drives, signals)

    def choose(self, state: Chosen | None, name: str) -> Chosen:
        """Return the state in which that controller drives as soon as it is ready."""
        return state._replace(name=name) if state else Chosen(0, name, name)

    @staticmethod
    def at_once(state: Chosen) -> Chosen:
        """Return the state in which who is to drive does, ready or not: who drove is lost."""
        return state._replace(drives=state.name)


@dataclass(frozen=True)
class SwitchedLoop:
    """The same without ROS. controls: by name."""

    controls: Mapping[str, NodeControl]
    switches: Sequence[Switch]

    def step(self, state: Any, signals: Signals, dt: float) -> tuple[Any, Signals]:
        """Return the next state and the signals; state None: begin here."""
        selector = Choosing(Selector(tuple(self.controls), self.switches), self.switches[0].name)
        begin: tuple[dict[str, Any], Chosen | None, Signals] = ({}, None, {})
        states, driving, fed_back = state or begin
        known = signals | fed_back
        after: dict[str, ReadyState] = {}
        offered: Signals = {}
        for name, control in self.controls.items():
            after[name], terms = Ready(name, control).step(states.get(name), known, dt)
            offered |= terms
        driving, selected = selector.step(driving, offered, dt)
        return (after, driving, selected), offered | selected

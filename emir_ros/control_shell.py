"""What every control node shares: its inputs with their age, and when it acts on them.

Real time: a timer starts each control period, which takes the latest inputs; who hands a command
on starts one when that command comes, since a timer of its own would delay it by up to a period.
Lock step: a control period starts when all inputs with the stamp of that period are there, so the
graph runs as fast as it can and the result does not depend on how fast that is.
"""

import math
from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rclpy.duration import Duration
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn

from emir_analysis.control_protocols import NodeControl, Signals, Stepping
from emir_analysis.switching import Ready
from emir_common.quantity import ParameterError
from emir_msgs_py.topics import (
    CONTROL_PERIOD_NS,
    OFFERED_COMMANDS,
    ROBOT,
    SELECTOR_TERMS,
    VALVE_COMMAND,
    VELOCITY_COMMAND,
    Topic,
)
from emir_ros import qos
from emir_ros.diagnostics import Beat, Level, pressures
from emir_ros.node_parameters import declare
from emir_ros.orders import Orders
from emir_ros.shell import NodeError, Shell
from emir_ros.wire import Wire, stamp_ns

if TYPE_CHECKING:
    from rclpy.time import Time

LONGEST_TIMEOUT = 60.0  # s
OVERDUE = 1.5  # periods without what is followed, after which a node acts without


def is_saturated(signals: Mapping[str, float]) -> bool:
    """Return whether a signal says that a valve or a command is at its limit."""
    return any(
        value == 1.0 for name, value in signals.items() if name.endswith(("saturated", "limited"))
    )


class ControlNode(Shell):
    """A node that turns the signals of its inputs into the signals of its outputs.

    A subclass sets `law`, whose state the node keeps; `stale` says what to do without fresh
    inputs. What two nodes publish counts as missing: nobody knows which of them to believe.
    The node acts as often as its first output is to come. robot: whose inputs and outputs it has
    when the model is the whole robot.

    A node that commands the piston's velocity has the parameter `standby`: it then offers its
    command to selector_node, which tells it what was applied, and holds its state ready.
    """

    consequence = "no output"  # of missing inputs, in words
    law: Stepping
    state: Any = None  # of the law; None: it has not begun
    timeout = 0.1  # s, by default, after which an input is stale

    def __init__(
        self,
        name: str,
        inputs: Sequence[Topic],
        outputs: Sequence[Topic],
        arguments: Sequence[str] | None = None,
        robot: type[NodeControl] | None = None,
    ) -> None:
        super().__init__(name, [], arguments, None if robot is None else [])
        if robot is not None and self.model == ROBOT:
            inputs, outputs = robot.inputs, robot.outputs
        self._period = outputs[0].period_ns
        self._held: dict[str, Signals] = {}  # what comes less often than this node acts
        self._own = name.removesuffix("_node")
        self._inputs: dict[str, Topic] = {}
        self._fast_inputs = 0  # how many of them come every plant period
        self._timeout = self._input_timeout(name)
        self._latest: dict[str, tuple[Time, Signals]] = {}
        self._pending: dict[int, dict[str, Signals]] = {}
        for topic in inputs:
            self.take(topic)
        if self._own in OFFERED_COMMANDS:
            about = "offer the command to selector_node and hold the state ready"
            self._standby: bool = declare(self, "standby", False, about)
            if self._standby:
                outputs = [self._offered(topic) for topic in outputs]
                self._hear_selector()
        self._offer(outputs)
        self.orders = Orders(self)
        if not self.lockstep:
            self._beat = Beat(self._period * 1e-9)
            # s, when it acted last on what it follows, and when it is to act next
            self._followed = self._due = -math.inf
            self._shown: Signals = {}
            self.diagnostics.figures = self._figures
            self.start_timer(self._period * 1e-9, self._on_timer)

    def _input_timeout(self, name: str) -> Duration:
        about = "an older input is stale [s], real time"
        timeout: float = declare(self, "input_timeout", self.timeout, about)
        if not 0.0 < timeout <= LONGEST_TIMEOUT:
            raise ParameterError(
                f"{name}: input_timeout = {timeout:g}: outside 0 ... {LONGEST_TIMEOUT:g} s"
            )
        return Duration(seconds=timeout)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Publish last what is published without inputs: the force loop shuts the valve."""
        instead = self.stale(["inactive"])
        if instead is not None:
            self.publish_all(self.get_clock().now().nanoseconds, instead)
        return super().on_deactivate(state)

    def standing_by(self, control: NodeControl) -> Stepping:
        """Return the controller as this node shall hold it: alone, or one of several."""
        return Ready(self._own, control) if self._standby else control

    def _offered(self, topic: Topic) -> Topic:
        commands = VELOCITY_COMMAND, VALVE_COMMAND
        return OFFERED_COMMANDS[self._own] if topic in commands else topic

    def _hear_selector(self) -> None:
        """Take what was applied in the last period as an input; in the first there is none."""
        self._pending[0] = {SELECTOR_TERMS.name: {}}
        self.take(SELECTOR_TERMS, CONTROL_PERIOD_NS)

    @property
    def next_stamp(self) -> int:
        """Return from when on an order is in force that comes now: the next period, ns."""
        if not self.lockstep:
            return self.now_ns()
        return self.last_stamp + self._period if self.last_stamp >= 0 else 0

    def control(self, signals: Signals, dt: float) -> Signals:
        """Return the output signals of one control period of dt, s."""
        answer: Signals
        self.state, answer = self.law.step(self.state, signals, dt)
        return answer

    def stale(self, missing: Sequence[str]) -> Signals | None:
        """Return what to publish while inputs are missing or too old; None: nothing.

        Where a controller publishes nothing the valve shuts. Afterwards it starts anew.
        """
        self.state = None
        return None

    def needed(self) -> Collection[str]:
        """Return the names of the inputs without which there is no period in real time."""
        return self._inputs.keys() - {SELECTOR_TERMS.name}

    def followed(self) -> str | None:
        """Return the name of the input on whose arrival the node acts in real time; None: none."""
        return None

    def take(self, topic: Topic, later: int = 0) -> None:
        """Take a topic as an input, in lock step of the period that begins `later` ns after it."""
        self._inputs[topic.name] = topic
        self._fast_inputs += topic.every == "plant"
        wire = Wire(topic)

        def receive_latest(data: bytes) -> None:
            self._latest[topic.name] = (self.get_clock().now(), wire.decode(data))
            if topic.name == self.followed():
                self._act_in_turn()

        def receive_all(data: bytes) -> None:
            stamp = stamp_ns(data)
            if stamp % self._period == 0:
                self._on_stamp(topic, stamp + later, wire.decode(data))

        receive = receive_all if self.lockstep else receive_latest
        self.hear(topic, receive, qos.requested(topic, lockstep=self.lockstep))

    def _on_stamp(self, topic: Topic, stamp: int, signals: Signals) -> None:
        complete = self._pending.setdefault(stamp, {})
        if topic.name in complete or stamp <= self.last_stamp:
            raise NodeError(
                f"{self.get_name()}: {topic.name} came twice for t = {stamp * 1e-9:.3f} s:"
                " does more than one node publish it?"
            )
        complete[topic.name] = signals
        if len(complete) == self._expected(stamp):
            del self._pending[stamp]
            self.last_stamp = stamp
            self._held |= complete
            self._run(stamp, self._held.values())

    def _expected(self, stamp: int) -> int:
        """Return how many of the inputs have messages of that stamp."""
        return len(self._inputs) if stamp % CONTROL_PERIOD_NS == 0 else self._fast_inputs

    def _on_timer(self) -> None:
        since = self.seconds() - self._followed
        if not 0.0 <= since < OVERDUE * self._period * 1e-9:
            self._due = self.seconds()
            self._act()

    def _act_in_turn(self) -> None:
        """Act, unless that is more than a period early: not more often than commands are due."""
        period, now = self._period * 1e-9, self.seconds()
        if now >= self._due - period:
            self._followed, self._due = now, max(self._due, now) + period
            self._act()

    def _act(self) -> None:
        now = self.get_clock().now()
        self._beat.tick(self.seconds())
        missing = self.missing()
        if not missing:
            fresh = [s for t, s in self._latest.values() if self._is_fresh(t, now)]
            self._run(now.nanoseconds, fresh)
        else:
            self.diagnostics.counts["periods without fresh inputs"] += 1
            self.without(missing)

    def _figures(self) -> dict[str, str]:
        return self._beat.values() | pressures(self._shown)

    def missing(self) -> list[str]:
        """Return what keeps a period from running, in words; nothing: all is there."""
        return [reason for name in self.needed() if (reason := self.why_not(name))]

    def why_not(self, name: str) -> str:
        """Return why an input is not to be used, in words; nothing: it is."""
        if name not in self._latest:
            return f"no {name} yet"
        if not self._is_fresh(self._latest[name][0], self.get_clock().now()):
            return f"no fresh {name}"
        if self.count_publishers(name) > 1:
            return f"more than one node publishes {name}"
        return ""

    def _is_fresh(self, heard: "Time", now: "Time") -> bool:
        """Return whether an input is young enough; one from the future met a clock set back."""
        return 0 <= now.nanoseconds - heard.nanoseconds <= self._timeout.nanoseconds

    def without(self, missing: Sequence[str]) -> None:
        """Do what is to be done in a period that cannot run, and say why."""
        began = any(reason.endswith("yet") for reason in missing)
        instead = self.stale(missing)
        what = f"{self.consequence}: " if instead is not None else ""
        self.diagnostics.say(Level.WARN if began else Level.ERROR, what + ", ".join(missing))
        if instead is not None:
            self.publish_all(self.get_clock().now().nanoseconds, instead)

    def _run(self, stamp: int, inputs: Any) -> None:
        signals = {name: value for group in inputs for name, value in group.items()}
        outputs = self.control(signals, self._period * 1e-9)
        self.publish_all(stamp, outputs)
        if not self.lockstep:
            self._shown = signals
            self.diagnostics.counts["periods saturated"] += is_saturated(outputs)
        bad = [name for name, value in signals.items() if not math.isfinite(value)]
        if bad:
            verb = "is" if len(bad) == 1 else "are"
            self.diagnostics.say(
                Level.ERROR, f"{self.consequence}: {', '.join(bad)} {verb} not a number"
            )
        else:
            caution = self.caution(outputs)
            self.diagnostics.say(Level.WARN if caution else Level.OK, caution or self.status())

    def caution(self, outputs: Signals) -> str:
        """Return why the outputs are not what was asked for, if they are not."""
        return ""

    def status(self) -> str:
        """Return what there is to say while all is well."""
        return "running"

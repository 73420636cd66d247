"""What every node of the graph shares: parameters, inputs with their age, the two ways of time.

Real time: a timer starts each control period, which takes the latest inputs. Lock step: a
control period starts when all inputs with the stamp of that period are there, so the graph
runs as fast as it can and the result does not depend on how fast that is.
"""

import math
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.duration import Duration
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.task import Future

from emir_analysis.node_controls import NodeControl, Stepping
from emir_analysis.switching import Ready
from emir_common.quantity import ParameterError
from emir_msgs_py import conversions
from emir_msgs_py.topics import (
    CONTROL_PERIOD_NS,
    JOINT1,
    OFFERED_COMMANDS,
    PLANT_PERIOD_NS,
    ROBOT,
    SELECTOR_TERMS,
    VALVE_COMMAND,
    VELOCITY_COMMAND,
    Topic,
)
from emir_plant.plant import SimulationError
from emir_ros import qos
from emir_ros.diagnostics import REPEAT, Beat, Diagnostics, Level
from emir_ros.input_watch import InputWatch
from emir_ros.node_parameters import check_overrides, declare
from emir_ros.orders import Orders
from emir_ros.wire import Wire, sender, stamp_ns

if TYPE_CHECKING:
    from rclpy.qos import QoSProfile
    from rclpy.time import Time

Signals = dict[str, float]

SELDOM = 1.0  # s, between two lines about the same
LONGEST_TIMEOUT = 60.0  # s


class NodeError(RuntimeError):
    """A node cannot go on; the message is one line."""


Failure = NodeError | ParameterError | SimulationError
FAILURES = (NodeError, ParameterError, SimulationError)


class Shell(LifecycleNode):
    """A node with the graph's common parameters `lockstep` and `model`, and its publishers.

    It is active from the start unless the parameter `autostart` says otherwise (in real time). An
    inactive node takes no inputs and no steps and publishes nothing but its status.

    outputs: of joint 1's model. robot: those of the whole robot's, where the node knows that.
    arguments: ROS arguments of this node alone, beside those of the process. Raises
    ParameterError for a model that the node does not know.
    """

    hears_everybody = False  # and shall take what has arrived before it ends
    heard = 0  # messages so far, of such a node
    taken_in_turn = False  # its messages, by `spin_in_turn`

    def __init__(
        self,
        name: str,
        outputs: Sequence[Topic],
        arguments: Sequence[str] | None = None,
        robot: Sequence[Topic] | None = None,
    ) -> None:
        self.failure: Failure | None = None
        self.ended = Future()  # complete when the node is done or has failed
        self.active = False
        super().__init__(name, cli_args=None if arguments is None else list(arguments))
        self._survive_bad_transitions()
        self.add_on_set_parameters_callback(_keep_clock)
        self.lockstep: bool = declare(self, "lockstep", False, "step on stamps, not on a timer")
        known = {JOINT1: outputs} | ({} if robot is None else {ROBOT: robot})
        self.model: str = declare(self, "model", JOINT1, f"{JOINT1}, or {ROBOT}: the whole robot")
        if self.model not in known:
            raise ParameterError(f"{name}: model {self.model!r}: there is {', '.join(known)}")
        check_overrides(self)
        self._outputs: dict[str, Callable[[int, Mapping[str, float]], None]] = {}
        self.last_stamp = -1  # ns, of the latest step in lock step
        self.diagnostics = Diagnostics(self, self.now_ns, lockstep=self.lockstep)
        self._offer(known[self.model])
        if declare(self, "autostart", True, "active from the start; else by its services"):
            self.trigger_configure()
            self.trigger_activate()
        elif self.lockstep:
            raise ParameterError(f"{name}: autostart: lock step needs every node from the start")

    def _survive_bad_transitions(self) -> None:
        """Refuse a transition that the state does not allow: rclpy would end the node with it."""
        service = self._service_change_state
        change = service.callback

        def refuse_or_change(request: Any, response: Any) -> Any:
            try:
                return change(request, response)
            except RuntimeError as error:  # rclpy's RCLError
                self.get_logger().error(f"transition {request.transition.id}: {_line(error)}")
                response.success = False
                return response

        service.callback = refuse_or_change

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Take inputs and steps from now on."""
        self.active = True
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Take none until `on_activate`."""
        self.active = False
        self.diagnostics.say(Level.WARN, "inactive")
        return super().on_deactivate(state)

    def _offer(self, outputs: Sequence[Topic]) -> None:
        for topic in outputs:
            self._outputs[topic.name] = self._output(topic)

    def _output(self, topic: Topic) -> Callable[[int, Mapping[str, float]], None]:
        encode, send = Wire(topic).encode, sender(self._publisher(topic))

        def publish(stamp: int, signals: Mapping[str, float]) -> None:
            send(encode(stamp, signals))

        return publish

    def _publisher(self, topic: Topic) -> Any:
        return self.create_publisher(
            conversions.message_class(topic.type),
            topic.name,
            qos.promised(topic, lockstep=self.lockstep),
            qos_overriding_options=qos.overridable(lockstep=self.lockstep),
        )

    def hear(self, topic: Topic, receive: Callable[[bytes], None], profile: "QoSProfile") -> Any:
        """Subscribe to a topic's messages as bytes; in real time, the input is watched."""
        watch: InputWatch | None = None

        def take(data: bytes) -> None:
            if watch is not None:
                watch.tick()
            if not self.active:
                return
            try:  # not `_keep_failure`: this is done for every message
                receive(data)
            except FAILURES as error:
                self._fail(error)
            except LookupError as error:
                if type(error) is not LookupError:  # what looks up in vain is ours
                    raise
                self.malformed(topic.name, error)

        subscription = super().create_subscription(
            conversions.message_class(topic.type),
            topic.name,
            take,
            profile,
            qos_overriding_options=qos.overridable(lockstep=self.lockstep),
            raw=True,
        )
        if not self.lockstep:
            watch = self._watch_input(topic, subscription.qos_profile.deadline.nanoseconds * 1e-9)
        return subscription

    def malformed(self, topic: str, error: LookupError) -> None:
        """Take no notice of a message that lacks a number: its input is then missing.

        In lock step that would be waited for without end.
        """
        text = f"{topic}: {error.args[0]}"
        if self.lockstep:
            self._fail(NodeError(f"{self.get_name()}: {text}"))
            return
        self.diagnostics.counts["messages of another form"] += 1
        self.get_logger().error(text, throttle_duration_sec=SELDOM)

    def _watch_input(self, topic: Topic, deadline: float) -> InputWatch:
        publishers = partial(self.count_publishers, topic.name)
        watch = InputWatch(topic.name, deadline, self.diagnostics.counts, self.seconds, publishers)
        self.start_timer(REPEAT, watch.look)
        return watch

    @property
    def subscriptions(self) -> Iterator[Any]:
        """Return the subscriptions that an executor shall look after."""
        return iter(()) if self.taken_in_turn else super().subscriptions

    def publish(self, topic: Topic, stamp: int, signals: Mapping[str, float]) -> None:
        """Publish a topic's signals, stamped in ns."""
        self._outputs[topic.name](stamp, signals)

    def publish_all(self, stamp: int, signals: Mapping[str, float]) -> None:
        """Publish the signals of all topics that the node has, stamped in ns."""
        for publish in self._outputs.values():
            publish(stamp, signals)

    def create_subscription(
        self, msg_type: Any, topic: str, callback: Callable[[Any], None], *args: Any, **kw: Any
    ) -> Any:
        """Subscribe as rclpy does; a callback that fails ends the node (see `check`)."""

        def call(message: Any) -> None:
            self._keep_failure(callback, message)

        return super().create_subscription(msg_type, topic, call, *args, **kw)

    def create_timer(
        self, timer_period_sec: float, callback: Callable[[], None], *args: Any, **kw: Any
    ) -> Any:
        """Start a timer as rclpy does; a callback that fails ends the node (see `check`)."""

        def call() -> None:
            self._keep_failure(callback)

        return super().create_timer(timer_period_sec, call, *args, **kw)

    def _keep_failure(self, callback: Callable[..., None], *args: Any) -> None:
        """Call back; keep a failure from the executor, which would print a traceback."""
        try:
            callback(*args)
        except FAILURES as error:
            self._fail(error)

    def _fail(self, error: Failure) -> None:
        if isinstance(error, SimulationError):  # which knows of no nodes
            error = NodeError(f"{self.get_name()}: {error}")
        self.failure = self.failure or error
        self.end()

    @property
    def done(self) -> bool:
        """Return whether the node has nothing more to do."""
        return bool(self.ended.done())

    def end(self) -> None:
        """Let whoever spins the node stop."""
        if not self.done:
            self.ended.set_result(None)

    def check(self) -> None:
        """Raise what a callback failed with, if one did: who has spun the node calls this."""
        if self.failure is not None:
            raise self.failure

    def start_timer(self, period: float, callback: Callable[[], None]) -> None:
        """Call back every period, s: of /clock if the node uses it, else of a steady clock.

        The computer's time of day may be set while a machine moves; a steady clock does not jump.
        """
        simulated = self.get_parameter("use_sim_time").value
        clock = None if simulated else Clock(clock_type=ClockType.STEADY_TIME)

        def call() -> None:
            if self.active:
                callback()

        self.create_timer(period, call, clock=clock)

    def seconds(self) -> float:
        """Return the time of the clock that timers run on, s."""
        if self.get_parameter("use_sim_time").value:
            return self.get_clock().now().nanoseconds * 1e-9
        return time.monotonic()

    def now_ns(self) -> int:
        """Return the time of the node's clock, in lock step the stamp of its latest step, ns.

        The computer's own time is asked directly: rclpy makes objects of it, which takes longer
        than all else that is done with a message.
        """
        if self.lockstep:
            return max(self.last_stamp, 0)
        if self.get_parameter("use_sim_time").value:
            return int(self.get_clock().now().nanoseconds)
        return time.time_ns()

    def close(self) -> None:
        """Bring to an end what must not be left half done."""

    def destroy_node(self) -> None:
        """Destroy the node and the machine of its states, without which it would stay alive.

        rclpy leaves that to the end of the process, where the middleware's threads, still at work,
        may lose what they use and crash it.
        """
        super().destroy_node()
        self._state_machine.destroy_when_not_in_use()


def _keep_clock(parameters: list[Parameter]) -> SetParametersResult:
    """Refuse another clock at run time: timers and the age of inputs are those of the first."""
    if any(parameter.name == "use_sim_time" for parameter in parameters):
        return SetParametersResult(successful=False, reason="use_sim_time is chosen at the start")
    return SetParametersResult(successful=True)


def _line(error: Exception) -> str:
    """Return what rclpy says, in one line."""
    return " ".join(str(error).split())


@contextmanager
def starting() -> Iterator[None]:
    """Tell in one line, as a NodeError, what rclpy has against arguments, names and parameters."""
    try:
        yield
    except FAILURES:
        raise
    except (RuntimeError, NameValidationException, ParameterException) as error:
        raise NodeError(f"cannot start: {type(error).__name__}: {_line(error)}") from None


def pressures(signals: Mapping[str, float]) -> dict[str, str]:
    """Return the measured pressures among the signals as texts with their unit."""
    return {
        f"{name} [bar]": f"{value * 1e-5:.2f}"
        for name, value in signals.items()
        if "pressure_l" in name and "true" not in name
    }


def is_saturated(signals: Mapping[str, float]) -> bool:
    """Return whether a signal says that a valve or a command is at its limit."""
    return any(
        value == 1.0 for name, value in signals.items() if name.endswith(("saturated", "limited"))
    )


class ControlNode(Shell):
    """A node that turns the signals of its inputs into the signals of its outputs.

    A subclass sets `law`, whose state the node keeps; `stale` says what to do without fresh
    inputs. A command that two nodes publish counts as missing: nobody knows which of them to obey.
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
        fast = outputs[0].every == "plant"
        self._period = PLANT_PERIOD_NS if fast else CONTROL_PERIOD_NS
        self._held: dict[str, Signals] = {}  # what comes less often than this node acts
        self._own = name.removesuffix("_node")
        self._inputs: dict[str, Topic] = {}
        self._fast_inputs = 0  # how many of them come every plant period
        about = "an older input is stale [s], real time"
        timeout: float = declare(self, "input_timeout", self.timeout, about)
        if not 0.0 < timeout <= LONGEST_TIMEOUT:
            raise ParameterError(
                f"{name}: input_timeout = {timeout:g}: outside 0 ... {LONGEST_TIMEOUT:g} s"
            )
        self._timeout = Duration(seconds=timeout)
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
            self._shown: Signals = {}
            self.diagnostics.figures = self._figures
            self.start_timer(self._period * 1e-9, self._on_timer)

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

    def take(self, topic: Topic, later: int = 0) -> None:
        """Take a topic as an input, in lock step of the period that begins `later` ns after it."""
        self._inputs[topic.name] = topic
        self._fast_inputs += topic.every == "plant"
        wire = Wire(topic)

        def receive_latest(data: bytes) -> None:
            self._latest[topic.name] = (self.get_clock().now(), wire.decode(data))

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
        now = self.get_clock().now()
        found = []
        for name in self.needed():
            if name not in self._latest:
                found.append(f"no {name} yet")
            elif not self._is_fresh(self._latest[name][0], now):
                found.append(f"no fresh {name}")
            elif self._inputs[name].quality == "command" and self.count_publishers(name) > 1:
                found.append(f"more than one node publishes {name}")
        return found

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

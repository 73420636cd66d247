"""What every node of the graph shares: publishers, subscriptions, clocks, lifecycle, failures."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.task import Future

from emir_common.quantity import ParameterError
from emir_control.least_bending import NoMotionError
from emir_msgs_py import conversions
from emir_msgs_py.topics import JOINT1, ROBOT, Topic
from emir_plant.plant import SimulationError
from emir_ros import qos
from emir_ros.diagnostics import REPEAT, Diagnostics, Level
from emir_ros.input_watch import InputWatch
from emir_ros.node_parameters import check_overrides, declare
from emir_ros.wire import Wire, sender

if TYPE_CHECKING:
    from rclpy.qos import QoSProfile

SELDOM = 1.0  # s, between two lines about the same


class NodeError(RuntimeError):
    """A node cannot go on; the message is one line."""


Failure = NodeError | ParameterError | SimulationError | NoMotionError
FAILURES = (NodeError, ParameterError, SimulationError, NoMotionError)


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
        self._outputs: list[Callable[[int, Mapping[str, float]], None]] = []
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
        self._outputs += map(self._output, outputs)

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

    def publish_all(self, stamp: int, signals: Mapping[str, float]) -> None:
        """Publish the signals of all topics that the node has, stamped in ns."""
        for publish in self._outputs:
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
        if isinstance(error, SimulationError | NoMotionError):  # which know of no nodes
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

        def call() -> None:
            if self.active:
                callback()

        if self.get_parameter("use_sim_time").value:
            self.create_timer(period, call)
        else:
            self.start_steady_timer(period, call)

    def start_steady_timer(self, period: float, callback: Callable[[], None]) -> Any:
        """Call back every period, s, of a steady clock, whatever /clock says; return the timer."""
        return self.create_timer(period, callback, clock=Clock(clock_type=ClockType.STEADY_TIME))

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

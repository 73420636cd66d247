"""plant_node: the simulated machine. In lock step it leads: it takes a step once all answered."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rosgraph_msgs.msg import Clock as ClockMessage
from std_msgs.msg import Header

from emir_analysis.control_protocols import Signals
from emir_common.quantity import check_ranges, quantity
from emir_msgs_py.robot_topics import ROBOT_PLANT_TOPICS
from emir_msgs_py.topics import (
    CONTROL_PERIOD_NS,
    PLANT_PERIOD,
    PLANT_PERIOD_NS,
    PLANT_TOPICS,
    RECORDED,
    ROBOT,
    TICKS,
)
from emir_plant.plant import REST_PRESSURE
from emir_ros import qos
from emir_ros.diagnostics import Beat, Level, pressures
from emir_ros.machines import Joint1Machine, Machine, RobotMachine
from emir_ros.main import run
from emir_ros.node_parameters import declare, declare_tree, naming, reject_unknown
from emir_ros.shell import NodeError, Shell
from emir_ros.wire import Wire, clock_message, sender, stamp_ns

MOST_LATE = 10.0  # s, of a busy computer's timer; beyond that a clock was set


@dataclass(frozen=True, kw_only=True)
class PlantNodeParameters:
    """How the machine starts and how long it runs."""

    initial_pressure_lowering: float = quantity(
        "Pa", 0.0, 3e7, "p_S at the start; p_H follows from the load", default=REST_PRESSURE
    )
    duration: float = quantity("s", 0.0, 1e6, "simulated time; 0: without end", default=0.0)
    command_timeout: float = quantity(
        "s", 0.01, 10.0, "without a fresh command the valve shuts, real time", default=0.056
    )
    patience: float = quantity(
        "s", 0.1, 3600.0, "how long lock step waits for an answer", default=30.0
    )

    def __post_init__(self) -> None:
        check_ranges(self)


class PlantNode(Shell):
    """valve_command -> sensors, truth, and in lock step /clock."""

    def __init__(self, arguments: Sequence[str] | None = None) -> None:
        super().__init__("plant_node", PLANT_TOPICS, arguments, ROBOT_PLANT_TOPICS)
        robot = self.model == ROBOT
        self.own = declare_tree(self, PlantNodeParameters())
        kind: Any = RobotMachine if robot else Joint1Machine
        with naming(self):
            self.machine: Machine = kind(self, self.own.initial_pressure_lowering)
        self._recorder = declare(self, "wait_for_recorder", False, "lock step waits for it, too")
        reject_unknown(self)
        self.tick = 0
        self._said = time.monotonic()
        self._valves = self.machine.command
        self._shut: Signals = dict.fromkeys(self._valves.fields, 0.0)
        self._command: tuple[int, Signals] | None = None
        self._recorded = -1
        profile = qos.requested(self._valves, lockstep=self.lockstep)
        self._command_wire = Wire(self._valves)
        self.hear(self._valves, self._on_command, profile)
        if self.lockstep:
            self._start_lockstep()
        else:
            self._start_realtime()

    @property
    def plant(self) -> Any:
        """Return the simulated machine itself: Plant or RobotPlant."""
        return self.machine.plant

    @property
    def truth(self) -> Any:
        """Return what no sensor blurs: Truth or RobotTruth."""
        return self.machine.truth

    def _step(self, command: Signals) -> None:
        self.machine.step(command, PLANT_PERIOD)
        self.tick += 1

    def _publish_sensors(self, stamp: int) -> None:
        self.publish_all(stamp, self.machine.signals(self.tick))
        if self.tick % TICKS == 0:
            self.machine.show(stamp)

    def _show_progress(self) -> None:
        if time.monotonic() - self._said > 1.0:
            self._said = time.monotonic()
            total = f" of {self.own.duration:g}" if self.own.duration else ""
            self.get_logger().info(f"t = {self.tick * PLANT_PERIOD:.1f}{total} s")

    def _is_over(self) -> bool:
        last = round(self.own.duration * 1e9 / CONTROL_PERIOD_NS) * CONTROL_PERIOD_NS
        return self.own.duration > 0.0 and self.tick * PLANT_PERIOD_NS >= last

    # lock step: publish stamp t, wait for the answers to t, step until the next is due

    def _start_lockstep(self) -> None:
        profile = qos.offered(lockstep=True)
        self._send_clock = sender(self.create_publisher(ClockMessage, "/clock", profile))
        self.create_subscription(Header, RECORDED, self._on_recorded, profile, raw=True)
        self.start_steady_timer(0.5, self._check_patience)
        self._asked = time.monotonic()
        self._publish_tick()

    def _publish_tick(self) -> None:
        self.last_stamp = stamp = self.tick * PLANT_PERIOD_NS
        self._send_clock(clock_message(stamp))
        self._publish_sensors(stamp)

    def _on_recorded(self, data: bytes) -> None:
        self._recorded = stamp_ns(data)
        self._advance_when_answered()

    def _advance_when_answered(self) -> None:
        now = self.tick * PLANT_PERIOD_NS
        if self._command is None or self._command[0] != now:
            return
        if self._recorder and self._recorded < now - now % CONTROL_PERIOD_NS:
            return
        if self._is_over():
            self.end()
            return
        for _ in range(self._valves.period_ns // PLANT_PERIOD_NS):
            self._step(self._command[1])
            self._publish_tick()
        self._asked = time.monotonic()
        self._show_progress()

    def _check_patience(self) -> None:
        if time.monotonic() - self._asked < self.own.patience:
            return
        now = self.tick * PLANT_PERIOD_NS
        answered = self._command is not None and self._command[0] == now
        what = RECORDED if answered else self._valves.name
        raise NodeError(
            f"plant_node: no {what} for t = {now * 1e-9:.3f} s within {self.own.patience:g} s:"
            f" is {'recorder_node' if answered else self._valves.publisher} (and what it"
            " listens to) running?"
        )

    # real time: simulated time keeps up with the clock, with the latest command

    def _start_realtime(self) -> None:
        self._command_received = self._now = -math.inf
        self._beat = Beat(PLANT_PERIOD)
        self.diagnostics.figures = self._figures
        self._compile()
        self._publish_sensors(self.get_clock().now().nanoseconds)
        self._started: float | None = None
        self.start_timer(PLANT_PERIOD, self._on_timer)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Go on from where the machine was left: its time has stood still."""
        self._started = None
        return super().on_activate(state)

    def _compile(self) -> None:
        """Take a step that does not count: the very first compiles the machine, for seconds."""
        machine = self.machine
        state, truth = machine.state, machine.truth
        with naming(self):
            machine.step(self._shut, PLANT_PERIOD)
        machine.state, machine.truth = state, truth

    def _figures(self) -> dict[str, str]:
        return self._beat.values() | pressures(self.machine.signals(self.tick))

    def _on_timer(self) -> None:
        now = self.seconds()
        if self._started is None or not 0.0 <= now - self._now <= MOST_LATE:  # /clock was set
            self._started = now - self.tick * PLANT_PERIOD
        self._now = now
        self._beat.tick(now)
        due = int((now - self._started) / PLANT_PERIOD)
        if due - self.tick > TICKS:
            self.get_logger().warning(
                f"{due - self.tick} plant periods late", throttle_duration_sec=2.0
            )
        command = self._fresh_command()
        self.diagnostics.counts["periods without fresh inputs"] += command is self._shut
        saturated = max(map(abs, command.values())) >= 1.0
        self.diagnostics.counts["periods saturated"] += saturated
        while self.tick < due:  # a late timer catches up
            self._step(command)
        self._publish_sensors(self.get_clock().now().nanoseconds)
        self._show_progress()
        if self._is_over():
            self.end()

    def _fresh_command(self) -> Signals:
        if self._command is None:
            return self._shut
        if not 0.0 <= self.seconds() - self._command_received <= self.own.command_timeout:
            self.diagnostics.say(Level.ERROR, f"valve shut: no fresh {self._valves.name}")
            return self._shut
        return self._command[1]

    def _on_command(self, data: bytes) -> None:
        command = self._command_wire.decode(data)
        bad = {name: value for name, value in command.items() if not math.isfinite(value)}
        if bad:
            told = ", ".join(f"{name} is {value}" for name, value in bad.items())
            self.diagnostics.say(Level.ERROR, f"valve shut: {told}")
            command |= dict.fromkeys(bad, 0.0)
        else:
            self.diagnostics.say(Level.OK, "running")
        self._command = (stamp_ns(data), command)
        self._command_received = self.seconds()
        if self.lockstep:
            self._advance_when_answered()


def main() -> None:
    """Run the node until it is done or stopped."""
    run(PlantNode)


if __name__ == "__main__":
    main()

"""trajectory_node: the desired motion of the pistons, from where the machine stands.

`~/hold` brings the reference to rest where it is, `~/stop` does and takes no JointTrajectory
afterwards, `~/start` begins the named trajectory anew. What comes between two periods acts from the
next one on.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

from emir_analysis.control_protocols import AT_REST, Guidable, Signals
from emir_analysis.node_controls import TrajectoryControl
from emir_analysis.recorded_orders import FOLLOW, as_values
from emir_analysis.robot_controls import RobotTrajectoryControl
from emir_analysis.robot_setup import path_parameters, trajectory
from emir_common.quantity import check_ranges, quantity
from emir_control.trajectory import TrajectoryParameters, named
from emir_control.waypoints import WaypointError, Waypoints
from emir_msgs_py.topics import ROBOT
from emir_ros.control_shell import ControlNode
from emir_ros.diagnostics import Level
from emir_ros.main import run
from emir_ros.node_parameters import (
    declare,
    declare_robot_sheet,
    declare_tree,
    naming,
    reject_unknown,
)

RELIABLE = 10  # depth of JOINT_TRAJECTORY
JOINT_TRAJECTORY = "joint_trajectory"
SHOWN = 100  # periods in which a rejection stands on /diagnostics


@dataclass(frozen=True, kw_only=True)
class TrajectoryNodeParameters:
    """What the node itself takes care of."""

    lag_limit: float = quantity(
        "m", 1e-3, 10.0, "behind which the reference stops, real time; of the base rad", default=0.1
    )

    def __post_init__(self) -> None:
        check_ranges(self)


class TrajectoryNode(ControlNode):
    """cylinder_states -> cylinder_reference, cylinder_preview, cylinder_move.

    Of the whole robot: joint_states, cylinder_states -> cylinder_reference, cylinder_preview,
    tcp_reference. joint_trajectory takes the named trajectory's place.
    """

    law: Guidable

    def __init__(self, arguments: Sequence[str] | None = None) -> None:
        mine, six = TrajectoryControl, RobotTrajectoryControl
        super().__init__("trajectory_node", mine.inputs, mine.outputs, arguments, six)
        known = "lift-lower, lower-lift or hold; of the whole robot also line"
        name: str = declare(self, "trajectory", "lift-lower", known)
        move = declare_tree(self, TrajectoryParameters())
        with naming(self):
            if self.model == ROBOT:
                sheet = declare_robot_sheet(self)
                path = declare_tree(self, path_parameters(sheet))
                self.law = six(trajectory(sheet, name, move, path))
            else:
                self.law = mine(named(name, move))
        self._lag_limit: float = declare_tree(self, TrajectoryNodeParameters()).lag_limit
        reject_unknown(self)
        if not self.lockstep:  # else the clock would run on while the first order loads it
            import_module("scipy.interpolate")
        self._name = self._doing = name
        self._stopped = False
        self._rejected, self._shown_for = "", 0  # and in how many periods that was said
        self._left_behind = ""  # who, in words
        self.waypoints_heard = 0  # messages, rejected ones too
        for verb in (self.start, self.hold, self.stop):
            self.create_service(Trigger, f"~/{verb.__name__}", self._answer(verb))
        self.create_subscription(JointTrajectory, JOINT_TRAJECTORY, self._on_waypoints, RELIABLE)

    def control(self, signals: Signals, dt: float) -> Signals:
        """Return the reference; in real time it stops where the machine does not follow.

        Gone on without a machine whose valve is shut, it would be caught up with at full speed.
        """
        outputs = super().control(signals, dt)
        behind = "" if self.lockstep else _left_behind(signals, outputs, self._lag_limit)
        if behind:
            self._left_behind, self.state = behind, None
            self.hold()
        return outputs

    def stale(self, missing: Sequence[str]) -> None:
        """Publish nothing; the motion goes on when the inputs are back."""

    def status(self) -> str:
        """Return what is being done."""
        return self._doing

    def caution(self, outputs: Signals) -> str:
        """Return why the reference stopped, or the last waypoints were rejected.

        The latter for a while: not everybody looks always.
        """
        self._shown_for += 1
        return self._left_behind or (self._rejected if self._shown_for <= SHOWN else "")

    def start(self) -> str:
        """Begin the named trajectory where the machine stands."""
        self.state, self._stopped, self._doing = None, False, self._name
        self._left_behind = ""
        return f"{self._name} begins"

    def hold(self) -> str:
        """Bring the reference to rest where it is."""
        self.state = self.law.held(self.state, self._period * 1e-9)
        self._doing = "stopped" if self._stopped else "held"
        return "comes to rest"

    def stop(self) -> str:
        """Hold, and take no waypoints until `start`."""
        self._stopped = True
        return f"{self.hold()}; goes on after ~/start"

    def _answer(self, verb: Any) -> Any:
        def serve(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            try:
                self._need_to_be_active()
                response.message, response.success = verb(), True
                self._rejected = ""
                self.orders.tell(verb.__name__, {})
            except WaypointError as error:
                response.message = str(error)
            return response

        return serve

    def _need_to_be_active(self) -> None:
        if not self.active:
            raise WaypointError("inactive")

    def _on_waypoints(self, message: JointTrajectory) -> None:
        self.waypoints_heard += 1
        try:
            self._need_to_be_active()
            points = _waypoints(message)
            self._follow(points)
        except WaypointError as error:
            self.diagnostics.counts["waypoints rejected"] += 1
            self._rejected = f"{JOINT_TRAJECTORY} rejected: {error}"
            self._shown_for = 0
            self.diagnostics.say(Level.WARN, self._rejected)
        else:
            self._rejected = ""
            self._left_behind = ""
            self.orders.tell(FOLLOW, as_values(points))
            self._doing = f"follows {JOINT_TRAJECTORY}"

    def _follow(self, points: Waypoints) -> None:
        if self._stopped:
            raise WaypointError("stopped, goes on after ~/start")
        if self.state is None or self.state is AT_REST:
            raise WaypointError("no reference yet to begin at")
        self.state = self.law.follow(self.state, points, self._period * 1e-9)


def _left_behind(signals: Signals, outputs: Signals, limit: float) -> str:
    """Return which piston is farther from its reference than a limit, in words; nothing: none."""
    for name in (name for name in outputs if name.endswith("reference_stroke")):
        front = name.removesuffix("reference_stroke")
        if abs(outputs[name] - signals[f"{front}stroke"]) > limit:
            who = front.rstrip("_") or "the piston"
            return f"held: {who} did not follow, {limit:g} m (base: rad) behind; ~/start goes on"
    return ""


def _waypoints(message: JointTrajectory) -> Waypoints:
    times = [p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in message.points]
    return Waypoints(
        list(message.joint_names),
        np.array(times),
        _table([p.positions for p in message.points], "positions"),
        _table([p.velocities for p in message.points], "velocities"),
    )


def _table(rows: list[Any], what: str) -> Any:
    """Return numbers by point and joint. Raises WaypointError for rows of different lengths."""
    if len({len(row) for row in rows}) > 1:
        raise WaypointError(f"{what}: not as many in every point")
    return np.array([list(row) for row in rows])


def main() -> None:
    """Run the node until it is stopped."""
    run(TrajectoryNode)


if __name__ == "__main__":
    main()

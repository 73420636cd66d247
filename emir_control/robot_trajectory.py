"""Desired motion of all six joints: one of them away and back, or the TCP along a straight line.

Either is a path, the same for way and way back, and a trapezoidal velocity along it. A path starts
where the joints are measured to be.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from emir_common.quantity import ParameterError, check_ranges, quantity
from emir_control.actuator import Actuator
from emir_control.arm import JOINTS, Arm
from emir_control.arm_forces import torques_along, weighed
from emir_control.inverse import Ranges, ReachError, follow
from emir_control.trajectory import (
    AwayAndBack,
    Motion,
    Reference,
    Timing,
    TrajectoryParameters,
    distance_of,
)
from emir_control.waypoints import Along, Axis, Linkage, WaypointError, Waypoints, curve

Array = NDArray[np.float64]

LINE = "line"
SPACING = 0.05  # m of a line between two of its places that are computed
POINTS = 41  # of a path of one joint
STEP = 1e-6  # rad, for the slope of a linkage
SUDDEN = 2.0  # a force that sets in at once swings a hardly damped arm to so many times its own
HEAVIEST = 3000.0  # kg, that a payload is taken for
BAR = 1e5  # Pa
LITRE = 1e-3 / 60.0  # m^3/s in a litre per minute


@dataclass(frozen=True, kw_only=True)
class LineParameters:
    """Where the straight line ends, in the ground's frame, and how fast the TCP goes there.

    The yaw is the base's, which x and y decide; the arm has no roll.
    """

    x: float = quantity("m", -30.0, 30.0, "goal, forward", default=18.0)
    y: float = quantity("m", -30.0, 30.0, "goal, left", default=3.0)
    z: float = quantity("m", -30.0, 30.0, "goal, up", default=8.5)
    pitch: float = quantity("rad", -6.3, 6.3, "goal, last arm over the horizontal", default=-0.1)
    speed: float = quantity("m/s", 1e-3, 2.0, "of the TCP", default=0.25)
    ramp: float = quantity("s", 0.01, 10.0, "each ramp of the speed", default=1.5)

    def __post_init__(self) -> None:
        check_ranges(self)

    @property
    def place(self) -> Array:
        """Return the goal as x, y, z, pitch, (4,)."""
        return np.array([self.x, self.y, self.z, self.pitch])


class Supply(NamedTuple):
    """The pump that feeds all drives."""

    pressure: float  # set, Pa
    flow: float  # largest, m^3/s
    droop: float  # by which the pressure is below the set one at the largest flow, Pa


class RobotReference(NamedTuple):
    """The desired motion at one instant, (6,) each, base first, and the TCP's place, (4,)."""

    strokes: Array  # m; rad for the base
    velocities: Array  # m/s; rad/s for the base
    place: Array  # x, y, z, pitch
    forces: Array  # of the pistons, that this motion takes, N; N m for the base


class RobotTrajectoryInputs(NamedTuple):
    """What the trajectory needs to know."""

    angles: Array  # of the joints, measured, (6,), rad
    forces: Array | None = None  # of the pistons, measured, (6,), N; None: the payload is told


@dataclass(frozen=True)
class Path:
    """Strokes, places and forces over the way along the path, m.

    forces: (3, 6), at rest, per squared speed and per acceleration along the path.
    """

    strokes: "scipy.interpolate.CubicSpline"
    places: "scipy.interpolate.CubicSpline"
    forces: "scipy.interpolate.CubicSpline"

    def at(self, way: float, speed: float, acceleration: float) -> RobotReference:
        """Return the reference on the way, m, at a speed along it, m/s, that changes, m/s^2."""
        forces = np.array([1.0, speed * speed, acceleration]) @ self.forces(way)
        velocities = self.strokes(way, 1) * speed
        return RobotReference(self.strokes(way), velocities, self.places(way), forces)


class RobotTrajectoryState(NamedTuple):
    """Where the trajectory stands."""

    path: Path
    timing: Motion
    ticks: int  # control periods since the start
    arm: Arm  # with the payload that was found


@dataclass(frozen=True)
class RobotTrajectory:
    """A path of all joints, away and back.

    name: a move of one joint's piston (lift-lower, lower-lift, hold) or line. joint: which one,
    0 being the base. ranges: of the joints. supply: what the pump gives at most. weigh: read the
    payload off the pistons' forces.
    """

    name: str
    arm: Arm
    linkages: tuple[Linkage, ...]
    ranges: Ranges
    drives: tuple[Actuator, ...]
    supply: Supply
    move: TrajectoryParameters
    line: LineParameters
    weigh: bool = False
    joint: int = 1

    def __post_init__(self) -> None:
        if self.name != LINE:
            try:
                distance_of(self.name, self.move)
            except ParameterError as error:
                raise ParameterError(f"{error}, {LINE}") from None

    def initial(self, inputs: RobotTrajectoryInputs) -> RobotTrajectoryState:
        """Return the state that starts at the measured angles.

        Raises ReachError where the arm or a joint's range ends or a valve is too small.
        """
        angles = np.asarray(inputs.angles, dtype=np.float64)
        if self.weigh and inputs.forces is not None:
            payload = weighed(self.arm, angles, inputs.forces * _ratios(self.linkages, angles))
            arm = Arm(replace(self.arm.parameters, payload=min(payload, HEAVIEST)))
            return replace(self, arm=arm, weigh=False).initial(inputs)
        path, timing = self._line(angles) if self.name == LINE else self._piston(angles)
        return RobotTrajectoryState(path, AwayAndBack(timing), 0, self.arm)

    def step(
        self, state: RobotTrajectoryState, inputs: RobotTrajectoryInputs, dt: float
    ) -> tuple[RobotTrajectoryState, RobotReference]:
        """Return the reference of this control period of dt, s."""
        time = state.ticks * dt
        way = state.timing.at(time)
        before, after = (state.timing.at(time + side * dt).velocity for side in (-0.5, 0.5))
        reference = state.path.at(way.stroke, way.velocity, (after - before) / dt)
        return state._replace(ticks=state.ticks + 1), reference

    def ahead(self, state: RobotTrajectoryState, count: int, dt: float) -> Array:
        """Return the strokes, (count, 6), of the periods that follow the next step's own."""
        times = ((state.ticks + k) * dt for k in range(1, count + 1))
        return np.asarray(state.path.strokes([state.timing.at(time).stroke for time in times]))

    def held(self, state: RobotTrajectoryState, dt: float) -> RobotTrajectoryState:
        """Return the state that comes to rest on its path and stays there."""
        return state._replace(timing=state.timing.held(state.ticks * dt), ticks=0)

    def follow(
        self, state: RobotTrajectoryState, points: Waypoints, dt: float
    ) -> RobotTrajectoryState:
        """Return the state that follows waypoints of the six joints. Raises WaypointError."""
        _, now = self.step(state, RobotTrajectoryInputs(np.empty(0)), dt)
        begin = [Reference(*map(float, pair)) for pair in zip(*now[:2], strict=True)]
        strokes = curve(points, self._axes(), begin)
        joints = np.array([self._angles(row) for row in strokes(strokes.x)])
        places = scipy.interpolate.CubicSpline(strokes.x, state.arm.tcp(joints))
        path = Path(strokes, places, _forces(state.arm, self.linkages, strokes.x, joints))
        still, moving, _ = np.moveaxis(path.forces(strokes.x), 1, 0)  # time is the way: speed 1
        try:
            self._check_supply(strokes(strokes.x, 1), still + SUDDEN * moving)
        except ReachError as error:
            raise WaypointError(str(error)) from None
        return RobotTrajectoryState(path, Along(float(strokes.x[-1])), 0, state.arm)

    def _angles(self, strokes: Array) -> Array:
        pairs = zip(self.linkages, strokes.tolist(), strict=True)
        return np.array([of.angle(stroke) for of, stroke in pairs])

    def _axes(self) -> list[Axis]:
        """Return the joints by their angles."""
        axes = []
        for k, (name, of) in enumerate(zip(JOINTS, self.linkages, strict=True)):
            ends = (of.stroke(float(self.ranges.low[k])), of.stroke(float(self.ranges.high[k])))
            unit = "rad" if name == "base" else "m"
            axes.append(Axis(name, of, min(ends), max(ends), self.drives[k].fastest, unit))
        return axes

    def _line(self, start: Array) -> tuple[Path, Timing]:
        p, begin = self.line, self.arm.tcp(start)
        length = float(np.linalg.norm(p.place[:3] - begin[:3]))
        if length < SPACING:
            raise ReachError("line: the TCP is there already")
        share = np.linspace(0.0, 1.0, 2 + int(length / SPACING))[:, np.newaxis]
        places = begin + share * (p.place - begin)
        try:
            joints = np.vstack((start, follow(self.arm, self.ranges, start, places[1:])))
            path = self._path(share[:, 0] * length, joints, places, p.speed)
        except ReachError as error:
            raise ReachError(f"line: {error}") from None
        return path, Timing(length, p.speed, p.ramp, self.move.delay, self.move.pause)

    def _piston(self, start: Array) -> tuple[Path, Timing]:
        distance = distance_of(self.name, self.move)
        linkage, name, k = self.linkages[self.joint], JOINTS[self.joint], self.joint
        first = linkage.stroke(start[k])
        ways = np.linspace(0.0, abs(distance) or 1.0, POINTS)
        joints = np.tile(start, (POINTS, 1))
        if distance:
            joints[:, k] = [linkage.angle(first + np.sign(distance) * way) for way in ways]
        if not ((self.ranges.low[k] <= joints[:, k]) & (joints[:, k] <= self.ranges.high[k])).all():
            raise ReachError(f"{self.name}: {name} would go beyond the end of its stroke")
        places = self.arm.tcp(joints)
        path = self._path(ways, joints, places, self.move.speed)
        return path, Timing(
            abs(distance), self.move.speed, self.move.ramp, self.move.delay, self.move.pause
        )

    def _path(self, ways: Array, joints: Array, places: Array, speed: float) -> Path:
        strokes = np.array(
            [[of.stroke(a) for of, a in zip(self.linkages, row, strict=True)] for row in joints]
        )
        forces = _forces(self.arm, self.linkages, ways, joints)
        path = Path(
            scipy.interpolate.CubicSpline(ways, strokes),
            scipy.interpolate.CubicSpline(ways, places),
            forces,
        )
        velocities, at_rest = path.strokes(ways, 1) * speed, path.forces(ways)[:, 0]
        self._check_speeds(velocities)
        there_and_back = np.concatenate((velocities, -velocities))
        self._check_supply(there_and_back, np.tile(at_rest, (2, 1)))
        return path

    def _check_speeds(self, velocities: Array) -> None:
        """Raise ReachError where a valve does not give a way's velocities, (n, 6)."""
        needed = np.abs(velocities).max(axis=0)
        for name, wanted, drive in zip(JOINTS, needed, self.drives, strict=True):
            if wanted > drive.fastest:
                unit, factor = ("rad/s", 1.0) if name == "base" else ("mm/s", 1e3)
                raise ReachError(
                    f"{name} would have to move at {wanted * factor:.3g} {unit},"
                    f" its valve gives {drive.fastest * factor:.3g}"
                )

    def _check_supply(self, velocities: Array, forces: Array) -> None:
        """Raise ReachError where the pump does not give a way's velocities and forces, (n, 6)."""
        flows = _each(Actuator.pumped, self.drives, velocities).sum(axis=1)
        if flows.max() > self.supply.flow:
            raise ReachError(
                f"the joints together would need {flows.max() / LITRE:.0f} l/min,"
                f" the pump gives {self.supply.flow / LITRE:.0f}"
            )
        needed = _each(Actuator.supply_needed, self.drives, forces, velocities)
        given = self.supply.pressure - self.supply.droop * flows / self.supply.flow
        row, k = np.unravel_index(np.argmax(needed - given[:, np.newaxis]), needed.shape)
        if needed[row, k] > given[row]:
            raise ReachError(
                f"with {self.arm.parameters.payload:.0f} kg {JOINTS[k]} would need"
                f" {needed[row, k] / BAR:.0f} bar, the pump gives {given[row] / BAR:.0f}"
            )


def _each(value: Callable[..., float], drives: Sequence[Actuator], *columns: Array) -> Array:
    """Return a value of each drive in each row, (n, 6), of the columns' numbers, (n, 6) each."""
    rows = zip(*columns, strict=True)
    return np.array([[value(*of) for of in zip(drives, *row, strict=True)] for row in rows])


def _forces(
    arm: Arm, linkages: Sequence[Linkage], ways: Array, joints: Array
) -> "scipy.interpolate.CubicSpline":
    """Return the pistons' forces over the way; see Path."""
    ratios = np.array([_ratios(linkages, row) for row in joints])
    return scipy.interpolate.CubicSpline(
        ways, torques_along(arm, ways, joints) / ratios[:, np.newaxis]
    )


def _ratios(linkages: Sequence[Linkage], angles: Array) -> Array:
    """Return dh/d(angle) of the joints, (6,), m."""
    pairs = zip(linkages, map(float, angles), strict=True)
    ends = [(of.stroke(angle + STEP), of.stroke(angle - STEP)) for of, angle in pairs]
    return np.array([(high - low) / (2.0 * STEP) for high, low in ends])

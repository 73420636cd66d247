"""Desired motion of all six joints: joint 1 away and back, or the TCP along a straight line.

Either is a path, the same for way and way back, and a trapezoidal velocity along it. A path starts
where the joints are measured to be.
"""

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from emir_common.quantity import ParameterError, check_ranges, quantity
from emir_control.arm import JOINTS, Arm
from emir_control.inverse import Ranges, ReachError, follow
from emir_control.trajectory import (
    AwayAndBack,
    Motion,
    Reference,
    Timing,
    TrajectoryParameters,
    distance_of,
)
from emir_control.waypoints import Along, Axis, Waypoints, curve

Array = NDArray[np.float64]

LINE = "line"
SPACING = 0.05  # m of a line between two of its places that are computed
POINTS = 41  # of a path of joint 1


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


class Linkage(Protocol):
    """How a piston's stroke belongs to its joint's angle."""

    def stroke(self, angle: float) -> float:
        """Return the stroke, m, at the joint's angle, rad; of the base the angle itself."""

    def angle(self, stroke: float) -> float:
        """Return the angle, rad, at the stroke, m."""


class RobotReference(NamedTuple):
    """The desired motion at one instant, (6,) each, base first, and the TCP's place, (4,)."""

    strokes: Array  # m; rad for the base
    velocities: Array  # m/s; rad/s for the base
    place: Array  # x, y, z, pitch


class RobotTrajectoryInputs(NamedTuple):
    """What the trajectory needs to know."""

    angles: Array  # of the joints, measured, (6,), rad


@dataclass(frozen=True)
class Path:
    """Strokes and places over the way along the path, m."""

    strokes: CubicSpline
    places: CubicSpline

    def at(self, way: float, speed: float) -> RobotReference:
        """Return the reference on the way, m, at a speed along it, m/s."""
        return RobotReference(self.strokes(way), self.strokes(way, 1) * speed, self.places(way))


class RobotTrajectoryState(NamedTuple):
    """Where the trajectory stands."""

    path: Path
    timing: Motion
    ticks: int  # control periods since the start


@dataclass(frozen=True)
class RobotTrajectory:
    """A path of all joints, away and back.

    name: a move of joint 1's piston (lift-lower, lower-lift, hold) or line. ranges: of the
    joints. fastest: what the valves give the pistons, (6,), m/s.
    """

    name: str
    arm: Arm
    linkages: tuple[Linkage, ...]
    ranges: Ranges
    fastest: Array
    move: TrajectoryParameters
    line: LineParameters

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
        path, timing = self._line(angles) if self.name == LINE else self._piston(angles)
        return RobotTrajectoryState(path, AwayAndBack(timing), 0)

    def step(
        self, state: RobotTrajectoryState, inputs: RobotTrajectoryInputs, dt: float
    ) -> tuple[RobotTrajectoryState, RobotReference]:
        """Return the reference of this control period of dt, s."""
        way = state.timing.at(state.ticks * dt)
        return state._replace(ticks=state.ticks + 1), state.path.at(way.stroke, way.velocity)

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
        places = [self.arm.tcp(self._angles(row)) for row in strokes(strokes.x)]
        path = Path(strokes, CubicSpline(strokes.x, np.array(places)))
        return RobotTrajectoryState(path, Along(float(strokes.x[-1])), 0)

    def _angles(self, strokes: Array) -> Array:
        pairs = zip(self.linkages, strokes.tolist(), strict=True)
        return np.array([of.angle(stroke) for of, stroke in pairs])

    def _axes(self) -> list[Axis]:
        """Return the joints by their angles."""
        axes = []
        for k, (name, of) in enumerate(zip(JOINTS, self.linkages, strict=True)):
            ends = (of.stroke(float(self.ranges.low[k])), of.stroke(float(self.ranges.high[k])))
            axes.append(Axis(name, of, min(ends), max(ends), float(self.fastest[k])))
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
        first = self.linkages[1].stroke(start[1])
        ways = np.linspace(0.0, abs(distance) or 1.0, POINTS)
        joints = np.tile(start, (POINTS, 1))
        if distance:
            sign = np.sign(distance)
            joints[:, 1] = [self.linkages[1].angle(first + sign * way) for way in ways]
        low, high = self.ranges.low[1], self.ranges.high[1]
        if not ((low <= joints[:, 1]) & (joints[:, 1] <= high)).all():
            raise ReachError(f"{self.name}: joint1 would go beyond the end of its stroke")
        places = np.array([self.arm.tcp(angles) for angles in joints])
        path = self._path(ways, joints, places, self.move.speed)
        return path, Timing(
            abs(distance), self.move.speed, self.move.ramp, self.move.delay, self.move.pause
        )

    def _path(self, ways: Array, joints: Array, places: Array, speed: float) -> Path:
        strokes = np.array(
            [[of.stroke(a) for of, a in zip(self.linkages, row, strict=True)] for row in joints]
        )
        path = Path(CubicSpline(ways, strokes), CubicSpline(ways, places))
        needed = np.abs(path.strokes(ways, 1)).max(axis=0) * speed
        for name, wanted, fastest in zip(JOINTS, needed, self.fastest, strict=True):
            if wanted > fastest:
                unit, factor = ("rad/s", 1.0) if name == "base" else ("mm/s", 1e3)
                raise ReachError(
                    f"{name} would have to move at {wanted * factor:.3g} {unit},"
                    f" its valve gives {fastest * factor:.3g}"
                )
        return path

"""A motion given by waypoints, as a JointTrajectory holds them: cubic between them.

Interpolated is what is given, strokes or angles; what comes of it is a curve of strokes over time.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

from emir_common.quantity import ParameterError
from emir_control.trajectory import Braking, Motion, Reference

Array = NDArray[np.float64]

LONGEST = 300.0  # s of a motion: a stroke at a crawl; checking one takes no control period
SPACING = 0.032  # s between the places of the curve that are checked
NEAR = 5e-3  # m or rad, by which a first point at time 0 may be off the reference
SLOWING = 0.75  # s in which the way along a curve is brought to rest
STEP = 1e-3  # s, of the difference that gives a rate


class WaypointError(ParameterError):
    """Waypoints that cannot be followed; the message is one line."""


class Linkage(Protocol):
    """How a piston's stroke belongs to its joint's angle."""

    def stroke(self, angle: float) -> float:
        """Return the stroke, m, at the joint's angle, rad."""

    def angle(self, stroke: float) -> float:
        """Return the angle, rad, at the stroke, m."""


class Direct:
    """No linkage: what is given is the stroke, as of a piston by itself, or of the base's motor."""

    def stroke(self, angle: float) -> float:
        """Return what is given, m; of the base rad."""
        return angle

    def angle(self, stroke: float) -> float:
        """Return the stroke."""
        return stroke


@dataclass(frozen=True)
class Axis:
    """A joint that waypoints may name: its limits in strokes, m, and m/s.

    unit: of its strokes, where they are something else.
    """

    name: str
    linkage: Linkage
    low: float
    high: float
    fastest: float
    unit: str = "m"


@dataclass(frozen=True)
class Waypoints:
    """As a message holds them. times: (p,) s. positions, velocities: (p, n) or, if none, (0, 0)."""

    names: Sequence[str]
    times: Array
    positions: Array
    velocities: Array


def curve(
    points: Waypoints, axes: Sequence[Axis], begin: Sequence[Reference]
) -> "scipy.interpolate.CubicSpline":
    """Return the strokes, (n,) m, over time, s, from the references where it begins to rest.

    axes: of all joints, each of which has to be named. Raises WaypointError.
    """
    order = _checked(points, axes)
    start = [axis.linkage.angle(now.stroke) for axis, now in zip(axes, begin, strict=True)]
    rates = [_rate(axis.linkage, now) for axis, now in zip(axes, begin, strict=True)]
    times, positions = points.times, points.positions[:, order]
    velocities = points.velocities[:, order] if points.velocities.size else None
    if times[0] == 0.0:
        off = np.abs(positions[0] - start)
        if off.max() > NEAR:
            name = axes[int(off.argmax())].name
            raise WaypointError(f"begins {off.max():.3g} off where {name}'s reference is")
        times, positions = times[1:], positions[1:]
        velocities = None if velocities is None else velocities[1:]
    times, positions = np.r_[0.0, times], np.vstack((start, positions))
    if velocities is not None:
        given: scipy.interpolate.PPoly = scipy.interpolate.CubicHermiteSpline(
            times, positions, np.vstack((rates, velocities))
        )
    else:
        rest = np.zeros(len(axes))
        given = scipy.interpolate.CubicSpline(
            times, positions, bc_type=((1, np.array(rates)), (1, rest))
        )
    return _in_strokes(given, axes, begin)


def _checked(points: Waypoints, axes: Sequence[Axis]) -> list[int]:
    """Return where in the message the axes stand."""
    known, names = [axis.name for axis in axes], list(points.names)
    for name in names:
        if name not in known:
            raise WaypointError(f"joint {name!r}: there are {', '.join(known)}")
    if sorted(names) != sorted(known):
        raise WaypointError(f"names {', '.join(names) or 'no joint'}: wanted are {known}")
    count = len(points.times)
    if count < 1 or (count == 1 and points.times[0] == 0.0):
        raise WaypointError("has no point to go to")
    if points.positions.shape != (count, len(names)):
        raise WaypointError("positions: not one for each joint in each point")
    if points.velocities.size and points.velocities.shape != points.positions.shape:
        raise WaypointError("velocities: not one for each joint in each point, nor none")
    if not all(np.isfinite(a).all() for a in (points.times, points.positions, points.velocities)):
        raise WaypointError("holds what is not a number")
    _check_times(points.times)
    if points.velocities.size and points.velocities[-1].any():
        raise WaypointError("does not end at rest")
    return [names.index(name) for name in known]


def _check_times(times: Array) -> None:
    if times[0] < 0.0 or (np.diff(times) <= 0.0).any():
        raise WaypointError("time_from_start does not increase from point to point")
    if times[-1] > LONGEST:
        raise WaypointError(f"takes {times[-1]:.4g} s, longer than {LONGEST:g} s")


def _rate(linkage: Linkage, now: Reference) -> float:
    """Return the rate of what is given that belongs to a stroke's velocity."""
    ahead = linkage.angle(now.stroke + now.velocity * STEP)
    return (ahead - linkage.angle(now.stroke - now.velocity * STEP)) / (2.0 * STEP)


def _in_strokes(
    given: "scipy.interpolate.PPoly", axes: Sequence[Axis], begin: Sequence[Reference]
) -> "scipy.interpolate.CubicSpline":
    end = float(given.x[-1])
    times = np.linspace(0.0, end, max(2, 1 + round(end / SPACING)))
    places = given(times)
    strokes = np.array(
        [[a.linkage.stroke(float(x)) for a, x in zip(axes, row, strict=True)] for row in places]
    )
    for axis, column in zip(axes, strokes.T, strict=True):
        if not ((axis.low <= column) & (column <= axis.high)).all():
            low, high = axis.linkage.angle(axis.low), axis.linkage.angle(axis.high)
            raise WaypointError(f"{axis.name} leaves its range, {low:.4g} ... {high:.4g}")
    first = np.array([now.velocity for now in begin])
    found = scipy.interpolate.CubicSpline(
        times, strokes, bc_type=((1, first), (1, np.zeros(len(axes))))
    )
    fastest = np.abs(found(times, 1)).max(axis=0)
    for axis, speed in zip(axes, fastest, strict=True):
        if speed > axis.fastest:
            raise WaypointError(
                f"{axis.name}'s drive would have to move at {speed:.3g} {axis.unit}/s,"
                f" it can {axis.fastest:.3g}"
            )
    return found


@dataclass(frozen=True)
class Along(Motion):
    """The way along a curve over time, both in s: as fast as time goes, up to the end.

    since: where on the way it begins.
    """

    end: float
    since: float = 0.0

    @property
    def duration(self) -> float:
        """Return the time until it rests, s."""
        return max(0.0, self.end - self.since)

    def at(self, time: float, start: float = 0.0) -> Reference:
        """Return how far along it is and how fast."""
        way = self.since + time
        return Reference(min(way, self.end), float(way < self.end))

    def held(self, time: float, start: float = 0.0) -> Motion:
        """Return what stops on the way, or at the end where that is nearer."""
        way, speed = self.at(time)
        if self.end - way <= 0.5 * SLOWING:
            return Along(self.end, self.since + time)
        return Braking(Reference(way, speed), 1.0 / SLOWING)


@dataclass(frozen=True)
class Followed(Motion):
    """The curve of one piston. curve: strokes, (1,) m."""

    curve: "scipy.interpolate.CubicSpline"
    way: Motion

    @property
    def duration(self) -> float:
        """Return the time until it rests, s."""
        return self.way.duration

    def at(self, time: float, start: float = 0.0) -> Reference:
        """Return the reference; start: has no meaning here."""
        way, speed = self.way.at(time)
        return Reference(float(self.curve(way)[0]), float(self.curve(way, 1)[0]) * speed)

    def held(self, time: float, start: float = 0.0) -> "Followed":
        """Return what brings it to rest on its curve."""
        return replace(self, way=self.way.held(time))

"""Desired piston motion: trapezoidal velocity profiles and their integral."""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

from emir_common.quantity import ParameterError, check_ranges, quantity

HALF_OF_PAUSE = 0.5  # after that the next move counts as the one to come


class Reference(NamedTuple):
    """The desired piston motion at one instant."""

    stroke: float  # h_d, m
    velocity: float  # dh_d/dt, m/s


class Move(NamedTuple):
    """The move under way, or the next one."""

    since: float  # s since its start, negative before
    duration: float  # s
    distance: float  # m


LONG = 1e6  # s
NO_MOVE = Move(-math.inf, 0.0, 0.0)


@dataclass(frozen=True)
class Trapezoid:
    """One rest-to-rest move with a trapezoidal velocity.

    distance: m, signed. speed: m/s, of the plateau. ramp: s, each of the two ramps.
    A move too short for the plateau keeps its ramps' slope and turns triangular.
    """

    distance: float
    speed: float
    ramp: float

    @cached_property
    def _ramp_time(self) -> float:
        return min(self.ramp, math.sqrt(abs(self.distance) * self.ramp / self.speed))

    @cached_property
    def duration(self) -> float:
        """Return the time of the whole move, s."""
        if self.distance == 0.0:
            return 0.0
        peak = self.speed * self._ramp_time / self.ramp
        return abs(self.distance) / peak + self._ramp_time

    def at(self, time: float) -> Reference:
        """Return displacement and velocity `time` s after the start of the move."""
        if time <= 0.0 or self.distance == 0.0:
            return Reference(0.0, 0.0)
        if time >= self.duration:
            return Reference(self.distance, 0.0)
        sign = 1.0 if self.distance > 0.0 else -1.0
        slope = self.speed / self.ramp
        ramp, remaining = self._ramp_time, self.duration - time
        if remaining < ramp:  # slowing down: the mirror image of speeding up
            moved = abs(self.distance) - 0.5 * slope * remaining**2
            return Reference(sign * moved, sign * slope * remaining)
        rising = min(time, ramp)
        moved = 0.5 * slope * rising**2 + slope * ramp * (time - rising)
        return Reference(sign * moved, sign * slope * rising)


@dataclass(frozen=True, kw_only=True)
class TrajectoryParameters:
    """A move away and back: `distance` > 0 lifts first (paper 3.2, Fig. 9).

    25 mm/s is the speed at which the TCP, 22.5 m out, moves with about 0.8 m/s.
    """

    distance: float = quantity("m", -1.0, 1.0, "of the move, lifting positive", default=0.06375)
    speed: float = quantity("m/s", 1e-4, 0.2, "of the plateau", default=0.025)
    ramp: float = quantity("s", 0.01, 10.0, "each ramp of the velocity", default=0.75)
    delay: float = quantity("s", 0.0, 60.0, "at rest before the first move", default=1.0)
    pause: float = quantity("s", 0.0, 60.0, "at rest after each move", default=5.0)

    def __post_init__(self) -> None:
        check_ranges(self)


class Timing(NamedTuple):
    """As TrajectoryParameters, for any way, such as that of a TCP."""

    distance: float  # m
    speed: float  # m/s
    ramp: float  # s
    delay: float  # s
    pause: float  # s


class TrajectoryState(NamedTuple):
    """Where the trajectory stands."""

    start: float  # stroke at which it started, m
    ticks: int  # control periods since
    motion: "Motion | None" = None  # in the trajectory's place
    ahead: tuple[float, ...] = ()  # strokes after the next step's own, m, as far as computed


class TrajectoryInputs(NamedTuple):
    """What the trajectory needs to know."""

    stroke: float  # measured stroke, m: a trajectory starts where the machine stands


class Motion:
    """What is wanted over time, stepped in control periods. A subclass says the first three."""

    @property
    def duration(self) -> float:
        """Return the time until it rests, s."""
        raise NotImplementedError

    def at(self, time: float, start: float = 0.0) -> Reference:
        """Return the reference `time` s after the beginning at `start`, m."""
        raise NotImplementedError

    def held(self, time: float, start: float = 0.0) -> "Motion":
        """Return what brings it to rest from that time, s, on; its own time begins at 0 again."""
        raise NotImplementedError

    def initial(self, inputs: TrajectoryInputs) -> TrajectoryState:
        """Return the state that starts at the measured stroke."""
        return TrajectoryState(inputs.stroke, 0)

    def step(
        self, state: TrajectoryState, inputs: TrajectoryInputs, dt: float
    ) -> tuple[TrajectoryState, Reference]:
        """Return the reference of this control period of dt, s."""
        reference = self.at(state.ticks * dt, state.start)
        return state._replace(ticks=state.ticks + 1, ahead=state.ahead[1:]), reference

    def ahead(self, state: TrajectoryState, count: int, dt: float) -> tuple[float, ...]:
        """Return the strokes, m, of the `count` periods that follow the next step's own.

        Put into the state, they are not computed a second time.
        """
        times = ((state.ticks + k) * dt for k in range(len(state.ahead) + 1, count + 1))
        return state.ahead + tuple(self.at(time, state.start).stroke for time in times)

    def move(self, state: TrajectoryState, dt: float) -> Move:
        """Return the move under way or to come; here there is none, and long no other."""
        return Move(-LONG, 0.0, 0.0)


@dataclass(frozen=True)
class Braking(Motion):
    """From a reference to rest. deceleration: m/s^2."""

    begin: Reference
    deceleration: float

    @property
    def duration(self) -> float:
        """Return the time until it rests, s."""
        return abs(self.begin.velocity) / self.deceleration

    def at(self, time: float, start: float = 0.0) -> Reference:
        """Return the reference `time` s after the braking began; start: has no meaning here."""
        stroke, velocity = self.begin
        slope = math.copysign(self.deceleration, velocity)
        since = min(time, self.duration)
        return Reference(
            stroke + velocity * since - 0.5 * slope * since**2,
            velocity - slope * since if since == time else 0.0,
        )

    def held(self, time: float, start: float = 0.0) -> "Braking":
        """Return the same braking from that time on."""
        return Braking(self.at(time), self.deceleration)


@dataclass(frozen=True)
class AwayAndBack(Motion):
    """Trapezoidal dh_d/dt away and back, and its integral h_d."""

    parameters: TrajectoryParameters | Timing

    @property
    def duration(self) -> float:
        """Return the time of the whole trajectory with both pauses, s."""
        p = self.parameters
        return p.delay + 2.0 * (self._move.duration + p.pause)

    @cached_property
    def _move(self) -> Trapezoid:
        p = self.parameters
        return Trapezoid(p.distance, p.speed, p.ramp)

    def move(self, state: TrajectoryState, dt: float) -> Move:
        """Return the move of the next step's own time; before the way back, that back."""
        p, duration = self.parameters, self._move.duration
        since = state.ticks * dt - p.delay
        back = since - duration - p.pause
        if back >= -HALF_OF_PAUSE * p.pause:
            return Move(back, duration, -p.distance)
        return Move(since, duration, p.distance)

    def at(self, time: float, start: float = 0.0) -> Reference:
        """Return the reference `time` s after the beginning at `start`, m."""
        p = self.parameters
        away = self._move.at(time - p.delay)
        back = self._move.at(time - p.delay - self._move.duration - p.pause)
        return Reference(start + away.stroke - back.stroke, away.velocity - back.velocity)

    def held(self, time: float, start: float = 0.0) -> Braking:
        """Return what brings it to rest as its own ramps do."""
        return Braking(self.at(time, start), self.parameters.speed / self.parameters.ramp)


def named(name: str, parameters: TrajectoryParameters) -> AwayAndBack:
    """Return the trajectory of that name.

    lift-lower and lower-lift take the sign, hold the length of the move from the name.
    Raises ParameterError for an unknown name.
    """
    return AwayAndBack(replace(parameters, distance=distance_of(name, parameters)))


def distance_of(name: str, parameters: TrajectoryParameters) -> float:
    """Return the signed distance, m, of the trajectory of that name.

    Raises ParameterError for an unknown name.
    """
    size = abs(parameters.distance)
    distances = {"lift-lower": size, "lower-lift": -size, "hold": 0.0}
    if name not in distances:
        raise ParameterError(f"trajectory {name!r}: there are {', '.join(distances)}")
    return distances[name]

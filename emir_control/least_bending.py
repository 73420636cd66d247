"""Joint motion from rest to rest with the smallest dynamic deflection of the TCP: a linear program.

What is looked for is the joint's acceleration: constant in each step, which gives the limit, or
with a jerk constant over several steps, which gives a plan that a machine can follow. The TCP's
deflection, off the sag of each instant's posture, is that of the boom clamped at the joint. At
the end nothing moves and nothing swings.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, toeplitz
from scipy.optimize import linprog

from emir_control.boom import ClampedBoom

Array = NDArray[np.float64]

STEP = 0.01  # s: 16 or 32 ms would alias the boom's fastest mode, 47 Hz clamped
JERK_STEPS = 3  # steps of constant jerk in a plan
PLANNED_MODES = 2  # that a plan brings to rest; its jerk hardly excites those above 20 Hz


class NoMotionError(ValueError):
    """No motion meets the limits; the message is one line."""


@dataclass(frozen=True)
class Task:
    """A turn of the joint, rad, in a duration, s, at joint rates from low to high, rad/s."""

    turn: float
    duration: float
    low: float
    high: float

    @property
    def count(self) -> int:
        """Return the number of steps, one at least."""
        return max(1, round(self.duration / STEP))


@dataclass(frozen=True, eq=False)
class Motion:
    """acceleration: (n,) rad/s^2, in each step. rate, deflection: (n+1,) rad/s, m, between."""

    acceleration: Array
    rate: Array
    deflection: Array

    @property
    def largest(self) -> float:
        """Return the largest size of the dynamic deflection, m."""
        return float(abs(self.deflection).max())


def limit(boom: ClampedBoom, task: Task) -> Motion:
    """Return the motion whose largest deflection no other motion undercuts.

    Raises NoMotionError where the joint rates do not allow the task.
    """
    n = task.count
    program = _Program(boom, task, np.eye(n), np.zeros((0, n)), len(boom.drive))
    return program.motion(program.least_deflection())


def plan(boom: ClampedBoom, task: Task, allowance: float = 0.055) -> Motion:
    """Return the smoothest motion whose deflection is within the allowance of the smallest.

    The jerk is constant over JERK_STEPS; what is made small is the sum of its changes. The
    acceleration begins and ends with 0. Raises NoMotionError as `limit`.
    """
    pieces = -(-task.count // JERK_STEPS)
    jerk = np.repeat(np.eye(pieces), JERK_STEPS, axis=0)[: task.count]
    ends = STEP * jerk.sum(axis=0)
    mean = STEP * (np.cumsum(jerk, axis=0) - 0.5 * jerk)  # acceleration in each step
    program = _Program(boom, task, mean, ends[None, :], PLANNED_MODES)
    largest = program.motion(program.least_deflection()).largest
    return program.motion(program.smoothest((1.0 + allowance) * largest))


class _Program:
    """The linear program over parameters p, (m,), with acceleration = shapes p, (n,).

    still: (k, m), further rows that have to be 0 at the end. modes: that have to be at rest there.
    """

    def __init__(
        self, boom: ClampedBoom, task: Task, shapes: Array, still: Array, modes: int
    ) -> None:
        n, bent = task.count, len(boom.drive)
        states = _responses(boom, n)
        slow = [*range(modes), *range(bent, bent + modes)]
        ends = states[::-1].T[slow] @ shapes
        self._task, self._shapes = task, shapes
        self._bending = toeplitz(states @ boom.C, np.zeros(n)) @ shapes
        self._rates = STEP * np.cumsum(shapes, axis=0)
        turn = STEP * STEP * (n - np.arange(n) - 0.5) @ shapes
        rest = np.vstack([self._rates[-1:], still, ends])
        self._equal = np.vstack([turn, rest / np.max(abs(rest), axis=1, keepdims=True)])
        self._target = np.append(task.turn, np.zeros(len(rest)))

    def least_deflection(self) -> Array:
        """Return the parameters with the smallest largest deflection."""
        scale = float(abs(self._bending).max())  # of the one unknown beside the parameters
        bound = np.full((len(self._bending), 1), -scale)
        above = np.block([[self._bending, bound], [-self._bending, bound]])
        return self._solve(above, np.zeros(len(above)))

    def smoothest(self, deflection: float) -> Array:
        """Return the parameters of least total change that keep a deflection, m."""
        m = self._shapes.shape[1]
        change = np.diff(np.eye(m), axis=0, prepend=0.0, append=0.0)
        sizes = -np.eye(len(change))
        none = np.zeros((len(self._bending), len(change)))
        above = np.block([
            [change, sizes], [-change, sizes], [self._bending, none], [-self._bending, none],
        ])  # fmt: skip
        most = np.append(np.zeros(2 * len(change)), np.full(2 * len(none), deflection))
        return self._solve(above, most)

    def motion(self, parameters: Array) -> Motion:
        """Return the motion of parameters."""
        rate, bending = self._rates @ parameters, self._bending @ parameters
        return Motion(self._shapes @ parameters, np.append(0.0, rate), np.append(0.0, bending))

    def _solve(self, above: Array, most: Array) -> Array:
        """Return p with the smallest sum of the further unknowns u; above (p, u) <= most."""
        n, m = self._shapes.shape
        further, task = above.shape[1] - m, self._task
        none = np.zeros((n, further))
        found = linprog(
            np.append(np.zeros(m), np.ones(further)),
            np.block([[above], [self._rates, none], [-self._rates, none]]),
            np.concatenate([most, np.full(n, task.high), np.full(n, -task.low)]),
            np.pad(self._equal, ((0, 0), (0, further))),
            self._target,
            bounds=[(None, None)] * m + [(0.0, None)] * further,
        )
        if found.x is None:
            raise NoMotionError(
                f"no motion turns the joint by {task.turn:.4g} rad in {task.duration:g} s from"
                f" rest to rest at {task.low:.3g} ... {task.high:.3g} rad/s"
            )
        return np.asarray(found.x[:m])


def _responses(boom: ClampedBoom, count: int) -> Array:
    """Return (z, z'), (count, 2 m), after 1, 2 ... steps, the first with an acceleration of 1."""
    n = len(boom.B)
    held = expm(STEP * np.block([[boom.A, boom.B[:, None]], [np.zeros((1, n + 1))]]))
    states = [held[:n, n]]
    for _ in range(count - 1):
        states.append(held[:n, :n] @ states[-1])
    return np.array(states)

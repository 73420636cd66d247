"""Joint motion from rest to rest with the smallest dynamic deflection of the TCP: a linear program.

What is looked for is the joint's acceleration, constant in each step; nothing is asked of what
moves the joint. The TCP's deflection, off the sag of each instant's posture, is that of the boom
clamped at the joint. At the end nothing moves and nothing swings.
"""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from emir_control.boom import ClampedBoom

Array = NDArray[np.float64]

STEP = 0.01  # s: 16 or 32 ms would alias the boom's fastest mode, 47 Hz clamped


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
    n, modes = task.count, len(boom.drive)
    states = _responses(boom, n)
    bending = scipy.linalg.toeplitz(states @ boom.C, np.zeros(n))
    rates = STEP * np.tri(n)
    turn = STEP * STEP * (n - np.arange(n) - 0.5)
    rest = np.vstack([rates[-1:], states[::-1].T[: 2 * modes]])
    scale = float(abs(bending).max())  # of the one unknown beside the accelerations
    bound, none = np.full((n, 1), -scale), np.zeros((n, 1))
    found = scipy.optimize.linprog(
        np.append(np.zeros(n), 1.0),
        np.block([[bending, bound], [-bending, bound], [rates, none], [-rates, none]]),
        np.repeat([0.0, 0.0, task.high, -task.low], n),
        np.pad(
            np.vstack([turn, rest / np.max(abs(rest), axis=1, keepdims=True)]), ((0, 0), (0, 1))
        ),
        np.append(task.turn, np.zeros(len(rest))),
        bounds=[(None, None)] * n + [(0.0, None)],
    )
    if found.x is None:
        raise NoMotionError(
            f"no motion turns the joint by {task.turn:.4g} rad in {task.duration:g} s from"
            f" rest to rest at {task.low:.3g} ... {task.high:.3g} rad/s"
        )
    acceleration = np.asarray(found.x[:n])
    rate, deflection = rates @ acceleration, bending @ acceleration
    return Motion(acceleration, np.append(0.0, rate), np.append(0.0, deflection))


def _responses(boom: ClampedBoom, count: int) -> Array:
    """Return (z, z'), (count, 2 m), after 1, 2 ... steps, the first with an acceleration of 1."""
    n = len(boom.B)
    held = scipy.linalg.expm(STEP * np.block([[boom.A, boom.B[:, None]], [np.zeros((1, n + 1))]]))
    states = [held[:n, n]]
    for _ in range(count - 1):
        states.append(held[:n, :n] @ states[-1])
    return np.array(states)

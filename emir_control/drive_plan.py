"""Velocities of the drive, each held for a control period, that bend the boom least: a plan.

What a controller can do is to set the drive's velocity u once a period. The boom, clamped at the
joint, stands on the drive's oil; linear about the middle of the move, off the sag of each instant:

    z'' + D z' + K z = b alpha''
    (r + c b) alpha'' = J a k s + c (K z + D z')
    s' = u - (a + F' / k) alpha'

z, D, K, b: as in `ClampedBoom`; r, c: what the joint and z have of the rigid mode, J the joint's
share in it. s: piston force off that at rest over k, m. a, k, F': see `Drive`. The unknowns of the
linear programs are the velocities, so a plan is one that can be followed exactly.
"""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from emir_control.boom import Boom, ClampedBoom
from emir_control.least_bending import NoMotionError

Array = NDArray[np.float64]

SUBSTEPS = 4  # of a period, at whose ends the deflection counts: 8 ms resolve 63 Hz, the fastest
PLANNED_MODES = 2  # that have to rest at the end; the others swing by little
BENDING, CHANGE = 1e-2, 4e-3  # m, m/s: what counts as one where a motion under way is taken over


@dataclass(frozen=True)
class Drive:
    """The drive about a stroke.

    arm: a, m/rad, of the piston. stiffness: k, N/m, of the oil. slope: F', N/rad, of the force at
    rest. low, high: m/s, velocities that the valve's flow gives.
    """

    arm: float
    stiffness: float
    slope: float
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class HeldMotion:
    """A turn of the joint. velocity: (count,) u, m/s. The others at the ends of the parts, first 0.

    angle: (n,) rad, turned. bent: (n, m) z. pushed: (n,) s, m. deflection: (n,) of the TCP, m.
    """

    velocity: Array
    angle: Array
    bent: Array
    pushed: Array
    deflection: Array


@dataclass(frozen=True)
class HeldTask:
    """A turn of the joint, rad, in a count of control periods, s each."""

    turn: float
    period: float
    count: int


@dataclass(frozen=True, eq=False)
class Begin:
    """A motion under way, that goes on with its velocity for some periods.

    bent, swinging: (n,) z and z'. rate: rad/s, of the joint. pushed: s, m. velocity: u, m/s.
    """

    bent: Array
    swinging: Array
    rate: float
    pushed: float
    velocity: float
    periods: int


def gentlest(boom: Boom, drive: Drive, task: HeldTask, allowance: float) -> HeldMotion:
    """Return the motion of least valve travel whose deflection is within an allowance, 1.

    The allowance is over the smallest deflection that such velocities can reach; valve travel is
    the sum of their changes. Raises NoMotionError where the flow does not allow the task.
    """
    clamped = boom.clamped()
    n = len(clamped.drive)
    held = _held(boom, drive, task.period)
    kernel = _kernel(held, task.count)
    bending = _shifted(kernel[:, :n] @ clamped.deflection, task.count)[1:]
    program = _Program(drive, task, *_ends(kernel, n))
    least = program.least(bending)
    velocity = program.least_travel(bending, (1.0 + allowance) * least)
    return _motion(clamped, velocity, kernel)


def onward(boom: Boom, drive: Drive, task: HeldTask, begin: Begin) -> HeldMotion:
    """Return the motion that leads one under way to the task's end, at rest there.

    Of all such it has the smallest sum of squares of bending and of changes of the velocity: a
    system of equations, which takes no time. The valve's flow is not looked at.
    """
    clamped, count = boom.clamped(), task.count
    n = len(clamped.drive)
    held = _held(boom, drive, task.period)
    kernel = _kernel(held, count)
    free = np.zeros((len(kernel), 2 * n + 4))
    free[0] = np.concatenate([begin.bent, begin.swinging, [0.0, begin.rate, begin.pushed, 0.0]])
    for k in range(len(free) - 1):
        free[k + 1] = held @ free[k]
    free = free[:, :-1]
    bending = _shifted(kernel[:, :n] @ clamped.deflection, count) / (BENDING * np.sqrt(SUBSTEPS))
    bent = free[:, :n] @ clamped.deflection / (BENDING * np.sqrt(SUBSTEPS))
    change = np.diff(np.eye(count), axis=0, append=0.0) / CHANGE
    turn, rest = _ends(kernel, n)
    turn_free, rest_free = _ends_of(free[-1], n)
    fixed = np.vstack([np.eye(count)[: begin.periods], turn, rest])
    values = np.full(begin.periods, begin.velocity), [task.turn - turn_free], -rest_free
    scale = np.max(abs(fixed), axis=1)
    rows = fixed / scale[:, np.newaxis]
    system = np.block([
        [bending.T @ bending + change.T @ change, rows.T],
        [rows, np.zeros((len(rows), len(rows)))],
    ])  # fmt: skip
    right = np.concatenate([-bending.T @ bent, np.concatenate(values) / scale])
    velocity = np.linalg.solve(system, right)[:count]
    return _motion(clamped, velocity, kernel, free)


def _motion(
    clamped: ClampedBoom, velocity: Array, kernel: Array, free: Array | float = 0.0
) -> HeldMotion:
    """Return the motion by the velocities; kernel: of `_kernel`; free: without them."""
    n = len(clamped.drive)
    columns = [_shifted(column, len(velocity)) @ velocity for column in kernel.T]
    states = np.stack(columns, axis=1) + free
    bent = states[:, :n]
    return HeldMotion(
        velocity, states[:, 2 * n], bent, states[:, 2 * n + 2], bent @ clamped.deflection
    )


def _ends(kernel: Array, n: int) -> tuple[Array, Array]:
    """Return what each period's velocity makes of the end: turn, (count,), rest, (k, count)."""
    return _ends_of(kernel[SUBSTEPS::SUBSTEPS][::-1].T, n)


def _ends_of(states: Array, n: int) -> tuple[Array, Array]:
    """Return the turn of states (2 n + 3, ...), and what has to be 0 at the end."""
    slow = [*range(PLANNED_MODES), *range(n, n + PLANNED_MODES)]
    return states[2 * n], states[[*slow, 2 * n + 1, 2 * n + 2]]


def _held(boom: Boom, drive: Drive, period: float) -> Array:
    """Return what a part of a period makes of (z, z', alpha, alpha', s, u)."""
    clamped = boom.clamped()
    n = len(clamped.drive)
    bent, swinging, angle, rate, pushed = slice(n), slice(n, 2 * n), 2 * n, 2 * n + 1, 2 * n + 2
    rigid = clamped.shapes[0]
    joint = np.zeros(2 * n + 3)  # alpha''
    joint[bent], joint[swinging] = rigid * clamped.stiffness, rigid @ clamped.damping
    joint[pushed] = boom.joint[0] * drive.arm * drive.stiffness
    joint /= clamped.rigid[0] + rigid @ clamped.drive
    model = np.zeros((2 * n + 4, 2 * n + 4))
    model[: 2 * n, : 2 * n] = clamped.A
    model[swinging, :-1] += np.outer(clamped.drive, joint)
    model[angle, rate] = 1.0
    model[rate, :-1] = joint
    model[pushed, rate] = -(drive.arm + drive.slope / drive.stiffness)
    model[pushed, -1] = 1.0
    return np.asarray(scipy.linalg.expm(period / SUBSTEPS * model))


def _kernel(held: Array, count: int) -> Array:
    """Return (z, z', alpha, alpha', s) after each part of u = 1 m/s in the first period."""
    states = np.zeros((count * SUBSTEPS + 1, len(held)))
    for k in range(len(states) - 1):
        states[k, -1] = float(k < SUBSTEPS)
        states[k + 1] = held @ states[k]
    return states[:, :-1]


def _shifted(kernel: Array, count: int) -> Array:
    """Return the answers to u = 1 m/s in each period, (n, count), of that to the first, (n,)."""
    answers = np.zeros((len(kernel), count))
    for k in range(count):
        answers[k * SUBSTEPS :, k] = kernel[: len(kernel) - k * SUBSTEPS]
    return answers


class _Program:
    """The linear programs over u. turn: (count,), of the joint; rest: (k, count), 0 at the end."""

    def __init__(self, drive: Drive, task: HeldTask, turn: Array, rest: Array) -> None:
        self._drive, self._task = drive, task
        self._equal = np.vstack([turn, rest / np.max(abs(rest), axis=1, keepdims=True)])

    def least(self, bending: Array) -> float:
        """Return the smallest largest deflection, m, of the rows of bending."""
        scale = float(abs(bending).max())  # of the one unknown beside the velocities
        bound = np.full((len(bending), 1), -scale)
        above = np.block([[bending, bound], [-bending, bound]])
        return float(self._solve(above, np.zeros(len(above)))[-1]) * scale

    def least_travel(self, bending: Array, deflection: float) -> Array:
        """Return the velocities of least total change that keep a deflection, m."""
        count = self._task.count
        change = np.diff(np.eye(count), axis=0, prepend=0.0, append=0.0)
        sizes, none = -np.eye(len(change)), np.zeros((len(bending), len(change)))
        above = np.block([[change, sizes], [-change, sizes], [bending, none], [-bending, none]])
        most = np.append(np.zeros(2 * len(change)), np.full(2 * len(bending), deflection))
        return self._solve(above, most)[:count]

    def _solve(self, above: Array, most: Array) -> Array:
        """Return (u, w) with the smallest sum of the further unknowns w; above (u, w) <= most."""
        count, drive = self._task.count, self._drive
        further = above.shape[1] - count
        found = scipy.optimize.linprog(
            np.append(np.zeros(count), np.ones(further)),
            above,
            most,
            np.pad(self._equal, ((0, 0), (0, further))),
            np.append(self._task.turn, np.zeros(len(self._equal) - 1)),
            bounds=[(drive.low, drive.high)] * count + [(0.0, None)] * further,
        )
        if found.x is None:
            task = self._task
            raise NoMotionError(
                f"no motion turns the joint by {task.turn:.4g} rad in"
                f" {task.count * task.period:.3g} s from rest to rest with the piston at"
                f" {drive.low * 1e3:.3g} ... {drive.high * 1e3:.3g} mm/s"
            )
        return np.asarray(found.x)

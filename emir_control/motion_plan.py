"""A planned move: where joint, boom and piston force should be at every instant, and how.

From the joint's motion of least bending follows all else: the boom's bending by its equations,
the piston force by the rigid mode's, the drive's velocity u = v + dF/dt / k_h by the drive's.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from emir_control.actuator import Actuator
from emir_control.boom import Boom, ClampedBoom
from emir_control.least_bending import STEP, Motion, Task, plan
from emir_control.prefilter import joint_angle, piston_stroke, piston_velocity
from emir_control.trajectory import Move

Array = NDArray[np.float64]


class Target(NamedTuple):
    """Where everything should be at an instant."""

    angle: float  # of the joint, rad
    stroke: float  # of the piston, m
    bending: float  # alpha_6 - alpha_1, rad
    force: float  # F, N


@dataclass(frozen=True, eq=False)
class MotionPlan:
    """Samples in steps of STEP from the move's start; before and after it everything rests.

    stiffness: k_h in the move's middle, N/m. angle, stroke, bending, force: (n,), as in Target.
    deflection: (n,) dynamic, of the TCP, m.
    """

    stiffness: float
    angle: Array
    stroke: Array
    bending: Array
    force: Array
    deflection: Array

    @property
    def duration(self) -> float:
        """Return how long it takes, s."""
        return STEP * (len(self.angle) - 1)

    def at(self, time: float) -> Target:
        """Return where everything should be, time s after the start."""
        place = min(max(time / STEP, 0.0), len(self.angle) - 1.0)
        k = min(int(place), len(self.angle) - 2)
        share = place - k

        def value(samples: Array) -> float:
            return float((1.0 - share) * samples[k] + share * samples[k + 1])

        columns = (self.angle, self.stroke, self.bending, self.force)
        return Target(*map(value, columns))

    def bend(self, time: float) -> float:
        """Return the TCP's dynamic deflection, m, time s after the start; 0 once it is over."""
        steps = STEP * np.arange(len(self.deflection))
        return float(np.interp(time, steps, self.deflection, right=0.0))

    def velocity(self, time: float, dt: float) -> float:
        """Return the mean u, m/s, over dt, s, from a time, s, on."""
        now, then = self.at(time), self.at(time + dt)
        pushed = (then.force - now.force) / self.stiffness
        return (then.stroke - now.stroke + pushed) / dt


def planned(boom: Boom, drive: Actuator, start: float, move: Move, allowance: float) -> MotionPlan:
    """Return the plan of a move from a stroke, m, its deflection within an allowance, 1.

    Raises NoMotionError where the valve's flow does not allow it.
    """
    linkage = drive.parameters.static
    ends = joint_angle(start, linkage), joint_angle(start + move.distance, linkage)
    turn = ends[1] - ends[0]
    arm = move.distance / turn
    low, high = -linkage.flow_lowering / linkage.area_lowering, linkage.flow_lifting
    task = Task(turn, move.duration, low / arm, high / linkage.area_lifting / arm)
    clamped = boom.clamped()
    return _follow(boom, drive, ends[0], plan(clamped, task, allowance), clamped)


def resting(boom: Boom, drive: Actuator, stroke: float) -> MotionPlan:
    """Return the plan to stay at a stroke, m."""
    still = Motion(np.zeros(1), np.zeros(2), np.zeros(2))
    angle = joint_angle(stroke, drive.parameters.static)
    return _follow(boom, drive, angle, still, boom.clamped())


def _follow(
    boom: Boom, drive: Actuator, start: float, motion: Motion, clamped: ClampedBoom
) -> MotionPlan:
    rate = motion.rate
    turned = np.append(0.0, np.cumsum(0.5 * STEP * (rate[1:] + rate[:-1])))
    angle = start + turned
    states, n = _states(clamped, motion.acceleration), len(clamped.drive)
    between = 0.5 * (motion.acceleration[1:] + motion.acceleration[:-1])
    acceleration = np.concatenate([[0.0], between, [0.0]])
    bent, moving = states[:, :n], states[:, n:]
    bending = np.outer(acceleration, clamped.drive)
    bending -= bent * clamped.stiffness + moving @ clamped.damping.T
    lifted = acceleration * clamped.rigid[0] + bending @ clamped.shapes[0]  # the rigid mode's q''
    torque = (lifted + boom.weight[0] * np.cos(angle)) / boom.joint[0]
    linkage = drive.parameters.static
    shape = np.outer(np.cos(angle), boom.sag()) + bent @ clamped.shapes.T
    stroke = np.array([piston_stroke(a, linkage) for a in angle])
    return MotionPlan(
        stiffness=drive.stiffness(float(stroke[0] + stroke[-1]) / 2.0),
        angle=angle,
        stroke=stroke,
        bending=shape @ (boom.tip_angle - boom.joint),
        force=torque / np.array([piston_velocity(1.0, a, linkage) for a in angle]),
        deflection=motion.deflection,
    )


def _states(boom: ClampedBoom, acceleration: Array) -> Array:
    """Return (z, z'), (n + 1, 2 m), from rest under the joint's acceleration, (n,), in steps."""
    m = len(boom.B)
    held = expm(STEP * np.block([[boom.A, boom.B[:, None]], [np.zeros((1, m + 1))]]))
    states = np.zeros((len(acceleration) + 1, m))
    for k, value in enumerate(acceleration):
        states[k + 1] = held[:m, :m] @ states[k] + held[:m, m] * value
    return states

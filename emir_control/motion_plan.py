"""A planned move: where joint, boom and piston force should be at every instant, and how.

From the velocities of least bending (`drive_plan.py`) follow joint and bending; stroke and force
then by linkage and weight of each posture, and the drive's velocity u = v + dF/dt / k_h of them.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from emir_control.actuator import Actuator
from emir_control.boom import Boom
from emir_control.drive_plan import (
    SUBSTEPS,
    Begin,
    Drive,
    HeldMotion,
    HeldTask,
    gentlest,
    onward,
)
from emir_control.prefilter import joint_angle, lever_arm, piston_stroke
from emir_control.trajectory import Move

Array = NDArray[np.float64]

Pair = tuple[float, float]

SHORTEST = 10  # control periods
SECANT = 1e-5  # rad, the least way over which slopes are taken: who is there has none left


class Target(NamedTuple):
    """Where everything should be at an instant."""

    angle: float  # of the joint, rad
    stroke: float  # of the piston, m
    bending: float  # alpha_6 - alpha_1, rad
    force: float  # F, N


@dataclass(frozen=True, eq=False)
class MotionPlan:
    """Samples from a time after the move's start; before and after them everything rests.

    stiffness: k_h in the move's middle, N/m. begins, step: s, first sample and between two. angle,
    stroke, bending, force: (n,), as in Target. deflection: (n,) dynamic, of the TCP, m.
    """

    stiffness: float
    begins: float
    step: float
    angle: Array
    stroke: Array
    bending: Array
    force: Array
    deflection: Array

    @property
    def ends(self) -> float:
        """Return when it is over, s after the move's start."""
        return self.begins + self.step * (len(self.angle) - 1)

    def at(self, time: float) -> Target:
        """Return where everything should be, time s after the start."""
        place = min(max((time - self.begins) / self.step, 0.0), len(self.angle) - 1.0)
        k = min(int(place), len(self.angle) - 2)
        share = place - k

        def value(samples: Array) -> float:
            return float((1.0 - share) * samples[k] + share * samples[k + 1])

        columns = (self.angle, self.stroke, self.bending, self.force)
        return Target(*map(value, columns))

    def bend(self, time: float) -> float:
        """Return the TCP's dynamic deflection, m, time s after the start; 0 once it is over."""
        steps = self.begins + self.step * np.arange(len(self.deflection))
        return float(np.interp(time, steps, self.deflection, right=0.0))

    def velocity(self, time: float, dt: float) -> float:
        """Return the mean u, m/s, over dt, s, from a time, s, on."""
        now, then = self.at(time), self.at(time + dt)
        pushed = (then.force - now.force) / self.stiffness
        return (then.stroke - now.stroke + pushed) / dt

    def piston(self, time: float, dt: float) -> float:
        """Return the mean velocity of the piston, m/s, over dt, s, from a time, s, on."""
        return (self.at(time + dt).stroke - self.at(time).stroke) / dt


class UnderWay(NamedTuple):
    """A motion at an instant.

    time: s, since the move's start. angle, rate: rad, rad/s, of the joint. shape, swinging: (m,)
    modal coordinates, weight included, and their rates. force: F, N. velocity: u, m/s.
    """

    time: float
    angle: float
    rate: float
    shape: Array
    swinging: Array
    force: float
    velocity: float


@dataclass(frozen=True)
class Planner:
    """Plans moves for commands that act once a period, s, `late`, s, after the measurement.

    allowance: of a plan's deflection over the smallest, 1.
    """

    drive: Actuator
    period: float
    late: float
    allowance: float

    def plan(self, boom: Boom, start: float, move: Move) -> MotionPlan:
        """Return the plan of a move from a stroke, m.

        Raises NoMotionError where the valve's flow does not allow it.
        """
        drive = self.drive
        linkage = drive.parameters.static
        ends = joint_angle(start, linkage), joint_angle(start + move.distance, linkage)
        turn = ends[1] - ends[0]
        middle = self._middle(boom, (start, start + move.distance), ends)
        count = max(round(move.duration / self.period), SHORTEST)
        task = HeldTask(turn, self.period, count)
        motion = gentlest(boom, middle, task, self.allowance)
        return self._laid_out(boom, middle, ends[0], motion, self._first(move.since))

    def onward(self, boom: Boom, now: UnderWay, end: float, left: float) -> MotionPlan:
        """Return the plan that leads a motion under way to rest at a stroke, m, in s left."""
        drive, linkage = self.drive, self.drive.parameters.static
        here, there = piston_stroke(now.angle, linkage), joint_angle(end, linkage)
        middle = self._middle(boom, (here, end), (now.angle, there))
        clamped, sag = boom.clamped(), boom.sag()
        bent = now.shape - clamped.rigid * now.angle - sag * math.cos(now.angle)
        swinging = now.swinging - now.rate * (clamped.rigid - sag * math.sin(now.angle))
        arm = lever_arm(now.angle, linkage)
        pushed = (now.force - holding(boom, drive, now.angle)) / middle.stiffness
        begin = Begin(
            bent=clamped.shapes.T @ bent,
            swinging=clamped.shapes.T @ swinging,
            rate=now.rate,
            pushed=pushed * arm / middle.arm,
            velocity=now.velocity,
            periods=math.ceil(self.late / self.period),
        )
        task = HeldTask(there - now.angle, self.period, round(left / self.period))
        return self._laid_out(boom, middle, now.angle, onward(boom, middle, task, begin), now.time)

    def _middle(self, boom: Boom, strokes: Pair, angles: Pair) -> Drive:
        """Return the drive about the middle between two strokes, m, at angles, rad."""
        drive, linkage = self.drive, self.drive.parameters.static
        if abs(angles[1] - angles[0]) < SECANT:
            angles = (angles[0] - 0.5 * SECANT, angles[0] + 0.5 * SECANT)
            strokes = (piston_stroke(angles[0], linkage), piston_stroke(angles[1], linkage))
        turn = angles[1] - angles[0]
        low, high = linkage.speeds
        return Drive(
            arm=(strokes[1] - strokes[0]) / turn,
            stiffness=drive.stiffness(0.5 * (strokes[0] + strokes[1])),
            slope=(holding(boom, drive, angles[1]) - holding(boom, drive, angles[0])) / turn,
            low=low,
            high=high,
        )

    def _laid_out(
        self, boom: Boom, middle: Drive, start: float, motion: HeldMotion, begins: float
    ) -> MotionPlan:
        """Return the plan of a motion from an angle, rad, and a time, s, on."""
        drive, linkage = self.drive, self.drive.parameters.static
        angle = start + motion.angle
        shape = np.outer(np.cos(angle), boom.sag()) + motion.bent @ boom.clamped().shapes.T
        arms = np.array([lever_arm(each, linkage) for each in angle])
        pushed = middle.stiffness * middle.arm / arms * motion.pushed
        return MotionPlan(
            stiffness=middle.stiffness,
            begins=begins,
            step=self.period / SUBSTEPS,
            angle=angle,
            stroke=np.array([piston_stroke(each, linkage) for each in angle]),
            bending=shape @ (boom.tip_angle - boom.joint),
            force=pushed + np.array([holding(boom, drive, each) for each in angle]),
            deflection=motion.deflection,
        )

    def _first(self, since: float) -> float:
        """Return the time nearest to a move's start, s, at which a command acts.

        since: s, of a control period.
        """
        half = 0.5 * self.period
        return (since + self.late + half) % self.period - half


def resting(boom: Boom, drive: Actuator, stroke: float) -> MotionPlan:
    """Return the plan to stay at a stroke, m."""
    angle = joint_angle(stroke, drive.parameters.static)
    bending = math.cos(angle) * float((boom.tip_angle - boom.joint) @ boom.sag())
    still = (angle, stroke, bending, holding(boom, drive, angle), 0.0)
    angles, strokes, bendings, forces, deflections = (np.full(2, value) for value in still)
    return MotionPlan(
        drive.stiffness(stroke), 0.0, 1.0, angles, strokes, bendings, forces, deflections
    )


def holding(boom: Boom, drive: Actuator, angle: float) -> float:
    """Return the piston force, N, that holds the boom at an angle, rad."""
    arm = lever_arm(angle, drive.parameters.static)
    return boom.holding_torque * math.cos(angle) / arm

"""The robot's controllers as its sheet makes them, and the posture in which it starts.

Needs no Pinocchio.
"""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emir_common.quantity import check_ranges, quantity
from emir_control.arm import JOINTS, Arm, ArmParameters
from emir_control.cascade import CascadeParameters
from emir_control.force_loop import ForceLoopParameters
from emir_control.inverse import Ranges
from emir_control.limits import LimitParameters
from emir_control.prefilter import PrefilterParameters
from emir_control.robot_trajectory import LineParameters, Linkage, RobotTrajectory
from emir_control.trajectory import TrajectoryParameters
from emir_plant.parameters import Machine
from emir_plant.robot import linkage
from emir_plant.robot.actuators import machines
from emir_plant.robot.parameters import Robot
from emir_plant.robot.reach import reach, record

Array = NDArray[np.float64]

# The whole robot swings at 0.27 to 0.5 Hz where joint 1 alone does at 0.7: with its gain of 2 1/s
# and high pass of 1 s the cascade would excite it. With these a single mode on the oil's spring
# between 0.27 and 0.7 Hz keeps a damping of 0.2 of critical (docs/robot.md).
GAIN = 0.7  # 1/s, k_p of law (11)
ENDLESS = (-5.0, 5.0)  # rad, the base
HIGH_PASS = 3.0  # s, T_H of (10)
DAMPING_RATE = 3.0  # 1/s, at which the force loop lets a cylinder's oil relax


@dataclass(frozen=True, kw_only=True)
class Posture:
    """The joints' angles at which the robot stands when it starts."""

    base: float = quantity("rad", -3.2, 3.2, "to the left", default=0.0)
    joint1: float = quantity("rad", -3.2, 3.2, "lifted", default=math.radians(45.0))
    joint2: float = quantity("rad", -3.2, 3.2, "lifted", default=math.radians(-10.0))
    joint3: float = quantity("rad", -3.2, 3.2, "lifted", default=math.radians(-10.0))
    joint4: float = quantity("rad", -3.2, 3.2, "lifted", default=math.radians(-15.0))
    joint5: float = quantity("rad", -3.2, 3.2, "lifted", default=math.radians(-15.0))

    def __post_init__(self) -> None:
        check_ranges(self)

    @property
    def angles(self) -> Array:
        """Return the six angles, (6,), rad, base first."""
        return np.array([getattr(self, joint) for joint in JOINTS])


@dataclass(frozen=True, kw_only=True)
class RobotForceLoopParameters:
    """One force loop for each joint."""

    base: ForceLoopParameters
    joint1: ForceLoopParameters
    joint2: ForceLoopParameters
    joint3: ForceLoopParameters
    joint4: ForceLoopParameters
    joint5: ForceLoopParameters


@dataclass(frozen=True, kw_only=True)
class RobotPathParameters:
    """The controller's picture of the arm, and the line."""

    arm: ArmParameters
    line: LineParameters = field(default_factory=LineParameters)


@dataclass(frozen=True)
class Cylinder:
    """A linkage as the sheet states it."""

    record: Any

    def stroke(self, angle: float) -> float:
        """Return the stroke, m, at the joint's angle, rad."""
        return float(linkage.stroke(angle, self.record))

    def angle(self, stroke: float) -> float:
        """Return the angle, rad, at the stroke, m."""
        return float(linkage.angle(stroke, self.record))


class Motor:
    """The base, whose stroke is its angle."""

    def stroke(self, angle: float) -> float:
        """Return the angle."""
        return angle

    def angle(self, stroke: float) -> float:
        """Return the angle."""
        return stroke


def cascade_parameters() -> CascadeParameters:
    """Return the parameters of law (11), for every joint: with one lag the TCP keeps its line."""
    return CascadeParameters(gain=GAIN)


def force_loops(robot: Robot) -> RobotForceLoopParameters:
    """Return the force loops' parameters as the robot's sheet makes them.

    Every gain makes the oil of its cylinder, at half stroke, relax at the same rate.
    """
    reaches = tuple(reach(shape) for shape in robot.linkages)
    strokes = (ENDLESS, *((of.stroke_low, of.stroke_high) for of in reaches))
    return RobotForceLoopParameters(
        **{
            name: _force_loop(machine, *ends)
            for name, machine, ends in zip(JOINTS, machines(robot, reaches), strokes, strict=True)
        }
    )


def _force_loop(machine: Machine, low: float, high: float) -> ForceLoopParameters:
    c, v, stroke = machine.cylinder, machine.valve, 0.5 * (low + high)
    lifting = c.volume_lifting_0 + c.area_lifting * stroke
    lowering = c.volume_lowering_0 - c.area_lowering * stroke
    spring = c.beta * (c.area_lifting**2 / lifting + c.area_lowering**2 / lowering)
    return ForceLoopParameters(
        gain=DAMPING_RATE / spring,
        time_constant=HIGH_PASS,
        prefilter=PrefilterParameters(
            area_lifting=c.area_lifting,
            area_lowering=c.area_lowering,
            flow_lifting=v.flow_nominal,
            flow_lowering=v.flow_nominal * v.flow_ratio_lowering,
            dead_zone=v.dead_zone,
        ),
        limits=LimitParameters(
            speed=1.1 * v.flow_nominal / c.area_lifting, stroke_low=low, stroke_high=high
        ),
    )


def path_parameters(robot: Robot) -> RobotPathParameters:
    """Return the picture of the arm as the robot's sheet makes it; the payload is not known."""
    g = robot.main.geometry
    return RobotPathParameters(
        arm=ArmParameters(
            height=robot.base.height,
            arm_length=g.boom_length / g.arms,
            arm_mass=g.boom_mass / g.arms,
            sections=g.sections_per_arm,
            section_spring=g.section_spring,
        )
    )


def trajectory(
    robot: Robot, name: str, move: TrajectoryParameters, path: RobotPathParameters
) -> RobotTrajectory:
    """Return the trajectory of that name, off the ends of the strokes as the force loops are.

    Raises ParameterError for an unknown name.
    """
    reaches = tuple(reach(shape) for shape in robot.linkages)
    drives = machines(robot, reaches)
    cylinders = [Cylinder(record(shape)[0]) for shape in robot.linkages]
    linkages: tuple[Linkage, ...] = (Motor(), *cylinders)
    by_number, margin = list(zip(cylinders, reaches, strict=True)), LimitParameters().end_margin
    return RobotTrajectory(
        name=name,
        arm=Arm(path.arm),
        linkages=linkages,
        ranges=Ranges(
            np.array([-math.pi, *(c.angle(of.stroke_low + margin) for c, of in by_number)]),
            np.array([math.pi, *(c.angle(of.stroke_high - margin) for c, of in by_number)]),
        ),
        fastest=np.array([m.valve.flow_nominal / m.cylinder.area_lifting for m in drives]),
        move=move,
        line=path.line,
    )

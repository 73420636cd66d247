"""The robot's controllers as its sheet makes them, and the posture in which it starts.

Needs no Pinocchio.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emir_analysis.machine_model import actuator
from emir_common.parameter_tree import declared, with_values
from emir_common.quantity import check_ranges, quantity
from emir_control.actuator import Actuator
from emir_control.arm import JOINTS, Arm, ArmParameters
from emir_control.cascade import CascadeParameters
from emir_control.drive_loop import DriveLoopParameters
from emir_control.internal_model import InternalModel
from emir_control.inverse import Ranges
from emir_control.limits import LimitParameters
from emir_control.pfc import PfcParameters
from emir_control.robot_trajectory import LineParameters, RobotTrajectory, Supply
from emir_control.trajectory import TrajectoryParameters
from emir_control.waypoints import Direct, Linkage
from emir_msgs_py.topics import CONTROL_PERIOD
from emir_plant.parameters import Machine
from emir_plant.robot import linkage
from emir_plant.robot.actuators import LOWERING, machines
from emir_plant.robot.parameters import Robot
from emir_plant.robot.reach import reach, record

Array = NDArray[np.float64]

# The whole robot swings at 0.27 to 0.5 Hz where joint 1 alone does at 0.7: with its gain of 2 1/s
# and high pass of 1 s the cascade would excite it. With these a single mode on the oil's spring
# between 0.27 and 0.7 Hz keeps a damping of 0.2 of critical (docs/robot.md).
GAIN = 0.7  # 1/s, k_p of law (11)
LAG = 0.05  # s, T of law (11): command held for a period, force loop's period, spool, resolver
RESPONSE = 3.0  # s, T_CLRT of (12): a gain of 0.74 1/s towards a set point 20 periods ahead
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

    base: DriveLoopParameters
    joint1: DriveLoopParameters
    joint2: DriveLoopParameters
    joint3: DriveLoopParameters
    joint4: DriveLoopParameters
    joint5: DriveLoopParameters


@dataclass(frozen=True, kw_only=True)
class RobotPathParameters:
    """The controller's picture of the arm, and the line."""

    arm: ArmParameters
    line: LineParameters = field(default_factory=LineParameters)
    weigh: int = quantity(
        "1", 0, 1, "1: the payload is read off the pistons' forces; 0: arm.payload", default=1
    )
    joint: int = quantity(
        "1", 0, 5, "that lift-lower and lower-lift move, 0 the base: its m are rad", default=1
    )
    supply: float = quantity("Pa", 1e6, 5e7, "what the pump gives", default=2e7)

    def __post_init__(self) -> None:
        check_ranges(self)


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


def cascade_parameters() -> CascadeParameters:
    """Return the parameters of law (11), for every joint: with one lag the TCP keeps its line."""
    return CascadeParameters(gain=GAIN, time_constant=LAG)


def pfc_parameters() -> PfcParameters:
    """Return the parameters of law (12), for every joint.

    Behind its force loop a piston moves with the command, late by a period. What the six do to
    each other no model of one of them tells. So the model error is taken to stay as it is now (its
    mean over 32 samples would come half a second late), and the response is the cascade's.
    """
    late = np.array([[1.0, CONTROL_PERIOD], [0.0, 0.0]])  # stroke, and the command that acts next
    model = InternalModel(late, np.array([0.0, 1.0]), np.array([1.0, 0.0]), CONTROL_PERIOD)
    return PfcParameters(model=model, response_time=RESPONSE, error_degree=0, error_window=1)


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


def _force_loop(machine: Machine, low: float, high: float) -> DriveLoopParameters:
    c, v, stroke = machine.cylinder, machine.valve, 0.5 * (low + high)
    lifting = c.volume_lifting_0 + c.area_lifting * stroke
    lowering = c.volume_lowering_0 - c.area_lowering * stroke
    spring = c.beta * (c.area_lifting**2 / lifting + c.area_lowering**2 / lowering)
    return DriveLoopParameters(
        gain=DAMPING_RATE / spring,
        time_constant=HIGH_PASS,
        actuator=actuator(machine),
        limits=LimitParameters(
            speed=LOWERING * v.flow_nominal / c.area_lifting, stroke_low=low, stroke_high=high
        ),
    )


def path_parameters(robot: Robot) -> RobotPathParameters:
    """Return the picture of the arm as the robot's sheet makes it; the payload is weighed."""
    g = robot.main.geometry
    return RobotPathParameters(
        arm=ArmParameters(
            height=robot.base.height,
            arm_length=g.boom_length / g.arms,
            arm_mass=g.boom_mass / g.arms,
            sections=g.sections_per_arm,
            section_spring=g.section_spring,
        ),
        supply=robot.main.supply.p0,
    )


def trajectory(
    robot: Robot, name: str, move: TrajectoryParameters, path: RobotPathParameters
) -> RobotTrajectory:
    """Return the trajectory of that name, off the ends of the strokes as the force loops are.

    Raises ParameterError for an unknown name.
    """
    reaches = tuple(reach(shape) for shape in robot.linkages)
    cylinders = [Cylinder(record(shape)[0]) for shape in robot.linkages]
    linkages: tuple[Linkage, ...] = (Direct(), *cylinders)
    by_number, margin = list(zip(cylinders, reaches, strict=True)), LimitParameters().end_margin
    return RobotTrajectory(
        name=name,
        arm=Arm(path.arm),
        linkages=linkages,
        ranges=Ranges(
            np.array([-math.pi, *(c.angle(of.stroke_low + margin) for c, of in by_number)]),
            np.array([math.pi, *(c.angle(of.stroke_high - margin) for c, of in by_number)]),
        ),
        drives=tuple(Actuator(actuator(machine)) for machine in machines(robot, reaches)),
        supply=Supply(path.supply, robot.pump.flow_max, robot.pump.droop),
        move=move,
        line=path.line,
        weigh=bool(path.weigh),
        joint=path.joint,
    )


def trajectory_of(
    robot: Robot, name: str, path: RobotPathParameters, values: Mapping[str, Any]
) -> RobotTrajectory:
    """Return the trajectory of that name with some of path's and move's values, by dotted name.

    Raises ParameterError for an unknown name or a value that cannot be.
    """
    of_path = {key: value for key, value in values.items() if key in declared(path)}
    of_move = {key: value for key, value in values.items() if key not in of_path}
    move = with_values(TrajectoryParameters(), of_move)
    return trajectory(robot, name, move, with_values(path, of_path))

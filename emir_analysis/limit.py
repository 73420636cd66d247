"""The smallest dynamic deflection of the TCP that any command could reach for a move.

Nothing is asked of valve, oil and controller but that the piston goes no faster than the valve's
flow moves it. What is left is the boom: a linear program (`emir_control/least_bending.py`).
"""

import math
from dataclasses import dataclass

from emir_analysis.machine_model import boom, joint_rates
from emir_common.quantity import ParameterError
from emir_control.least_bending import STEP, Motion, NoMotionError, Task, limit
from emir_control.trajectory import Trapezoid
from emir_plant import linkage
from emir_plant.parameters import Machine
from emir_plant.record import record

SHORTEST = 20 * STEP  # s
LONGEST = 20.0  # s: memory and time of the optimization grow with its square


@dataclass(frozen=True)
class Move:
    """From rest to rest: start angle, rad; stroke, m, lifting positive; duration, s."""

    angle: float
    stroke: float
    duration: float


PAPER_MOVE = Trapezoid(0.06375, 0.025, 0.75)  # paper 3.2


def turn(machine: Machine, move: Move) -> float:
    """Return by how much the joint turns in the move, rad.

    Raises ParameterError where the boom cannot stand or the piston would leave the triangle.
    """
    p = record(machine)[0]
    lowest, highest = linkage.reach(p)
    if not lowest < move.angle < highest:
        raise ParameterError(
            f"angle = {math.degrees(move.angle):g} deg: outside the linkage's reach,"
            f" {math.degrees(lowest):.1f} ... {math.degrees(highest):.1f} deg"
        )
    try:
        end = linkage.angle(linkage.stroke(move.angle, p) + move.stroke, p)
    except ValueError:
        end = float("nan")
    if not abs(end) < 10.0:  # noqa: PLR2004 (an angle; not a number where there is no triangle)
        raise ParameterError(f"stroke = {move.stroke:g} m: the triangle of joint 1 ends before")
    return float(end - move.angle)


def least(machine: Machine, move: Move) -> Motion:
    """Return the move's motion with the smallest dynamic deflection.

    Raises ParameterError for a move that is none or that the valve's flow does not allow.
    """
    if move.stroke == 0.0 or not SHORTEST <= move.duration <= LONGEST:
        raise ParameterError(
            f"a move of {move.stroke:g} m in {move.duration:g} s: wanted is one of"
            f" {SHORTEST:g} ... {LONGEST:g} s that goes somewhere"
        )
    angle = turn(machine, move)
    low, high = joint_rates(machine, angle, move.stroke)
    try:
        return limit(boom(machine).clamped(), Task(angle, move.duration, low, high))
    except NoMotionError as error:
        raise ParameterError(str(error)) from None

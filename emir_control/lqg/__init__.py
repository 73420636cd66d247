"""LQG control of the boom about a planned move: from angles and pressures to the valve command.

At a move's start the payload is read from the piston force at rest, the move is planned for it
(`motion_plan.py`) and the regulator designed (`regulator.py`). Then, in each control period,

    u = u_plan - d - L (x - x_target),    x_target = 0 but for s = f,

with the state x, the unknown force f, flow d and load p estimated by a Kalman filter. The
drive's inverse (`actuator.py`) turns u into the valve command by the pressures as they will be
when it acts: those measured, led on by the commands under way and the plan.
"""

from emir_control.lqg.law import Lqg, Now
from emir_control.lqg.parameters import LqgParameters
from emir_control.lqg.planned_beside import PlannedBeside
from emir_control.lqg.state import UNMEASURED, LqgInputs, LqgOutputs, LqgState, are_numbers

__all__ = [
    "UNMEASURED",
    "Lqg",
    "LqgInputs",
    "LqgOutputs",
    "LqgParameters",
    "LqgState",
    "Now",
    "PlannedBeside",
    "are_numbers",
]

"""What goes into a step of the LQG control and comes out: state, inputs, outputs."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from emir_control.filling import Filled
from emir_control.motion_plan import MotionPlan
from emir_control.regulator import Regulator
from emir_control.spool_play import Sent
from emir_control.trajectory import Move

Array = NDArray[np.float64]


class Rest(NamedTuple):
    """Means at rest, since it began: control periods, F, N, bending and joint angle, rad."""

    periods: int
    force: float
    bending: float
    angle: float


class LqgState(NamedTuple):
    """Where the control stands.

    offset: of the measured bending, rad, in gravity of cos(alpha) = 1. estimate: (n,) x. past,
    openings: u off the plan, m/s, and openings of the valve of commands that are under way, the
    newest first. logic: block's opening. sent: the last command. moving: a move is under way or is
    to begin. filled: what a filling of the lowering chamber has told. cut: the move was to end too
    near to an end of the stroke. surprise: mean squared innovation, 1 as expected. loaded: a load
    seems to come or to go. reference: m, of the last period of standing by. known: it stands by
    since before the move. joins: it may take over in the move.
    """

    plan: MotionPlan
    regulator: Regulator
    payload: float
    offset: float
    rest: Rest
    estimate: Array
    past: tuple[float, ...]
    openings: tuple[float, ...]
    logic: float
    sent: Sent
    moving: bool
    filled: Filled
    cut: bool = False
    surprise: float = 1.0
    loaded: bool = False
    reference: float = math.nan
    known: bool = False
    joins: bool = False


class LqgInputs(NamedTuple):
    """Reference stroke, m, the move to make, and the measurements, SI units."""

    reference: float
    move: Move
    angle: float
    pressure_lifting: float
    pressure_lowering: float
    deflection: float  # alpha_6 - alpha_1


class LqgOutputs(NamedTuple):
    """The command and what led to it."""

    valve_command: float  # y2, 1
    planned: float  # u of the plan, m/s
    wanted: float  # u, m/s
    flow: float  # d, m/s
    force: float  # f, N
    payload: float  # kg
    deflection: float  # dynamic, of the TCP, as estimated, m
    limited: bool = False  # off an end of the stroke: the command, or the move as planned


UNMEASURED = LqgOutputs(0.0, math.nan, math.nan, math.nan, math.nan, math.nan, math.nan)


def are_numbers(inputs: LqgInputs) -> bool:
    """Tell whether reference and measurements are numbers."""
    return all(map(math.isfinite, (inputs.reference, *inputs[2:])))

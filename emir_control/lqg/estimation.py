"""The Kalman filter of the LQG control: the state corrected by what is measured, and led on."""

import math

import numpy as np
from numpy.typing import NDArray

from emir_control.actuator import Actuator
from emir_control.lqg.state import LqgInputs, LqgState
from emir_control.motion_plan import Target
from emir_control.regulator import Filter, Regulator

Array = NDArray[np.float64]

SURPRISE_SHARE = 0.2  # of a period in the mean surprise
SHUT_DECAY = 0.8  # of the unknown flow from period to period while the valve is shut


def corrected(
    drive: Actuator, state: LqgState, inputs: LqgInputs, target: Target, known: Filter
) -> tuple[Array, float]:
    """Return x, (n,), corrected by what is measured, and the mean surprise."""
    law = state.regulator
    force = drive.force(inputs.pressure_lifting, inputs.pressure_lowering)
    bending = target.bending + state.offset * math.cos(target.angle)
    measured = np.array([
        inputs.angle - target.angle,
        inputs.deflection - bending,
        (force - target.force) / state.plan.stiffness,
    ])  # fmt: skip
    innovation = measured - law.C @ state.estimate
    squared = float(innovation @ known.certainty @ innovation) / len(innovation)
    surprise = state.surprise + SURPRISE_SHARE * (squared - state.surprise)
    gain = known.loaded if state.loaded else known.gain
    return state.estimate + gain @ innovation, surprise


def predicted(law: Regulator, estimate: Array, given: tuple[float, ...], *, shut: bool) -> Array:
    """Return x, (n,), a period later; given: u off the plan, m/s, the newest first."""
    ahead: Array = law.A @ estimate + law.B @ np.array(given)
    if shut:  # a shut valve lets no unknown flow through
        ahead[law.flow] *= SHUT_DECAY
    return ahead

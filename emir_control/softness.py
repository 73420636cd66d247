"""For which oil to design where its stiffness is only known within a tolerance.

Plan, observer and feedback take the oil for `softness` times as stiff as stated, the machine's is
`stiffness` times as stiff. The plan's force F_p, off that at rest, then takes another flow, by

    d = (1 / softness - 1 / stiffness) F_p' / k_h    (k_h as stated)

and the boom bends off its plan, from which the feedback brings it back. Both are linear, so the
largest bending in a move follows without the machine; chosen is the softness for which it is
smallest, at the worse end of the tolerance, over postures, payloads and directions.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
import scipy
from numpy.typing import NDArray

from emir_control.actuator import Actuator
from emir_control.boom import Boom
from emir_control.drive_plan import SUBSTEPS
from emir_control.least_bending import Task, limit
from emir_control.lqg import Lqg, LqgParameters
from emir_control.motion_plan import MotionPlan, holding
from emir_control.prefilter import joint_angle, piston_stroke
from emir_control.regulator import Regulator, regulator
from emir_control.trajectory import Move

Array = NDArray[np.float64]

MACHINE_MODES = 5  # of the boom in the model of the machine
CLOSE = 5e-3  # of the softness


@dataclass(frozen=True)
class Case:
    """A move: start angle, rad; payload, kg; distance, m; duration, s."""

    angle: float
    payload: float
    distance: float
    duration: float = 3.3


CASES = tuple(
    Case(math.radians(angle), payload, distance)
    for angle, payload, distance in product((35.0, 60.0), (0.0, 700.0, 1400.0), (0.06375, -0.06375))
)  # of the paper's size, over the range of postures and payloads


@dataclass(frozen=True)
class Robustness:
    """What wrong oil does to a control law in some moves."""

    parameters: LqgParameters
    cases: tuple[Case, ...] = CASES

    @cached_property
    def limits(self) -> Array:
        """The smallest bending in each case, whatever the command, (k,) m."""
        return np.array([_least(self.parameters, case) for case in self.cases])

    def ratios(self, softness: float, stiffnesses: Sequence[float]) -> Array:
        """Return the largest bending over the limit, (k, n), with oil of stiffnesses, (n,)."""
        law = Lqg(replace(self.parameters, softness=softness))
        bending = [_largest(law, case, stiffnesses) for case in self.cases]
        return np.array(bending) / self.limits[:, np.newaxis]

    def best(self, tolerance: float) -> float:
        """Return the softness whose worst ratio is smallest; takes half a minute."""
        ends = 1.0 - tolerance, 1.0 + tolerance
        found = scipy.optimize.minimize_scalar(
            lambda softness: float(self.ratios(softness, ends).max()),
            bounds=ends,
            method="bounded",
            options={"xatol": CLOSE},
        )
        return float(found.x)


def _largest(law: Lqg, case: Case, stiffnesses: Sequence[float]) -> list[float]:
    """Return the largest bending, m, with each of the stiffnesses."""
    p = law.parameters
    boom, start = p.boom.loaded(case.payload), piston_stroke(case.angle, p.actuator.static)
    plan = law.planner.plan(boom, start, Move(-p.lead, case.duration, case.distance))
    middle = start + 0.5 * case.distance
    known = regulator(boom, law.drive, middle, p.period, p.regulator)
    machine = replace(p.regulator, modes=MACHINE_MODES)
    bending = []
    for stiffness in stiffnesses:
        drive, stiffer = Actuator(p.actuator, stiffness), stiffness / p.softness
        real = regulator(boom, drive, middle, p.period, machine)
        pushed = _pushed(boom, drive, plan) / drive.stiffness(middle)
        off = _off_the_plan(known, real, stiffer, (stiffer - 1.0) * np.diff(pushed) / p.period)
        bending.append(float(abs(plan.deflection[SUBSTEPS::SUBSTEPS] + off).max()))
    return bending


def _pushed(boom: Boom, drive: Actuator, plan: MotionPlan) -> Array:
    """Return the plan's force off that at rest, N, at the ends of the control periods."""
    resting = [holding(boom, drive, float(angle)) for angle in plan.angle[::SUBSTEPS]]
    return np.asarray(plan.force[::SUBSTEPS] - resting)


def _off_the_plan(known: Regulator, real: Regulator, stiffer: float, lacking: Array) -> Array:
    """Return the dynamic deflection off the plan, (n,), m, after each control period.

    stiffer: than known, the machine's oil. lacking: (n,) m/s, flow in each period.
    """
    m = real.controlled
    x, past, estimate = np.zeros(m), np.zeros(known.delays), np.zeros(len(known.A))
    deflection = np.zeros(len(lacking))
    for k, flow in enumerate(lacking):
        measured = real.C[:, :m] @ x
        measured[-1] *= stiffer
        estimate = estimate + known.moving.gain @ (measured - known.C @ estimate)
        u = np.append(known.command(estimate, past), past)
        x = real.A[:m, :m] @ x + real.B[:m] @ u + real.A[:m, real.flow] * flow
        estimate, past = known.A @ estimate + known.B @ u, u[:-1]
        deflection[k] = real.deflection @ x[: real.modes]
    return deflection


def _least(p: LqgParameters, case: Case) -> float:
    """Return the limit, m."""
    linkage = p.actuator.static
    turn = joint_angle(piston_stroke(case.angle, linkage) + case.distance, linkage) - case.angle
    arm = case.distance / turn
    low, high = linkage.speeds
    boom = p.boom.loaded(case.payload).clamped()
    return limit(boom, Task(turn, case.duration, low / arm, high / arm)).largest

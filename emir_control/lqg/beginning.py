"""What a move or a rest begins with: readings at rest, and the plan and regulator from them."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from emir_control.actuator import Actuator
from emir_control.boom import Boom
from emir_control.filling import NOT_FILLED, Filled
from emir_control.lqg.parameters import LqgParameters
from emir_control.lqg.state import LqgInputs, LqgState, Rest
from emir_control.motion_plan import MotionPlan, Planner, resting
from emir_control.prefilter import joint_angle, lever_arm, piston_stroke
from emir_control.regulator import regulator
from emir_control.spool_play import Sent
from emir_control.trajectory import NO_MOVE, Move

# m, of the stroke off its reference: some mm are left at rest and made good with the move; from
# further off a plan begins where the machine is
ASTRAY = 0.01


@dataclass(frozen=True)
class Beginning:
    """How a state begins; holds the drive and the planner that all of the control shares."""

    parameters: LqgParameters

    @cached_property
    def drive(self) -> Actuator:
        """The drive as the law takes it to be."""
        p = self.parameters
        return Actuator(p.actuator, p.softness)

    @cached_property
    def planner(self) -> Planner:
        """What plans the moves."""
        p = self.parameters
        return Planner(self.drive, p.period, self.late, p.allowance)

    @property
    def late(self) -> float:
        """From measurement to spool, s."""
        return self.parameters.regulator.delay + self.drive.lag

    @property
    def enough(self) -> int:
        """Control periods over which is read at rest."""
        return round(self.parameters.reading_time / self.parameters.period)

    def read(self, last: Rest, inputs: LqgInputs, count: int, most: int) -> Rest:
        """Return the means at rest with a further reading, the count-th, of the most that count."""
        force = self.drive.force(inputs.pressure_lifting, inputs.pressure_lowering)
        now = Rest(count, force, inputs.deflection, inputs.angle)
        weight = 1.0 / min(count, most)
        return Rest(count, *(a + weight * (b - a) for a, b in zip(last[1:], now[1:], strict=True)))

    def rested(self, state: LqgState, inputs: LqgInputs) -> LqgState:
        """Return the state with the means of a rest; it begins anew on another load."""
        p, last = self.parameters, state.rest
        force = self.drive.force(inputs.pressure_lifting, inputs.pressure_lowering)
        other = abs(force - last.force) > p.other_load
        count = 1 if state.moving or other else last.periods + 1
        rest = self.read(last, inputs, count, self.enough)
        if state.filled.moved and not state.moving:  # what was read before still holds
            rest = rest._replace(force=last.force, bending=last.bending)
        filled = NOT_FILLED if state.moving else state.filled
        off = rest.force - state.plan.at(math.inf).force
        if count == self.enough and abs(off) > p.other_load and not filled.moved:
            resting_on = inputs._replace(move=NO_MOVE)
            return self.begun(rest, resting_on, state.logic, state.sent, filled)
        return state._replace(rest=rest, moving=False, filled=filled)

    def under_way(self, move: Move) -> bool:
        """Tell whether a move is to be planned or made, or has just ended."""
        p = self.parameters
        return bool(move.distance) and -p.lead <= move.since < move.duration + p.settling

    def weight(self, angle: float) -> float:
        """Return the force at rest at an angle, rad, over the torque of the level boom, 1/m."""
        return math.cos(angle) / lever_arm(angle, self.parameters.actuator.static)

    def begun(
        self, rest: Rest, inputs: LqgInputs, logic: float, sent: Sent, filled: Filled
    ) -> LqgState:
        """Return the state at the start of a move, or of a rest, with what was read at rest."""
        p, drive, move = self.parameters, self.drive, inputs.move
        linkage = p.actuator.static
        ends = inputs.reference, inputs.reference + move.distance
        here, end = self.off_the_ends(rest, ends)
        cut = (here, end) != ends
        actual = piston_stroke(rest.angle, linkage)
        if abs(actual - here) > ASTRAY:
            here = actual
        start = actual if filled.moved else here
        move = move._replace(distance=end - start if move.distance else 0.0)
        angle = joint_angle(here, linkage)
        payload = self._payload(rest.force, angle)
        boom = p.boom.loaded(payload)
        plan = self._plan(boom, start, move)
        law = regulator(boom, drive, start + 0.5 * move.distance, p.period, p.regulator)
        estimate = np.zeros(len(law.A))
        if move.distance:
            estimate[law.force] = math.copysign(p.friction / plan.stiffness, move.distance)
        hanging = float(plan.bending[0]) / math.cos(float(plan.angle[0]))
        offset = rest.bending / math.cos(angle) - hanging
        past = (0.0,) * law.delays
        return LqgState(
            plan=plan, regulator=law, payload=payload, offset=offset, rest=rest,
            estimate=estimate, past=past, openings=past, logic=logic, sent=sent,
            moving=inputs.move.distance != 0.0, filled=filled, cut=cut,
        )  # fmt: skip

    def off_the_ends(self, rest: Rest, ends: tuple[float, float]) -> tuple[float, float]:
        """Return start and end of a move, m, kept off the ends of the stroke.

        Who stands beyond the margin may stay there.
        """
        here = piston_stroke(rest.angle, self.parameters.actuator.static)
        low, high = self.parameters.limits.free_stroke
        start, end = (min(max(place, min(low, here)), max(high, here)) for place in ends)
        return start, end

    def _payload(self, force: float, angle: float) -> float:
        """Return the payload, kg, that a force at rest, N, holds at an angle of the joint, rad."""
        return self.parameters.boom.payload(force / self.weight(angle))

    def _plan(self, boom: Boom, start: float, move: Move) -> MotionPlan:
        if move.distance == 0.0:
            return resting(boom, self.drive, start)
        return self.planner.plan(boom, start, move)

"""The LQG control while another one drives, and how it takes over, at rest or within a move."""

import math
from dataclasses import dataclass

import numpy as np

from emir_control.actuator import Oil
from emir_control.filling import NOT_FILLED
from emir_control.lqg.beginning import Beginning
from emir_control.lqg.estimation import corrected
from emir_control.lqg.state import LqgInputs, LqgState, are_numbers
from emir_control.motion_plan import UnderWay
from emir_control.prefilter import piston_stroke
from emir_control.spool_play import SHUT, Sent
from emir_control.trajectory import NO_MOVE

LONGER = 2  # times the reading time: another controller may leave the boom swinging
TO_JOIN = 1.0  # s of a move that have to be left for another one to take over
TO_CATCH_UP = 0.5  # s after the move's end: who drove before may have been behind
SAME_PLACE = 1e-6  # m


@dataclass(frozen=True)
class StandingBy:
    """What is watched meanwhile, and what is led on from there."""

    beginning: Beginning

    def step(self, state: LqgState, inputs: LqgInputs) -> tuple[LqgState, bool]:
        """Return the next state while another one drives, and whether this one may take over."""
        if not are_numbers(inputs):
            return state._replace(reference=math.nan, known=False, joins=False), False
        begin = self.beginning
        moves = inputs.reference != state.reference or begin.under_way(inputs.move)
        enough = LONGER * begin.enough
        rest = begin.read(state.rest, inputs, 1 if moves else state.rest.periods + 1, enough)
        period = begin.parameters.period
        logic = begin.drive.next_logic(state.logic, inputs.pressure_lifting, period)
        state = state._replace(rest=rest, moving=False, filled=NOT_FILLED, logic=logic)
        if rest.periods == enough:
            state = begin.begun(rest, inputs._replace(move=NO_MOVE), logic, SHUT, NOT_FILLED)
        elif rest.periods < enough:
            state = self._watched(state, inputs)
        known = self._is_known(state, inputs)
        joins = known and 0.0 <= inputs.move.since < inputs.move.duration - TO_JOIN
        state = self._continuing(state, inputs) if joins else state
        state = state._replace(reference=inputs.reference, known=known, joins=joins)
        return state, joins or rest.periods >= enough

    def joined(self, state: LqgState, inputs: LqgInputs) -> LqgState:
        """Return the state that leads the move under way, another one's, to its end."""
        begin, law, move = self.beginning, state.regulator, inputs.move
        rest = state.plan.at(math.inf)
        x, _ = corrected(begin.drive, state, inputs, rest, law.watching)
        boom = begin.parameters.boom.loaded(state.payload)
        clamped, modes = boom.clamped(), np.zeros((2, len(boom.joint)))
        modes[:, : law.modes] = x[: law.modes], x[law.modes : 2 * law.modes]
        now = UnderWay(
            time=move.since,
            angle=rest.angle + float(boom.joint @ modes[0]),
            rate=float(boom.joint @ modes[1]),
            shape=boom.sag() * math.cos(rest.angle) + clamped.rigid * rest.angle + modes[0],
            swinging=modes[1],
            force=rest.force + state.plan.stiffness * float(x[2 * law.modes] - x[law.force]),
            velocity=float(x[law.flow]),
        )
        _, end = begin.off_the_ends(state.rest, (rest.stroke, rest.stroke + move.distance))
        left = move.duration - move.since + TO_CATCH_UP
        plan = begin.planner.onward(boom, now, end, left)
        estimate = np.zeros(len(law.A))
        estimate[law.force] = x[law.force] * state.plan.stiffness / plan.stiffness
        return state._replace(
            plan=plan, estimate=estimate, past=(0.0,) * law.delays, moving=True, joins=False,
            cut=end != rest.stroke + move.distance, surprise=1.0, loaded=False,
        )  # fmt: skip

    def _is_known(self, state: LqgState, inputs: LqgInputs) -> bool:
        """Tell whether the move, or the rest before one, began where this one knows the boom."""
        if inputs.move.since >= 0.0:
            return state.known
        return abs(inputs.reference - state.plan.at(math.inf).stroke) < SAME_PLACE

    def _watched(self, state: LqgState, inputs: LqgInputs) -> LqgState:
        """Return the state with the motion off the last rest, by whatever commands it."""
        law, target = state.regulator, state.plan.at(math.inf)
        estimate, _ = corrected(self.beginning.drive, state, inputs, target, law.watching)
        return state._replace(estimate=law.A @ estimate)

    def _continuing(self, state: LqgState, inputs: LqgInputs) -> LqgState:
        """Return the state with the command that goes on with u as it has been found."""
        drive = self.beginning.drive
        stroke = piston_stroke(inputs.angle, drive.parameters.static)
        oil = Oil(stroke, inputs.pressure_lifting, inputs.pressure_lowering, state.logic)
        opening = drive.opening(float(state.estimate[state.regulator.flow]), oil.with_open_block())
        openings = (opening,) * len(state.openings)
        demand = drive.command(opening)
        return state._replace(sent=Sent(demand, demand), openings=openings)

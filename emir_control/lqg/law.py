"""The LQG control law: a valve command each period, about the plan, by feedback and inverse."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from emir_control.actuator import Actuator, Oil
from emir_control.filling import NOT_FILLED
from emir_control.limits import off_the_ends
from emir_control.lqg.beginning import Beginning
from emir_control.lqg.chamber_filling import ChamberFilling
from emir_control.lqg.estimation import corrected, predicted
from emir_control.lqg.parameters import LqgParameters
from emir_control.lqg.standing_by import StandingBy
from emir_control.lqg.state import (
    UNMEASURED,
    LqgInputs,
    LqgOutputs,
    LqgState,
    Rest,
    are_numbers,
)
from emir_control.motion_plan import MotionPlan, Planner
from emir_control.prefilter import piston_stroke
from emir_control.regulator import Regulator
from emir_control.spool_play import SHUT, taken_up
from emir_control.trajectory import NO_MOVE

Array = NDArray[np.float64]

SURPRISE = 4.0  # squared innovation, 1 as expected, that tells of a load that came or went


class Now(NamedTuple):
    """When a command acts, s since the plan's start, for how long, s, and on what oil."""

    time: float
    dt: float
    oil: Oil


@dataclass(frozen=True)
class Lqg:
    """The control law. A plan takes some tenths of a second, a step a tenth of a millisecond."""

    parameters: LqgParameters

    @property
    def drive(self) -> Actuator:
        """The drive as the law takes it to be."""
        return self._beginning.drive

    @property
    def planner(self) -> Planner:
        """What plans the moves."""
        return self._beginning.planner

    @cached_property
    def _beginning(self) -> Beginning:
        return Beginning(self.parameters)

    @cached_property
    def _filling(self) -> ChamberFilling:
        return ChamberFilling(self._beginning)

    @cached_property
    def _standing_by(self) -> StandingBy:
        return StandingBy(self._beginning)

    def initial(self, inputs: LqgInputs) -> LqgState:
        """Return the state of a machine that rests with what is measured now, all numbers."""
        force = self.drive.force(inputs.pressure_lifting, inputs.pressure_lowering)
        rest = Rest(1, force, inputs.deflection, inputs.angle)
        piloted = inputs.pressure_lifting > self.parameters.actuator.threshold
        start = inputs._replace(move=NO_MOVE)
        return self._beginning.begun(rest, start, float(piloted), SHUT, NOT_FILLED)

    def step(self, state: LqgState, inputs: LqgInputs, dt: float) -> tuple[LqgState, LqgOutputs]:
        """Return the valve command of this control period of dt, s.

        An input that is not a number shuts the valve; with the next that is one it goes on.
        """
        if not are_numbers(inputs):
            return state._replace(sent=SHUT), UNMEASURED
        state = self._prepared(state, inputs)
        if self._filling.is_due(state, inputs):
            return self._filling.step(state, inputs, dt)
        if state.filled.moved and not (state.filled.over or state.moving):
            state = self._filling.ended(state, inputs)
        waits = state.moving and inputs.move.since < self._begins
        if waits and not state.filled.moved:
            return self._waiting(state, inputs)
        return self._controlled(state, inputs, dt, waits=waits)

    def stand_by(self, state: LqgState, inputs: LqgInputs) -> tuple[LqgState, bool]:
        """Return the next state while another one drives, and whether this one may take over.

        It may where the reference has rested for long enough to read the payload, swinging boom or
        not; and in a move that it has watched from the start, with time left.
        """
        return self._standing_by.step(state, inputs)

    def plans(self, state: LqgState, inputs: LqgInputs) -> bool:
        """Tell whether the move is to be planned in this step.

        One that had begun without this controller is not: nobody knows how far it has come.
        """
        return self.is_asked(state, inputs) and inputs.move.since <= self.parameters.period

    def is_asked(self, state: LqgState, inputs: LqgInputs) -> bool:
        """Tell whether a move is to be made that has no plan."""
        return self._beginning.under_way(inputs.move) and not (state.moving or state.joins)

    def planned(self, state: LqgState, inputs: LqgInputs) -> LqgState:
        """Return the state with the plan for the move that comes.

        Raises NoMotionError where the drive cannot make it.
        """
        if state.filled.over:
            return self._filling.onward(state, inputs)
        return self._beginning.begun(state.rest, inputs, state.logic, state.sent, state.filled)

    def continued(self, planned: LqgState, now: LqgState, inputs: LqgInputs) -> LqgState:
        """Return the state that makes a move planned some periods ago; now: the state at rest.

        Where the plan comes after its first command is due, it is led on from where all is now.
        """
        if inputs.move.since > self._begins:
            return self._standing_by.joined(now, inputs)
        planned = planned._replace(logic=now.logic, sent=now.sent)
        if now.filled.over:  # the boom swings from the filling
            return planned._replace(estimate=now.estimate, past=now.past, openings=now.openings)
        return planned

    @property
    def _begins(self) -> float:
        """When the plan's first command has to be given, s since the move's start."""
        return -self._beginning.late - self.parameters.period

    def _prepared(self, state: LqgState, inputs: LqgInputs) -> LqgState:
        """Return the state with a plan for the move that begins, or the rest's means."""
        if state.joins:
            return self._standing_by.joined(state, inputs)
        if self.plans(state, inputs):
            return self.planned(state, inputs)
        if state.moving and self._beginning.under_way(inputs.move):
            return state
        return self._beginning.rested(state, inputs)

    def _waiting(self, state: LqgState, inputs: LqgInputs) -> tuple[LqgState, LqgOutputs]:
        """Return the shut valve of a move that is planned and has not begun."""
        logic = self.drive.next_logic(state.logic, inputs.pressure_lifting, self.parameters.period)
        outputs = LqgOutputs(0.0, 0.0, 0.0, 0.0, 0.0, state.payload, 0.0)
        return state._replace(sent=SHUT, logic=logic), outputs

    def _controlled(
        self, state: LqgState, inputs: LqgInputs, dt: float, *, waits: bool
    ) -> tuple[LqgState, LqgOutputs]:
        """Return the command about the plan; waits: its motion has not begun."""
        plan, law = state.plan, state.regulator
        time = inputs.move.since if state.moving else math.inf
        acts = time + self._beginning.late
        target = plan.at(time)
        arrived = waits or time >= plan.ends
        known = law.at_rest if arrived else law.moving
        estimate, surprise = corrected(self.drive, state, inputs, target, known)
        loaded = surprise > (1.0 if state.loaded else SURPRISE)
        state = state._replace(surprise=surprise, loaded=loaded)
        planned = plan.velocity(acts, dt)
        measured = inputs.pressure_lifting, inputs.pressure_lowering, state.logic
        oil = self._acting(state, Oil(target.stroke, *measured), time, dt).with_open_block()
        wanted = planned + self._feedback(state, estimate, Now(acts, dt, oil))
        allowed = self._allowed(wanted, inputs.angle)
        opening = 0.0
        if not self._rests(law, estimate, allowed, arrived=arrived):
            opening, oil = self._opened(plan, allowed, Now(acts, dt, oil))
        given = self.drive.velocity(opening, oil) - planned
        after = self._moved(state, estimate, given, opening, inputs)
        outputs = LqgOutputs(
            after.sent.command,
            planned,
            allowed,
            float(estimate[law.flow]),
            float(estimate[law.force]) * plan.stiffness,
            state.payload,
            float(law.deflection @ self._off(state, estimate)[: law.modes]),
            limited=state.cut or allowed != wanted,
        )
        return after, outputs

    def _acting(self, state: LqgState, oil: Oil, time: float, dt: float) -> Oil:
        """Return the oil when the command of this period begins to act."""
        whole, part = divmod(self._beginning.late, dt)
        spans = [part, *[dt] * int(whole)]
        for span, opening in zip(spans, reversed(state.openings), strict=True):
            for half in (time, time + 0.5 * span):
                velocity = state.plan.piston(half, 0.5 * span)
                oil = self.drive.ahead(oil, opening, velocity, 0.5 * span)
            time += span
        return oil

    def _feedback(self, state: LqgState, estimate: Array, now: Now) -> float:
        """Return u off the plan, m/s."""
        return state.regulator.command(estimate, np.array(state.past))

    def _off(self, state: LqgState, estimate: Array) -> Array:
        return state.regulator.off(estimate, np.array(state.past))

    def _allowed(self, wanted: float, angle: float) -> float:
        """Return what of a velocity u, m/s, keeps within the limits at a measured angle, rad."""
        p = self.parameters.limits
        stroke = piston_stroke(angle, self.parameters.actuator.static)
        return off_the_ends(min(max(wanted, -p.speed), p.speed), stroke, 0.0, p)

    def _rests(self, law: Regulator, estimate: Array, wanted: float, *, arrived: bool) -> bool:
        """Tell whether the valve stays shut."""
        p = self.parameters
        q = estimate[: law.modes] - law.held[: law.modes] * estimate[law.load]
        if not arrived:
            return abs(wanted) < p.standstill
        quiet = abs(law.deflection @ q) < p.rest_deflection
        return bool(
            (quiet and abs(law.position @ q) < p.rest_position) or abs(wanted) < p.rest_standstill
        )

    def _opened(self, plan: MotionPlan, wanted: float, now: Now) -> tuple[float, Oil]:
        """Return the opening that gives u, m/s, and the oil in the middle of its period."""
        opening = self.drive.opening(wanted, now.oil)
        if not opening:
            return opening, now.oil
        # the pressures change while it acts
        half = 0.5 * now.dt
        velocity = plan.piston(now.time, half)
        oil = self.drive.ahead(now.oil, opening, velocity, half).with_open_block()
        return self.drive.opening(wanted, oil), oil

    def _moved(
        self, state: LqgState, estimate: Array, given: float, opening: float, inputs: LqgInputs
    ) -> LqgState:
        """Return the next period's state under an opening that gives u off the plan, m/s."""
        law, period = state.regulator, self.parameters.period
        given_all = (given, *state.past)
        demand = self.drive.command(opening)
        return state._replace(
            estimate=predicted(law, estimate, given_all, shut=opening == 0.0),
            past=given_all[:-1],
            openings=(opening, *state.openings)[:-1],
            logic=self.drive.next_logic(state.logic, inputs.pressure_lifting, period),
            sent=taken_up(demand, state.sent, self.parameters.hysteresis),
        )

"""LQG control of the boom about a planned move: from angles and pressures to the valve command.

At a move's start the payload is read from the piston force at rest, the move is planned for it
(`motion_plan.py`) and the regulator designed (`regulator.py`). Then, in each control period,

    u = u_plan - d - L (x - x_target),    x_target = 0 but for s = f,

with the state x, the unknown force f, flow d and load p estimated by a Kalman filter. The
drive's inverse (`actuator.py`) turns u into the valve command by the pressures as they will be
when it acts: those measured, led on by the commands under way and the plan.
"""

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from emir_common.quantity import check_ranges, quantity
from emir_control.actuator import Actuator, ActuatorParameters, Oil
from emir_control.boom import Boom, BoomTable
from emir_control.filling import NOT_FILLED, Filled, FillParameters
from emir_control.limits import LimitParameters, off_the_ends
from emir_control.motion_plan import MotionPlan, Planner, Target, UnderWay, resting
from emir_control.prefilter import (
    joint_angle,
    piston_stroke,
    piston_velocity,
)
from emir_control.regulator import Filter, Regulator, RegulatorParameters, regulator
from emir_control.spool_play import SHUT, Sent, taken_up
from emir_control.trajectory import NO_MOVE, Move

Array = NDArray[np.float64]

LEAST_OPEN = 0.05  # logic block: what the drive's inverse reckons with at least
STANDING_BY = 2  # times the reading time: another controller may leave the boom swinging
TO_JOIN = 1.0  # s of a move that have to be left for another one to take over
TO_CATCH_UP = 0.5  # s after the move's end: who drove before may have been behind
SAME = 1e-6  # m
SHUT_DECAY = 0.8  # of the unknown flow from period to period while the valve is shut
SURPRISE_SHARE = 0.2  # of a period in the mean surprise
SURPRISE = 4.0  # squared innovation, 1 as expected, that tells of a load that came or went


@dataclass(frozen=True, kw_only=True)
class LqgParameters:
    """Model and tuning.

    boom: with its payloads. period: s, of control.
    """

    boom: BoomTable
    period: float = 0.032
    actuator: ActuatorParameters = field(default_factory=ActuatorParameters)
    regulator: RegulatorParameters = field(default_factory=RegulatorParameters)
    limits: LimitParameters = field(default_factory=LimitParameters)
    softness: float = quantity(
        "1", 0.1, 2.0, "of the stated k_h, what is reckoned with; see softness.py", default=0.86
    )
    allowance: float = quantity(
        "1", 0.0, 1.0, "of the plan's deflection over the smallest, for less travel", default=0.03
    )
    friction: float = quantity("N", 0.0, 1e5, "expected at the move's start", default=3e3)
    hysteresis: float = quantity("1", 0.0, 0.1, "width of the spool's play", default=0.01)
    standstill: float = quantity(
        "m/s", 0.0, 0.01, "below, the valve stays shut while moving", default=5e-4
    )
    rest_standstill: float = quantity("m/s", 0.0, 0.01, "the same at rest", default=3e-3)
    rest_deflection: float = quantity("m", 0.0, 1.0, "left alone at rest", default=2.5e-3)
    rest_position: float = quantity("m", 0.0, 1.0, "of the TCP left alone at rest", default=2e-2)
    lead: float = quantity("s", 0.1, 10.0, "before the move, when it is planned", default=0.6)
    fill: FillParameters = field(default_factory=FillParameters)
    reading_time: float = quantity(
        "s", 0.032, 10.0, "over which force and bending at rest are averaged", default=1.0
    )
    settling: float = quantity(
        "s", 0.0, 10.0, "from a move's end to the rest after it", default=1.0
    )
    other_load: float = quantity(
        "N", 1.0, 1e6, "force at rest off what it was: the payload is read anew", default=3e4
    )

    def __post_init__(self) -> None:
        check_ranges(self)


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


class Now(NamedTuple):
    """When a command acts, s since the plan's start, for how long, s, and on what oil."""

    time: float
    dt: float
    oil: Oil


@dataclass(frozen=True)
class Lqg:
    """The control law. A plan takes some tenths of a second, a step a tenth of a millisecond."""

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
        return Planner(self.drive, p.period, self._late, p.allowance)

    def initial(self, inputs: LqgInputs) -> LqgState:
        """Return the state of a machine that rests with what is measured now, all numbers."""
        force = self.drive.force(inputs.pressure_lifting, inputs.pressure_lowering)
        rest = Rest(1, force, inputs.deflection, inputs.angle)
        piloted = inputs.pressure_lifting > self.parameters.actuator.threshold
        start = inputs._replace(move=NO_MOVE)
        return self._begin(rest, start, float(piloted), SHUT, NOT_FILLED)

    def step(self, state: LqgState, inputs: LqgInputs, dt: float) -> tuple[LqgState, LqgOutputs]:
        """Return the valve command of this control period of dt, s.

        An input that is not a number shuts the valve; with the next that is one it goes on.
        """
        if not are_numbers(inputs):
            return state._replace(sent=SHUT), UNMEASURED
        state = self._prepared(state, inputs)
        if self._to_fill(state, inputs):
            return self._filling(state, inputs, dt)
        if state.filled.moved and not (state.filled.over or state.moving):
            state = self._full(state, inputs)
        waits = state.moving and inputs.move.since < self._begins
        if waits and not state.filled.moved:
            return self._waiting(state, inputs)
        plan, law = state.plan, state.regulator
        time = inputs.move.since if state.moving else math.inf
        target = plan.at(time)
        arrived = waits or time >= plan.ends
        known = law.at_rest if arrived else law.moving
        estimate, surprise = self._corrected(state, inputs, target, known)
        loaded = surprise > (1.0 if state.loaded else SURPRISE)
        state = state._replace(surprise=surprise, loaded=loaded)
        from_plan = plan.velocity(time + self._late, dt)
        measured = inputs.pressure_lifting, inputs.pressure_lowering, state.logic
        oil = _open(self._acting(state, Oil(target.stroke, *measured), time, dt))
        wanted = from_plan + self._feedback(state, estimate, Now(time + self._late, dt, oil))
        allowed = self._allowed(wanted, inputs.angle)
        limited, wanted = state.cut or allowed != wanted, allowed
        shut = self._resting(law, estimate, wanted, arrived=arrived)
        opening = 0.0 if shut else self.drive.opening(wanted, oil)
        if opening:  # the pressures change while it acts
            velocity = plan.piston(time + self._late, 0.5 * dt)
            oil = _open(self.drive.ahead(oil, opening, velocity, 0.5 * dt))
            opening = self.drive.opening(wanted, oil)
        given = self.drive.velocity(opening, oil) - from_plan
        after = self._moved(state, estimate, given, opening, inputs)
        outputs = LqgOutputs(
            after.sent.command,
            from_plan,
            wanted,
            float(estimate[law.flow]),
            float(estimate[law.force]) * plan.stiffness,
            state.payload,
            float(law.deflection @ self._off(state, estimate)[: law.modes]),
            limited,
        )
        return after, outputs

    def stand_by(self, state: LqgState, inputs: LqgInputs) -> tuple[LqgState, bool]:
        """Return the next state while another one drives, and whether this one may take over.

        It may where the reference has rested for long enough to read the payload, swinging boom or
        not; and in a move that it has watched from the start, with time left.
        """
        if not are_numbers(inputs):
            return state._replace(reference=math.nan, known=False, joins=False), False
        moves = inputs.reference != state.reference or self._under_way(inputs.move)
        enough = STANDING_BY * self._enough
        rest = self._read(state.rest, inputs, 1 if moves else state.rest.periods + 1, enough)
        logic = self.drive.next_logic(state.logic, inputs.pressure_lifting, self.parameters.period)
        state = state._replace(rest=rest, moving=False, filled=NOT_FILLED, logic=logic)
        if rest.periods == enough:
            state = self._begin(rest, inputs._replace(move=NO_MOVE), logic, SHUT, NOT_FILLED)
        elif rest.periods < enough:
            state = self._watched(state, inputs)
        place = state.plan.at(math.inf).stroke
        known = state.known if inputs.move.since >= 0.0 else abs(inputs.reference - place) < SAME
        joins = known and 0.0 <= inputs.move.since < inputs.move.duration - TO_JOIN
        state = self._continuing(state, inputs) if joins else state
        state = state._replace(reference=inputs.reference, known=known, joins=joins)
        return state, joins or rest.periods >= enough

    def _watched(self, state: LqgState, inputs: LqgInputs) -> LqgState:
        """Return the state with the motion off the last rest, by whatever commands it."""
        law, target = state.regulator, state.plan.at(math.inf)
        estimate, _ = self._corrected(state, inputs, target, law.watching)
        return state._replace(estimate=law.A @ estimate)

    def _continuing(self, state: LqgState, inputs: LqgInputs) -> LqgState:
        """Return the state with the command that goes on with u as it has been found."""
        stroke = piston_stroke(inputs.angle, self.parameters.actuator.static)
        oil = Oil(stroke, inputs.pressure_lifting, inputs.pressure_lowering, state.logic)
        opening = self.drive.opening(float(state.estimate[state.regulator.flow]), _open(oil))
        openings = (opening,) * len(state.openings)
        demand = self.drive.command(opening)
        return state._replace(sent=Sent(demand, demand), openings=openings)

    def _joined(self, state: LqgState, inputs: LqgInputs) -> LqgState:
        """Return the state that leads the move under way, another one's, to its end."""
        p, law, move = self.parameters, state.regulator, inputs.move
        rest = state.plan.at(math.inf)
        x, _ = self._corrected(state, inputs, rest, law.watching)
        boom = p.boom.loaded(state.payload)
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
        _, end = self._off_the_ends(state.rest, (rest.stroke, rest.stroke + move.distance))
        left = move.duration - move.since + TO_CATCH_UP
        plan = self.planner.onward(boom, now, end, left)
        estimate = np.zeros(len(law.A))
        estimate[law.force] = x[law.force] * state.plan.stiffness / plan.stiffness
        return state._replace(
            plan=plan, estimate=estimate, past=(0.0,) * law.delays, moving=True, joins=False,
            cut=end != rest.stroke + move.distance, surprise=1.0, loaded=False,
        )  # fmt: skip

    @property
    def _begins(self) -> float:
        """When the plan's first command has to be given, s since the move's start."""
        return -self._late - self.parameters.period

    @property
    def _late(self) -> float:
        """From measurement to spool, s."""
        return self.parameters.regulator.delay + self.drive.lag

    def _acting(self, state: LqgState, oil: Oil, time: float, dt: float) -> Oil:
        """Return the oil when the command of this period begins to act."""
        whole, part = divmod(self._late, dt)
        spans = [part, *[dt] * int(whole)]
        for span, opening in zip(spans, reversed(state.openings), strict=True):
            for half in (time, time + 0.5 * span):
                velocity = state.plan.piston(half, 0.5 * span)
                oil = self.drive.ahead(oil, opening, velocity, 0.5 * span)
            time += span
        return oil

    def _waiting(self, state: LqgState, inputs: LqgInputs) -> tuple[LqgState, LqgOutputs]:
        """Return the shut valve of a move that is planned and has not begun."""
        logic = self.drive.next_logic(state.logic, inputs.pressure_lifting, self.parameters.period)
        outputs = LqgOutputs(0.0, 0.0, 0.0, 0.0, 0.0, state.payload, 0.0)
        return state._replace(sent=SHUT, logic=logic), outputs

    def _to_fill(self, state: LqgState, inputs: LqgInputs) -> bool:
        """Tell whether the lowering chamber has to be filled before the move that comes."""
        move, fill = inputs.move, self.parameters.fill
        if state.moving or move.distance >= 0.0 or not -fill.lead <= move.since < 0.0:
            return False
        if state.filled.over:
            return False
        missing = self.parameters.actuator.threshold + fill.margin - inputs.pressure_lifting
        return missing > 0.0 or state.filled.velocity > 0.0

    def _filling(
        self, state: LqgState, inputs: LqgInputs, dt: float
    ) -> tuple[LqgState, LqgOutputs]:
        """Return a small opening that lets the pump fill the lowering chamber."""
        p, drive = self.parameters.actuator, self.drive
        stroke = inputs.reference + state.filled.moved
        oil = Oil(stroke, inputs.pressure_lifting, inputs.pressure_lowering, 0.0)
        missing = p.threshold + self.parameters.fill.margin - inputs.pressure_lifting
        velocity = self.parameters.fill.velocity(state.filled, missing, drive, stroke, dt)
        force = drive.force(inputs.pressure_lifting, inputs.pressure_lowering)
        before = joint_angle(inputs.reference, self.parameters.actuator.static)
        heavier = self._weight(inputs.angle) / self._weight(before)
        pushed = (force - heavier * state.rest.force) / drive.stiffness(stroke)
        given = max(velocity + self.parameters.fill.damping * pushed, 0.0)
        opening = drive.opening(-given, oil)
        demand = drive.command(opening)
        sent = Sent(demand, demand - (0.5 * self.parameters.hysteresis if given else 0.0))
        logic = drive.next_logic(state.logic, inputs.pressure_lifting, dt)
        moved = state.filled.moved - given * dt
        filled = Filled(moved, velocity)
        outputs = LqgOutputs(sent.command, -velocity, -given, 0.0, 0.0, state.payload, 0.0)
        rest = state.rest._replace(periods=0)
        after = state._replace(sent=sent, logic=logic, filled=filled, rest=rest)
        return after, outputs

    def _weight(self, angle: float) -> float:
        """Return the force at rest at an angle, rad, over the torque of the level boom, 1/m."""
        return math.cos(angle) / piston_velocity(1.0, angle, self.parameters.actuator.static)

    def _full(self, state: LqgState, inputs: LqgInputs) -> LqgState:
        """Return the state that rests where the filling has ended: the boom swings from it."""
        rest = state.rest._replace(angle=inputs.angle)
        filled = state.filled._replace(over=True)
        here = inputs._replace(move=NO_MOVE)
        return self._begin(rest, here, state.logic, state.sent, filled)

    def _onward(self, state: LqgState, inputs: LqgInputs) -> LqgState:
        """Return the state at the start of a move from where the chamber was filled.

        What is known of the swing and of what is under way stays known.
        """
        rest = state.rest._replace(angle=float(state.plan.angle[-1]))
        begun = self._begin(rest, inputs, state.logic, state.sent, state.filled)
        return begun._replace(
            estimate=state.estimate, past=state.past, openings=state.openings, rest=state.rest
        )

    def _prepared(self, state: LqgState, inputs: LqgInputs) -> LqgState:
        """Return the state with a plan for the move that begins, or the rest's means."""
        p = self.parameters
        if state.joins:
            return self._joined(state, inputs)
        if self._under_way(inputs.move):
            if state.moving:
                return state
            if state.filled.over:
                return self._onward(state, inputs)
            return self._begin(state.rest, inputs, state.logic, state.sent, state.filled)
        last = state.rest
        force = self.drive.force(inputs.pressure_lifting, inputs.pressure_lowering)
        other = abs(force - last.force) > p.other_load
        count = 1 if state.moving or other else last.periods + 1
        rest = self._read(last, inputs, count, self._enough)
        if state.filled.moved and not state.moving:  # what was read before still holds
            rest = rest._replace(force=last.force, bending=last.bending)
        filled = NOT_FILLED if state.moving else state.filled
        off = rest.force - state.plan.at(math.inf).force
        if count == self._enough and abs(off) > p.other_load and not filled.moved:
            resting_on = inputs._replace(move=NO_MOVE)
            return self._begin(rest, resting_on, state.logic, state.sent, filled)
        return state._replace(rest=rest, moving=False, filled=filled)

    @property
    def _enough(self) -> int:
        """Control periods over which is read at rest."""
        return round(self.parameters.reading_time / self.parameters.period)

    def _read(self, last: Rest, inputs: LqgInputs, count: int, most: int) -> Rest:
        """Return the means at rest with a further reading, the count-th, of the most that count."""
        force = self.drive.force(inputs.pressure_lifting, inputs.pressure_lowering)
        now = Rest(count, force, inputs.deflection, inputs.angle)
        weight = 1.0 / min(count, most)
        return Rest(count, *(a + weight * (b - a) for a, b in zip(last[1:], now[1:], strict=True)))

    def _under_way(self, move: Move) -> bool:
        """Tell whether a move is to be planned or made, or has just ended."""
        p = self.parameters
        return bool(move.distance) and -p.lead <= move.since < move.duration + p.settling

    def _payload(self, force: float, angle: float) -> float:
        """Return the payload, kg, that a force at rest, N, holds at an angle of the joint, rad."""
        return self.parameters.boom.payload(force / self._weight(angle))

    def _begin(
        self, rest: Rest, inputs: LqgInputs, logic: float, sent: Sent, filled: Filled
    ) -> LqgState:
        """Return the state at the start of a move, or of a rest, with what was read at rest."""
        p, drive, move = self.parameters, self.drive, inputs.move
        linkage = p.actuator.static
        ends = inputs.reference, inputs.reference + move.distance
        here, end = self._off_the_ends(rest, ends)
        start, cut = here, (here, end) != ends
        if filled.moved:
            start = piston_stroke(rest.angle, linkage)
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

    def _plan(self, boom: Boom, start: float, move: Move) -> MotionPlan:
        if move.distance == 0.0:
            return resting(boom, self.drive, start)
        return self.planner.plan(boom, start, move)

    def _off_the_ends(self, rest: Rest, ends: tuple[float, float]) -> tuple[float, float]:
        """Return start and end of a move, m, kept off the ends of the stroke.

        Who stands beyond the margin may stay there.
        """
        p = self.parameters.limits
        here = piston_stroke(rest.angle, self.parameters.actuator.static)
        low = min(p.stroke_low + p.end_margin, here)
        high = max(p.stroke_high - p.end_margin, here)
        start, end = (min(max(place, low), high) for place in ends)
        return start, end

    def _allowed(self, wanted: float, angle: float) -> float:
        """Return what of a velocity u, m/s, keeps within the limits at a measured angle, rad."""
        p = self.parameters.limits
        stroke = piston_stroke(angle, self.parameters.actuator.static)
        return off_the_ends(min(max(wanted, -p.speed), p.speed), stroke, 0.0, p)

    def _corrected(
        self, state: LqgState, inputs: LqgInputs, target: Target, known: Filter
    ) -> tuple[Array, float]:
        """Return x corrected by what is measured, and the mean surprise."""
        law = state.regulator
        force = self.drive.force(inputs.pressure_lifting, inputs.pressure_lowering)
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

    def _feedback(self, state: LqgState, estimate: Array, now: Now) -> float:
        """Return u off the plan, m/s."""
        return state.regulator.command(estimate, np.array(state.past))

    def _off(self, state: LqgState, estimate: Array) -> Array:
        return state.regulator.off(estimate, np.array(state.past))

    def _resting(self, law: Regulator, estimate: Array, wanted: float, *, arrived: bool) -> bool:
        """Tell whether the valve stays shut."""
        p = self.parameters
        q = estimate[: law.modes] - law.held[: law.modes] * estimate[law.load]
        if not arrived:
            return abs(wanted) < p.standstill
        quiet = abs(law.deflection @ q) < p.rest_deflection
        return bool(
            (quiet and abs(law.position @ q) < p.rest_position) or abs(wanted) < p.rest_standstill
        )

    def _moved(
        self, state: LqgState, estimate: Array, given: float, opening: float, inputs: LqgInputs
    ) -> LqgState:
        """Return the next period's state under an opening that gives u off the plan, m/s."""
        law, period = state.regulator, self.parameters.period
        given_all = (given, *state.past)
        ahead = law.A @ estimate + law.B @ np.array(given_all)
        if opening == 0.0:  # a shut valve lets no unknown flow through
            ahead[law.flow] *= SHUT_DECAY
        demand = self.drive.command(opening)
        logic = self.drive.next_logic(state.logic, inputs.pressure_lifting, period)
        return state._replace(
            estimate=ahead,
            past=given_all[:-1],
            openings=(opening, *state.openings)[:-1],
            logic=logic,
            sent=taken_up(demand, state.sent, self.parameters.hysteresis),
        )


def _open(oil: Oil) -> Oil:
    """Return the oil with a logic block that is not shut, as the drive's inverse wants it."""
    return oil._replace(logic=max(oil.logic, LEAST_OPEN))

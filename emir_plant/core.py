"""The compiled core: the right-hand side of joint 1's integrated model and its integration.

The state vector holds the hydraulic states at the indices named here, then time and the memory
of effects, then the boom's modal coordinates and then their rates.
"""

import math
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from emir_plant import bristles, dry_friction
from emir_plant.effects import (
    backlash,
    command_delay,
    external_load,
    linkage_error,
    sensor_delay,
    supply_pressure_droop,
    terms,
    valve_hysteresis,
    viscous_friction,
)
from emir_plant.hydraulics import chambers, logic_block, valve
from emir_plant.hydraulics.flows import Pressures, delivered, flows
from emir_plant.jit import compiled, compiled_in_place, compiled_parallel
from emir_plant.unnamed import force as unnamed_force

Array = NDArray[np.float64]

P_H, P_S, SPOOL, SPOOL_RATE, LOGIC = 0, 1, 2, 3, 4
TIME = 5  # s, since the start of the run
DROOP = 6  # Pa, of the supply pressure
EDGES = 7  # 1, where the play of the spool has left the metering edges
OFFSET = 8  # m, of the piston against the joint
LATE_ANGLE, LATE_P_H, LATE_P_S, LATE_DEFLECTION, LATE_STROKE = 9, 10, 11, 12, 13  # of sensors
PLAYED = 14  # 1, the command behind the valve's play
BRISTLES = 15  # N, force of the seals' bristles
DELAY_LINE = 16  # of the command, see command_delay.py
MODES = DELAY_LINE + command_delay.SIZE

STEP = 1e-3  # s, integration step: a tenth of the fastest oscillation kept (63 Hz) and less
SETTLING = 2.0  # of play and oil in a step; Runge-Kutta 4 is unstable above 2.8
CROSSING = 2e-4  # s, step while play and oil settle too fast to be followed: a flank is met in one
FASTEST = 0.3  # m/s, of a piston: more than a valve (EMIR: Q_n / A_H = 55 mm/s) and a swing make
OF_FASTEST = 0.5  # rad, of the fastest mode in a step that ...
FINER = 4  # times shorter steps where dry friction keeps the fastest mode swinging


class Truth(NamedTuple):
    """What the model knows and no sensor blurs; SI units."""

    angle: float  # alpha_1, rad
    tip_angle: float  # alpha_6, rad
    stroke: float  # h, m
    velocity: float  # dh/dt, m/s
    force: float  # F on the piston by the oil, N
    pressure_lifting: float  # p_H, Pa
    pressure_lowering: float  # p_S, Pa
    flow_lifting: float  # Q_H, m^3/s
    flow_lowering: float  # Q_S, m^3/s
    spool: float  # y, 1
    logic_block: float  # y4, 1
    tcp_deflection: float  # off the line of the first section, up positive, m


COLUMNS = len(Truth._fields)


class _Motion(NamedTuple):
    """The boom and the piston at an instant; SI units."""

    angle: float  # alpha_1, rad
    tip_angle: float  # alpha_6, rad
    arm: float  # dh/dalpha, m
    stroke: float  # of the piston, m
    joint_stroke: float  # the same without the piston's play, m
    velocity: float  # of the piston, m/s
    joint_velocity: float  # the same without the piston's play, m/s
    force: float  # of the oil on the piston, N
    offset_rate: float  # of the piston against the joint, m/s


class _Play(NamedTuple):
    """The piston's play over a step: crossed at one rate all over it, if that is held."""

    rate: float  # of the piston against the joint, m/s
    held: bool


class _Allowed(NamedTuple):
    """How long a step may be."""

    left: float  # s, at most
    usual: float  # s, without dry friction
    crossing: bool  # play and oil settle too fast for it


class _Seals(NamedTuple):
    """The seals' bristles at the start of a step."""

    are: bool  # there are any
    force: float  # N
    stroke: float  # of the joint, m


class _Oil(NamedTuple):
    """What the piston's stroke, m, does to the oil of shut chambers."""

    lifting: float  # p_H falls by so much, Pa/m
    lowering: float  # p_S rises by so much, Pa/m
    stiffness: float  # the force falls by so much, N/m


@compiled_in_place
def _motion(x: Array, p: Any) -> _Motion:
    standing = _standing(x, p)
    return _crossing(standing, backlash.rate(x[OFFSET], standing.force, p))


@compiled_in_place
def _standing(x: Array, p: Any) -> _Motion:
    """Return the motion with the play as it stands."""
    n = p.mode_joint.size
    angle, tip_angle, turning = 0.0, 0.0, 0.0
    for i in range(n):
        angle += p.mode_joint[i] * x[MODES + i]
        tip_angle += p.mode_tip_angle[i] * x[MODES + i]
        turning += p.mode_joint[i] * x[MODES + n + i]
    arm = linkage_error.lever_arm(angle, p)
    joint_stroke, joint_velocity = linkage_error.stroke(angle, p), arm * turning
    return _Motion(
        angle,
        tip_angle,
        arm,
        joint_stroke + x[OFFSET],
        joint_stroke,
        joint_velocity,
        joint_velocity,
        chambers.piston_force(x[P_H], x[P_S], p),
        0.0,
    )


@compiled_in_place
def _crossing(standing: _Motion, rate: float) -> _Motion:
    """Return the motion with the play crossed at a rate, m/s."""
    return _Motion(
        standing.angle,
        standing.tip_angle,
        standing.arm,
        standing.stroke,
        standing.joint_stroke,
        standing.joint_velocity + rate,
        standing.joint_velocity,
        standing.force,
        rate,
    )


@compiled_in_place
def _situation(motion: _Motion) -> terms.Situation:
    return terms.Situation(motion.force, motion.stroke)


@compiled_in_place
def _valve_flows(x: Array, stroke: float, p: Any) -> tuple[float, float, float]:
    """Return the flows Q_H and Q_S through the valve and the pump's part of them, m^3/s.

    stroke: of the piston, m.
    """
    position = valve_hysteresis.edges(x[SPOOL], x[EDGES], p)
    edges = terms.edges(valve.opening(position, p), x[TIME], stroke, p)
    pressures = Pressures(p.p0 - x[DROOP], x[P_H], x[P_S])
    lifting, lowering = flows(edges, pressures, x[LOGIC], p)
    return lifting, lowering, delivered(edges, lifting, lowering)


@compiled
def derivative(x: Array, command: float, parameters: NDArray[Any]) -> Array:
    """Return dx/dt of the integrated model (paper Fig. 6) with a command at the valve.

    That is the command y2 behind delay line and play, on which `_advance` alone works.
    """
    dx = np.zeros_like(x)
    write_derivative(x, command, parameters, dx)
    return dx


@compiled_in_place
def write_derivative(x: Array, command: float, parameters: NDArray[Any], dx: Array) -> None:
    """Write dx/dt to dx, (n,), all but the delay line's entries, which stay as they are."""
    write_derivative_of(x, command, parameters[0], dx)


@compiled_in_place
def write_derivative_of(x: Array, command: float, p: Any, dx: Array) -> None:
    """As `write_derivative`, with the parameters of one machine."""
    motion = _motion(x, p)
    if terms.has_bristles(p):
        force, velocity, b = x[BRISTLES], motion.joint_velocity, _bristles(motion, p)
        _write_rates(x, command, motion, bristles.friction(force, velocity, b), p, dx)
        dx[BRISTLES] = b.stiffness * bristles.bending(force, velocity, b)
    else:
        dry = terms.dry_friction(motion.joint_velocity, _situation(motion), p)
        _write_rates(x, command, motion, dry, p, dx)


@compiled_in_place
def _write_rates(  # noqa: PLR0913, PLR0917 (compiled code has no object to bundle them in)
    x: Array, command: float, motion: _Motion, dry: float, p: Any, dx: Array
) -> None:
    """Write dx/dt under a given dry friction, N."""
    flow_lifting, flow_lowering, pumped = _valve_flows(x, motion.stroke, p)
    leak_lifting, leak_lowering = terms.leakage(x[P_H], x[P_S], p)
    lifting = flow_lifting - leak_lifting - chambers.relief_flow(x[P_H], p)
    volume = chambers.volume_lifting(motion.stroke, p)
    stiffness = terms.stiffness_lifting(x[P_H], volume, p)
    surplus = lifting - p.area_lifting * motion.velocity
    dx[P_H] = chambers.pressure_rate(surplus, volume, x[P_H], stiffness)

    lowering = flow_lowering - leak_lowering - chambers.relief_flow(x[P_S], p)
    volume = chambers.volume_lowering(motion.stroke, p)
    stiffness = terms.stiffness_lowering(x[P_S], volume, p)
    surplus = lowering + p.area_lowering * motion.velocity
    dx[P_S] = chambers.pressure_rate(surplus, volume, x[P_S], stiffness)

    dx[SPOOL] = x[SPOOL_RATE]
    dx[SPOOL_RATE] = valve.spool_acceleration(command, x[SPOOL], x[SPOOL_RATE], p)
    pilot = logic_block.pilot_pressure(x[P_H], x[P_S], p)
    dx[LOGIC] = logic_block.opening_rate(x[LOGIC], pilot, p)
    dx[TIME] = 1.0
    dx[DROOP] = supply_pressure_droop.rate(x[DROOP], pumped, p)
    dx[EDGES] = dx[PLAYED] = dx[BRISTLES] = 0.0  # `remember`, `_advance` and `_step` move them
    dx[OFFSET] = motion.offset_rate
    _write_lags(x, motion, p, dx)
    _write_boom(x, motion, dry, p, dx)


@compiled_in_place
def _write_lags(x: Array, motion: _Motion, p: Any, dx: Array) -> None:
    bending = motion.tip_angle - motion.angle
    rate, dead = sensor_delay.rate, p.sensor_delay_dead_share
    dx[LATE_ANGLE] = rate(motion.angle, x[LATE_ANGLE], p.sensor_delay_angle, dead)
    dx[LATE_P_H] = rate(x[P_H], x[LATE_P_H], p.sensor_delay_pressure_lifting, dead)
    dx[LATE_P_S] = rate(x[P_S], x[LATE_P_S], p.sensor_delay_pressure_lowering, dead)
    dx[LATE_STROKE] = rate(motion.stroke, x[LATE_STROKE], p.sensor_delay_stroke, dead)
    dx[LATE_DEFLECTION] = rate(bending, x[LATE_DEFLECTION], p.sensor_delay_deflection, dead)


@compiled_in_place
def _write_boom(x: Array, motion: _Motion, dry: float, p: Any, dx: Array) -> None:
    n = p.mode_joint.size
    friction = dry + viscous_friction.friction(motion.joint_velocity, p)
    unnamed = unnamed_force.along(motion.joint_velocity, motion.stroke, p)
    load = external_load.force(x[TIME], p)
    beside = unnamed + external_load.on_piston(load, p)
    torque = (motion.force + beside - friction) * motion.arm
    torque += external_load.about_joint(load, p)
    gravity = math.cos(motion.angle)
    across = external_load.at_tip(load, motion.angle, p)
    for i in range(n):
        dx[MODES + i] = x[MODES + n + i]
        dx[MODES + n + i] = (
            p.mode_joint[i] * torque
            - p.mode_weight[i] * gravity
            - p.mode_stiffness[i] * x[MODES + i]
            - p.mode_damping[i] * x[MODES + n + i]
            + p.mode_tip[i] * across
        )


@compiled_in_place
def truth(x: Array, parameters: NDArray[Any]) -> Truth:
    """Return what an ideal observer would read off the state."""
    return truth_of(x, parameters[0])


@compiled_in_place
def truth_of(x: Array, p: Any) -> Truth:
    """As `truth`, with the parameters of one machine."""
    motion = _motion(x, p)
    flow_lifting, flow_lowering, _ = _valve_flows(x, motion.stroke, p)
    bending = 0.0
    for i in range(p.mode_deflection.size):
        bending += p.mode_deflection[i] * x[MODES + i]
    load = external_load.at_tip(external_load.force(x[TIME], p), motion.angle, p)
    return Truth(
        motion.angle,
        motion.tip_angle,
        motion.stroke,
        motion.velocity,
        motion.force,
        x[P_H],
        x[P_S],
        flow_lifting,
        flow_lowering,
        x[SPOOL],
        x[LOGIC],
        bending + p.residual_sag * math.cos(motion.angle) + p.residual_compliance * load,
    )


@compiled
def step(x: Array, command: float, dt: float, parameters: NDArray[Any]) -> tuple[Array, Truth]:
    """Return the state after dt, s, under a constant command, and its truth.

    Both from one call: the way from Python and back costs more than a step of 1 ms.
    """
    after = x.copy()
    _advance(after, command, dt, STEP, parameters, np.zeros((5, x.size)))
    return after, truth(after, parameters)


@compiled_in_place
def _advance(  # noqa: PLR0913, PLR0917 (compiled code has no object to bundle them in)
    x: Array, command: float, dt: float, step: float, parameters: NDArray[Any], work: Array
) -> None:
    """Advance x in place. work: (5, n), zeros at first, kept from call to call."""
    p = parameters[0]
    settling = _settling_step(x, dt, p)
    crossing = settling < min(CROSSING, step)
    steps = max(1, math.ceil(dt / min(step, max(settling, CROSSING)) - 1e-9))
    h = dt / steps
    for _ in range(steps):
        arriving = command_delay.arriving(x[DELAY_LINE:MODES], command, x[TIME], h, p)
        x[PLAYED] = valve_hysteresis.played(arriving, x[PLAYED], p)
        left = h
        while left > 0.0:
            left -= _step(x, x[PLAYED], _Allowed(left, h, crossing), p, work)


@compiled_in_place
def _settling_step(x: Array, dt: float, p: Any) -> float:
    """Return the longest step, s, that follows how play and oil settle; infinite without play.

    Where the force of the oil may come to within a dt, s, they settle fastest nearest to 0.
    """
    if p.backlash_gap == 0.0:
        return math.inf
    standing = _standing(x, p)
    stiffness = _oil(x, standing.stroke, p).stiffness
    nearest = max(abs(standing.force) - stiffness * FASTEST * dt, 0.0)
    return SETTLING / backlash.settling_rate(stiffness, nearest, p)


@compiled_in_place
def _oil(x: Array, stroke: float, p: Any) -> _Oil:
    """Return what the piston does to the oil at its stroke, m."""
    volume = chambers.volume_lifting(stroke, p)
    lifting = terms.stiffness_lifting(x[P_H], volume, p) * p.area_lifting / volume
    volume = chambers.volume_lowering(stroke, p)
    lowering = terms.stiffness_lowering(x[P_S], volume, p) * p.area_lowering / volume
    return _Oil(lifting, lowering, lifting * p.area_lifting + lowering * p.area_lowering)


@compiled_in_place
def _step(x: Array, command: float, allowed: _Allowed, p: Any, work: Array) -> float:
    """Advance x in place by one step of Runge-Kutta 4; return the step, s."""
    k1, k2, k3, k4, between = work[0], work[1], work[2], work[3], work[4]
    seals = _seals(x, p)
    dry = _write_first_rates(x, command, allowed, seals, p, k1)
    h = dry.step
    play = _Play(0.0, False)
    if allowed.crossing:
        play = _cross(x, h, p, k1)
    write_sum(x, 0.5 * h, k1, p, between)
    _write_later_rates(between, command, dry, play, seals, p, k2)
    write_sum(x, 0.5 * h, k2, p, between)
    _write_later_rates(between, command, dry, play, seals, p, k3)
    write_sum(x, h, k3, p, between)
    _write_later_rates(between, command, dry, play, seals, p, k4)
    advance_by(x, h, work, p)
    x[P_H] = max(x[P_H], 0.0)
    x[P_S] = max(x[P_S], 0.0)
    remember(x, p)
    if seals.are:
        motion = _standing(x, p)
        x[BRISTLES] = _carried(motion, seals, _bristles(motion, p))
    return h


@compiled_in_place
def _seals(x: Array, p: Any) -> _Seals:
    if not terms.has_bristles(p):
        return _Seals(False, 0.0, 0.0)
    return _Seals(True, x[BRISTLES], _standing(x, p).joint_stroke)


@compiled_in_place
def _bristles(motion: _Motion, p: Any) -> bristles.Bristles:
    return terms.bristles(motion.joint_velocity, motion.force, p)


@compiled_in_place
def _carried(motion: _Motion, seals: _Seals, b: bristles.Bristles) -> float:
    """Return the force of the bristles, N, where the joint has come to inside a step."""
    moved = motion.joint_stroke - seals.stroke
    return bristles.carried(seals.force, moved, b)


@compiled_in_place
def remember(x: Array, p: Any) -> None:
    """Put the metering edges to where the spool has pushed them, at the end of a step.

    Play is no differential equation: inside a step the edges are pushed from where they were.
    """
    x[EDGES] = valve_hysteresis.edges(x[SPOOL], x[EDGES], p)


@compiled_in_place
def write_sum(x: Array, h: float, rates: Array, p: Any, result: Array) -> None:
    """Write x + h rates to result, but for the delay line: `command_delay` alone works on it."""
    for i in range(DELAY_LINE):
        result[i] = x[i] + h * rates[i]
    for i in range(MODES, MODES + 2 * p.mode_joint.size):
        result[i] = x[i] + h * rates[i]


@compiled_in_place
def advance_by(x: Array, h: float, stages: Array, p: Any) -> None:
    """Advance x in place by a step h, s, of Runge-Kutta 4 with the rates of its stages, (4+, n)."""
    k1, k2, k3, k4 = stages[0], stages[1], stages[2], stages[3]
    for i in range(DELAY_LINE):
        x[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])
    for i in range(MODES, MODES + 2 * p.mode_joint.size):
        x[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])


@compiled_in_place
def _cross(x: Array, h: float, p: Any, dx: Array) -> _Play:
    """Return how the play is crossed over a step, h s, and put that into its first rates.

    dx: those, with the offset as it stands.
    """
    oil = _oil(x, _standing(x, p).stroke, p)
    ahead = chambers.piston_force(x[P_H] + h * dx[P_H], x[P_S] + h * dx[P_S], p)
    rate = backlash.rate_over(h, x[OFFSET], ahead, oil.stiffness, p)
    dx[P_H] -= oil.lifting * rate
    dx[P_S] += oil.lowering * rate
    dx[OFFSET] = rate
    return _Play(rate, True)


@compiled_in_place
def _write_first_rates(  # noqa: PLR0913, PLR0917 (as _advance)
    x: Array, command: float, allowed: _Allowed, seals: _Seals, p: Any, dx: Array
) -> dry_friction.Friction:
    """Write dx/dt at the start of a step, but for play that is crossed; return its dry friction."""
    left, usual = allowed.left, allowed.usual
    motion = _standing(x, p) if allowed.crossing else _motion(x, p)
    if seals.are:
        return _write_on_bristles(x, command, motion, allowed, seals, p, dx)
    _write_rates(x, command, motion, 0.0, p, dx)
    if not terms.has_dry_friction(p):
        return dry_friction.Friction(left, 0.0, False)
    friction = terms.dry_friction(motion.joint_velocity, _situation(motion), p)
    piston = dry_friction.Piston(
        motion.joint_velocity,
        _acceleration(motion, dx, p),
        _mobility(motion, p),
        _situation(motion),
        friction,
        _swing(x, dx, motion.arm, friction, p),
    )
    dry = dry_friction.over_step(piston, left, usual, _fine(usual, p), p)
    for i in range(p.mode_joint.size):
        dx[MODES + p.mode_joint.size + i] -= p.mode_joint[i] * motion.arm * dry.force
    return dry


@compiled_in_place
def _write_on_bristles(  # noqa: PLR0913, PLR0917 (as _advance)
    x: Array, command: float, motion: _Motion, allowed: _Allowed, seals: _Seals, p: Any, dx: Array
) -> dry_friction.Friction:
    """Write dx/dt at the start of a step that follows the piston on the bristles of its seals."""
    velocity, b = motion.joint_velocity, _bristles(motion, p)
    friction = bristles.friction(seals.force, velocity, b)
    _write_rates(x, command, motion, friction, p, dx)
    holding = abs(bristles.bending(seals.force, math.copysign(1.0, velocity), b))
    if velocity * (velocity + allowed.usual * _acceleration(motion, dx, p)) <= 0.0:
        holding = 2.0  # it turns round
    step = bristles.longest_step(holding, _mobility(motion, p), b)
    return dry_friction.Friction(min(allowed.left, _fine(allowed.usual, p), step), friction, False)


@compiled_in_place
def _acceleration(motion: _Motion, dx: Array, p: Any) -> float:
    """Return the piston's acceleration, m/s^2, at the rates dx."""
    turning = 0.0
    for i in range(p.mode_joint.size):
        turning += p.mode_joint[i] * dx[MODES + p.mode_joint.size + i]
    return motion.arm * turning


@compiled_in_place
def _mobility(motion: _Motion, p: Any) -> float:
    """Return by how much a force on the piston accelerates it, 1/kg."""
    admittance = 0.0
    for i in range(p.mode_joint.size):
        admittance += p.mode_joint[i] * p.mode_joint[i]
    return motion.arm * motion.arm * admittance


@compiled_in_place
def _fine(usual: float, p: Any) -> float:
    """Return the step, s, that follows stick and slip; the usual one where that is a coarse one."""
    if usual > STEP:
        return usual
    fastest = math.sqrt(p.mode_stiffness[p.mode_joint.size - 1])
    return min(usual, OF_FASTEST / fastest) / FINER


@compiled_in_place
def _swing(x: Array, dx: Array, arm: float, friction: float, p: Any) -> float:
    """Return the piston's amplitude in the fastest mode, m/s.

    dx: rates without the dry friction, N.
    """
    last = p.mode_joint.size - 1
    moved: float = p.mode_joint[last] * arm
    rate = MODES + p.mode_joint.size + last
    acceleration = dx[rate] - moved * friction
    amplitude: float = math.sqrt(x[rate] ** 2 + acceleration**2 / p.mode_stiffness[last])
    return abs(moved) * amplitude


@compiled_in_place
def _write_later_rates(  # noqa: PLR0913, PLR0917 (as _advance)
    x: Array,
    command: float,
    dry: dry_friction.Friction,
    play: _Play,
    seals: _Seals,
    p: Any,
    dx: Array,
) -> None:
    """Write dx/dt at a later stage of a step under its dry friction and with its play."""
    motion = _crossing(_standing(x, p), play.rate) if play.held else _motion(x, p)
    force = dry.force
    if seals.are:
        b = _bristles(motion, p)
        force = bristles.friction(_carried(motion, seals, b), motion.joint_velocity, b)
    elif not dry.held:
        force = terms.dry_friction(motion.joint_velocity, _situation(motion), p)
    _write_rates(x, command, motion, force, p, dx)


@compiled
def simulate(  # noqa: PLR0913, PLR0917 (as _advance)
    x: Array,
    commands: Array,
    dt: float,
    every: int,
    parameters: NDArray[Any],
    step: float = STEP,
) -> Array:
    """Run a whole command sequence.

    commands: (k,), each held for dt, s; step: the longest integration step, s. Returns
    (1 + k // every, len(Truth)): the truth at the start and after every `every` commands.
    """
    result = np.empty((1 + commands.size // every, COLUMNS))
    x, work = x.copy(), np.zeros((5, x.size))
    _simulate(x, commands, dt, every, parameters, step, work, result)
    return result


@compiled_in_place
def _simulate(  # noqa: PLR0913, PLR0917 (as _advance)
    x: Array,
    commands: Array,
    dt: float,
    every: int,
    parameters: NDArray[Any],
    step: float,
    work: Array,
    result: Array,
) -> None:
    """Advance x in place over the whole sequence, and write the truths to result.

    Written, not returned: assigning one array to part of another takes seconds to compile.
    """
    for k in range(commands.size + 1):
        if k % every == 0:
            for i, value in enumerate(truth(x, parameters)):
                result[k // every, i] = value
        if k < commands.size:
            _advance(x, commands[k], dt, step, parameters, work)


@compiled_parallel
def simulate_each(  # noqa: PLR0913, PLR0917 (as _advance)
    starts: Array,
    commands: Array,
    dt: float,
    every: int,
    parameters: NDArray[Any],
    step: float = STEP,
) -> Array:
    """Run m machines under the same commands, one by one on each core.

    starts: (m, n) states; parameters: (m,) records; step: as for `simulate`. Returns
    (m, 1 + k // every, len(Truth)).
    """
    machines = parameters.size
    states, work = starts.copy(), np.zeros((machines, 5, starts.shape[1]))
    result = np.empty((machines, 1 + commands.size // every, COLUMNS))
    for m in numba.prange(machines):
        own = parameters[m : m + 1]
        _simulate(states[m], commands, dt, every, own, step, work[m], result[m])
    return result

"""The integration of joint 1's model: one step, and whole runs of one machine and of many.

Runge-Kutta 4, whose steps dry friction, the seals' bristles and the piston's play may shorten.
Delay line and play of the valve are no differential equations and are carried from step to step.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from emir_plant import bristles, dry_friction
from emir_plant.core import (
    BRISTLES,
    COLUMNS,
    DELAY_LINE,
    EDGES,
    MODES,
    OFFSET,
    P_H,
    P_S,
    PLAYED,
    SPOOL,
    TIME,
    Array,
    Motion,
    Truth,
    bristles_of,
    crossing_motion,
    motion_of,
    situation_of,
    standing_motion,
    truth,
    write_rates,
)
from emir_plant.effects import backlash, command_delay, terms, valve_hysteresis
from emir_plant.hydraulics import chambers
from emir_plant.jit import compiled, compiled_in_place, on_all_cores

STEP = 1e-3  # s, integration step: a tenth of the fastest oscillation kept (63 Hz) and less
SETTLING = 2.0  # of play and oil in a step; Runge-Kutta 4 is unstable above 2.8
CROSSING = 2e-4  # s, step while play and oil settle too fast to be followed: a flank is met in one
FASTEST = 0.3  # m/s, of a piston: more than a valve (EMIR: Q_n / A_H = 55 mm/s) and a swing make
OF_FASTEST = 0.5  # rad, of the fastest mode in a step that ...
FINER = 4  # times shorter steps where dry friction keeps the fastest mode swinging


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


@compiled
def step(x: Array, command: float, dt: float, parameters: NDArray[Any]) -> tuple[Array, Truth]:
    """Return the state after dt, s, under a constant command, and its truth.

    Both from one call: the way from Python and back costs more than a step of 1 ms.
    """
    after = x.copy()
    _advance(after, command, dt, STEP, parameters, np.zeros((5, x.size)))
    return after, truth(after, parameters)


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

    def run(m: int) -> None:
        own = parameters[m : m + 1]
        _simulate(states[m], commands, dt, every, own, step, work[m], result[m])

    on_all_cores(run, machines)
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
    standing = standing_motion(x, p)
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
        motion = standing_motion(x, p)
        x[BRISTLES] = _carried(motion, seals, bristles_of(motion, p))
    return h


@compiled_in_place
def _seals(x: Array, p: Any) -> _Seals:
    if not terms.has_bristles(p):
        return _Seals(False, 0.0, 0.0)
    return _Seals(True, x[BRISTLES], standing_motion(x, p).joint_stroke)


@compiled_in_place
def _carried(motion: Motion, seals: _Seals, b: bristles.Bristles) -> float:
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
    oil = _oil(x, standing_motion(x, p).stroke, p)
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
    motion = standing_motion(x, p) if allowed.crossing else motion_of(x, p)
    if seals.are:
        return _write_on_bristles(x, command, motion, allowed, seals, p, dx)
    write_rates(x, command, motion, 0.0, p, dx)
    if not terms.has_dry_friction(p):
        return dry_friction.Friction(left, 0.0, False)
    friction = terms.dry_friction(motion.joint_velocity, situation_of(motion), p)
    piston = dry_friction.Piston(
        motion.joint_velocity,
        _acceleration(motion, dx, p),
        _mobility(motion, p),
        situation_of(motion),
        friction,
        _swing(x, dx, motion.arm, friction, p),
    )
    dry = dry_friction.over_step(piston, left, usual, _fine(usual, p), p)
    for i in range(p.mode_joint.size):
        dx[MODES + p.mode_joint.size + i] -= p.mode_joint[i] * motion.arm * dry.force
    return dry


@compiled_in_place
def _write_on_bristles(  # noqa: PLR0913, PLR0917 (as _advance)
    x: Array, command: float, motion: Motion, allowed: _Allowed, seals: _Seals, p: Any, dx: Array
) -> dry_friction.Friction:
    """Write dx/dt at the start of a step that follows the piston on the bristles of its seals."""
    velocity, b = motion.joint_velocity, bristles_of(motion, p)
    friction = bristles.friction(seals.force, velocity, b)
    write_rates(x, command, motion, friction, p, dx)
    holding = abs(bristles.bending(seals.force, math.copysign(1.0, velocity), b))
    if velocity * (velocity + allowed.usual * _acceleration(motion, dx, p)) <= 0.0:
        holding = 2.0  # it turns round
    step = bristles.longest_step(holding, _mobility(motion, p), b)
    return dry_friction.Friction(min(allowed.left, _fine(allowed.usual, p), step), friction, False)


@compiled_in_place
def _acceleration(motion: Motion, dx: Array, p: Any) -> float:
    """Return the piston's acceleration, m/s^2, at the rates dx."""
    turning = 0.0
    for i in range(p.mode_joint.size):
        turning += p.mode_joint[i] * dx[MODES + p.mode_joint.size + i]
    return motion.arm * turning


@compiled_in_place
def _mobility(motion: Motion, p: Any) -> float:
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
    motion = crossing_motion(standing_motion(x, p), play.rate) if play.held else motion_of(x, p)
    force = dry.force
    if seals.are:
        b = bristles_of(motion, p)
        force = bristles.friction(_carried(motion, seals, b), motion.joint_velocity, b)
    elif not dry.held:
        force = terms.dry_friction(motion.joint_velocity, situation_of(motion), p)
    write_rates(x, command, motion, force, p, dx)

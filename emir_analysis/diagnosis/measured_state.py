"""The model's rates along a recording: its state is the measured one wherever a sensor shows it.

They are integrated together with the states that no sensor shows, in steps that follow the spool:
between two samples the valve's flow changes too fast for the trapezoidal rule. Where the pressures
are given, nothing acts back on spool, logic block and bending modes: they are moved exactly,
however stiff or quick, so that only what is slow asks for short steps.

The boom's rate, which friction depends on, has to be smoothed; what the piston sweeps is taken
from the angle as it was read, since smoothing would take some of the slow mode away.

Pressures, boom angle and its rate are taken from the recording. What no sensor shows is
simulated from what the sensors do show: the spool from the command, the logic block from
p_H, the bending modes from the measured force. So an error in one balance cannot leak into
another, and every effect that the machine's right-hand side holds is in the right balance.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from emir_analysis.diagnosis.oscillator import swung, write_swing
from emir_analysis.signals import Array
from emir_plant import core, integration
from emir_plant.effects import (
    command_delay,
    linkage_error,
    logic_block_fault,
    terms,
    valve_hysteresis,
)
from emir_plant.hydraulics import chambers, logic_block
from emir_plant.jit import compiled_in_place, on_all_cores

RESOLVED = 1.25  # rad, of the spool's swing in a step: its edges open and shut in between
SETTLED = 2.0  # time constants in a step; Kutta's rule is stable up to 2.5
QUICKEST = 5e-4  # s: what settles quicker has long settled, whatever comes out for it
HALF, WHOLE = 0, -1  # of a step: where the spool's swings stand among all
START, MIDDLE, END, AHEAD = 0, 1, 2, 3  # of a step: rates at three instants, and a state ahead


class Modelled(NamedTuple):
    """What the model says along the recording, each (m, n) for m machines and n samples."""

    pressure_lifting: Array  # integral of dp_H/dt since the start, Pa
    pressure_lowering: Array  # integral of dp_S/dt since the start, Pa
    turning: Array  # change of the rate of the boom's rigid rotation since the start, rad/s
    bending: Array  # boom angle minus rigid rotation, rad
    deflection: Array  # alpha_6 - alpha_1, rad


@compiled_in_place
def longest_step(parameters: NDArray[Any]) -> float:
    """Return the longest step, s, that follows what is not exact in all machines, (m,) records."""
    longest = math.inf
    for m in range(parameters.size):
        p = parameters[m]
        settling = max(min(_droop_settling(p), _play_settling(p)), QUICKEST)
        longest = min(longest, RESOLVED / p.natural_frequency, SETTLED * settling)
    return longest


@compiled_in_place
def _droop_settling(p: Any) -> float:
    """Return the time constant, s, of a droop that throttles the flow which makes it."""
    droop = p.supply_pressure_droop_resistance * p.flow_nominal
    if droop == 0.0:
        return math.inf
    time: float = p.supply_pressure_droop_time_constant / (1.0 + droop / p.balance_pressure)
    return time


@compiled_in_place
def _play_settling(p: Any) -> float:
    return p.backlash_crossing_time if p.backlash_gap > 0.0 else math.inf


@compiled_in_place
def _write_swings(dt: float, p: Any, swings: Array) -> None:
    """Write the swings of steps of dt, s: (n + 1, 2, 2), see HALF and WHOLE.

    Between them those of the bending modes; the rigid one has none.
    """
    stiffness = p.natural_frequency * p.natural_frequency
    damping = 2.0 * p.damping * p.natural_frequency
    write_swing(stiffness, damping, 0.5 * dt, swings[HALF])
    write_swing(stiffness, damping, dt, swings[WHOLE])
    for i in range(1, p.mode_joint.size):
        write_swing(p.mode_stiffness[i], p.mode_damping[i], dt, swings[i])


@compiled_in_place
def _write_rates(x: Array, command: float, measured: Array, p: Any, dx: Array) -> None:
    """Put the measured values into the state x and write its rates to dx.

    measured: (5,) p_H, p_S, Pa, boom angle, rad, its rate, rad/s, and one that is not used here.
    """
    n = p.mode_joint.size
    x[core.P_H], x[core.P_S] = measured[0], measured[1]
    bent, bending = 0.0, 0.0
    for i in range(1, n):
        bent += p.mode_joint[i] * x[core.MODES + i]
        bending += p.mode_joint[i] * x[core.MODES + n + i]
    x[core.MODES] = (measured[2] - bent) / p.mode_joint[0]
    x[core.MODES + n] = (measured[3] - bending) / p.mode_joint[0]
    core.write_derivative_of(x, command, p, dx)


@compiled_in_place
def _step(  # noqa: PLR0913, PLR0917 (compiled code has no object to bundle them in)
    x: Array, command: float, dt: float, measured: Array, p: Any, swings: Array, work: Array
) -> None:
    """Advance x by dt, s. measured: (3, 5) at start, middle and end of the step.

    Spool, logic block and bending modes exactly, whatever the step; all else, which is slow, by
    Kutta's rule of third order. Its first rates are the last of the step before, from a state that
    is as good but for what acts on itself. work: as `_follow` has it.
    """
    start, middle, end, ahead = work[START], work[MIDDLE], work[END], work[AHEAD]
    for i in range(x.size):
        start[i], ahead[i] = end[i], x[i]
    if _droop_settling(p) < math.inf or _play_settling(p) < math.inf:  # which act on themselves
        _write_rates(x, command, measured[0], p, start)
    for i in range(core.DELAY_LINE):
        ahead[i] = x[i] + 0.5 * dt * start[i]
    _swing_spool(x, command, swings[HALF], ahead)
    ahead[core.LOGIC] = _opened(x[core.LOGIC], measured[0], measured[1], 0.5 * dt, p)
    _write_rates(ahead, command, measured[1], p, middle)
    half_opened = ahead[core.LOGIC]
    for i in range(core.DELAY_LINE):
        ahead[i] = x[i] + dt * (2.0 * middle[i] - start[i])
    _swing_spool(x, command, swings[WHOLE], ahead)
    ahead[core.LOGIC] = _opened(half_opened, measured[1], measured[2], 0.5 * dt, p)
    _write_rates(ahead, command, measured[2], p, end)
    for i in range(core.DELAY_LINE):
        x[i] += dt * _mean_rate(work, i)
    x[core.SPOOL], x[core.SPOOL_RATE] = ahead[core.SPOOL], ahead[core.SPOOL_RATE]
    x[core.LOGIC] = ahead[core.LOGIC]
    _bend(x, dt, start, end, p, swings)
    integration.remember(x, p)


@compiled_in_place
def _swing_spool(x: Array, command: float, swing: Array, after: Array) -> None:
    off, rate = swung(x[core.SPOOL] - command, x[core.SPOOL_RATE], swing)
    after[core.SPOOL], after[core.SPOOL_RATE] = command + off, rate


@compiled_in_place
def _opened(opening: float, before: Array, after: Array, time: float, p: Any) -> float:
    """Return y4 after a time, s, in which the measured pressures go evenly from before to after."""
    first, last = _beyond_threshold(before, p), _beyond_threshold(after, p)
    if (first > 0.0) == (last > 0.0):
        return _opened_by(opening, last > 0.0, time, p)
    crossed = time * first / (first - last)
    there = _opened_by(opening, first > 0.0, crossed, p)
    return _opened_by(there, last > 0.0, time - crossed, p)


@compiled_in_place
def _beyond_threshold(measured: Array, p: Any) -> float:
    pilot = logic_block.pilot_pressure(measured[0], measured[1], p)
    return pilot - logic_block_fault.threshold(p)


@compiled_in_place
def _opened_by(opening: float, piloted: bool, time: float, p: Any) -> float:  # noqa: FBT001
    if piloted:
        return 1.0 - (1.0 - opening) * math.exp(-time / p.time_constant_opening)
    return opening * math.exp(-time / logic_block_fault.time_constant_closing(p))


@compiled_in_place
def _bend(  # noqa: PLR0913, PLR0917 (as _step)
    x: Array, dt: float, start: Array, end: Array, p: Any, swings: Array
) -> None:
    """Advance the bending modes of x by dt, s, under a force that grows evenly.

    start, end: rates there, both with the modes as they are at the start; at the end they are put
    right.
    """
    n = p.mode_joint.size
    for i in range(1, n):
        place, speed = core.MODES + i, core.MODES + n + i
        k, c = p.mode_stiffness[i], p.mode_damping[i]
        held = k * x[place] + c * x[speed]
        first, last = start[speed] + held, end[speed] + held
        drift = (last - first) / (k * dt)  # velocity once it no longer swings
        middle = (first - c * drift) / k
        off, rate = swung(x[place] - middle, x[speed] - drift, swings[i])
        x[place], x[speed] = middle + drift * dt + off, drift + rate
        end[place], end[speed] = x[speed], last - k * x[place] - c * x[speed]


@compiled_in_place
def _swept(turned: float, measured: Array, p: Any) -> tuple[float, float]:
    """Return the changes of p_H and p_S, Pa, that a small turn of the boom, rad, makes."""
    stroke = linkage_error.stroke(measured[2], p)
    moved = linkage_error.lever_arm(measured[2], p) * turned
    volume = chambers.volume_lifting(stroke, p)
    stiffness = terms.stiffness_lifting(measured[0], volume, p)
    lifting = chambers.pressure_rate(-p.area_lifting * moved, volume, measured[0], stiffness)
    volume = chambers.volume_lowering(stroke, p)
    stiffness = terms.stiffness_lowering(measured[1], volume, p)
    lowering = chambers.pressure_rate(p.area_lowering * moved, volume, measured[1], stiffness)
    return lifting, lowering


@compiled_in_place
def _mean_rate(work: Array, i: int) -> float:
    """Return the mean rate of a state over the last step."""
    total: float = work[START, i] + 4.0 * work[MIDDLE, i] + work[END, i]
    return total / 6.0


@compiled_in_place
def _follow(  # noqa: PLR0913, PLR0917 (as _step)
    x: Array,
    arriving: Array,
    dt: float,
    measured: Array,
    parameters: NDArray[Any],
    swings: Array,
    work: Array,
    at: Array,
    result: Array,
) -> None:
    """Write the columns of Modelled along measured, (n, 5), to result, (5, n); steps of dt, s.

    x: (s,) the state at the start, advanced in place. arriving: (k,) the command at the valve.
    swings: (n + 1, 2, 2), work: (4, s) and at: (3, 5), zeros.
    """
    p = parameters[0]
    _write_swings(dt, p, swings)
    samples, n = measured.shape[0], p.mode_joint.size
    every = arriving.size // (samples - 1)
    lifting, lowering, turning = 0.0, 0.0, 0.0
    _write_rates(x, arriving[0], measured[0], p, work[END])
    for k in range(samples):
        result[0, k], result[1, k], result[2, k] = lifting, lowering, turning
        for i in range(1, n):
            bent = x[core.MODES + i]
            result[3, k] += p.mode_joint[i] * bent
            result[4, k] += (p.mode_tip_angle[i] - p.mode_joint[i]) * bent
        if k == samples - 1:
            break
        for j in range(every):
            for i in range(measured.shape[1]):
                slope = (measured[k + 1, i] - measured[k, i]) / every
                for row in range(3):
                    at[row, i] = measured[k, i] + slope * (j + 0.5 * row)
            command = arriving[k * every + j]
            x[core.PLAYED] = valve_hysteresis.played(command, x[core.PLAYED], p)
            _step(x, x[core.PLAYED], dt, at, p, swings, work)
            left_out = (measured[k + 1, 4] - measured[k, 4]) / every - dt * at[1, 3]
            swept_lifting, swept_lowering = _swept(left_out, at[1], p)
            lifting += swept_lifting
            lowering += swept_lowering
            lifting += dt * _mean_rate(work, core.P_H)
            lowering += dt * _mean_rate(work, core.P_S)
            turning += dt * p.mode_joint[0] * _mean_rate(work, core.MODES + n)


def follow(
    starts: Array, commands: Array, dt: float, measured: Array, parameters: NDArray[Any]
) -> Array:
    """Return (m, 5, n), the columns of Modelled, of m machines along one recording.

    starts: (m, s) states. commands: (k,) y2, each held for dt, s; k a multiple of n - 1.
    measured: (m, n, 5) p_H, p_S, Pa, smoothed boom angle, rad, its rate, rad/s, and the angle as
    it was read, rad, as each machine's sensors mean them. parameters: (m,) records.
    """
    result = np.zeros((parameters.size, 5, measured.shape[1]))

    def run(m: int) -> None:
        own, x = parameters[m : m + 1], starts[m].copy()
        arriving = command_delay.delayed(commands, dt, own)
        work, at = np.zeros((4, x.size)), np.zeros((3, measured.shape[2]))
        swings = np.zeros((own["mode_joint"].size + 1, 2, 2))
        _follow(x, arriving, dt, measured[m], own, swings, work, at, result[m])

    on_all_cores(run, parameters.size)
    return result

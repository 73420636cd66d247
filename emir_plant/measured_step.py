"""One step of the model along measured pressures, boom angle and its rate.

Where the pressures are given, nothing acts back on spool, logic block and bending modes: they are
moved exactly, however stiff or quick, so that only what is slow asks for short steps.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emir_plant import core, integration
from emir_plant.effects import logic_block_fault
from emir_plant.hydraulics import logic_block
from emir_plant.jit import compiled_in_place
from emir_plant.oscillator import swung, write_swing

Array = NDArray[np.float64]

RESOLVED = 1.25  # rad, of the spool's swing in a step: its edges open and shut in between
SETTLED = 2.0  # time constants in a step; Kutta's rule is stable up to 2.5
QUICKEST = 5e-4  # s: a shorter one, which a fit may try, is not followed: it would take forever
HALF, WHOLE = 0, -1  # of a step: where the spool's swings stand among all
START, MIDDLE, END, AHEAD = 0, 1, 2, 3  # of a step: rates at three instants, and a state ahead


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
    """Return the time constant, s, of a droop that throttles the flow which makes it.

    Where the pump's pressure is short the pressure balance is open, and flow gives way over about
    the drop that it holds.
    """
    droop = p.supply_pressure_droop_resistance * p.flow_nominal
    if droop == 0.0:
        return math.inf
    time: float = p.supply_pressure_droop_time_constant / (1.0 + droop / p.balance_pressure)
    return time


@compiled_in_place
def _play_settling(p: Any) -> float:
    return p.backlash_crossing_time if p.backlash_gap > 0.0 else math.inf


@compiled_in_place
def write_swings(dt: float, p: Any, swings: Array) -> None:
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
def write_rates(x: Array, command: float, measured: Array, p: Any, dx: Array) -> None:
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
def advance(  # noqa: PLR0913, PLR0917 (compiled code has no object to bundle them in)
    x: Array, command: float, dt: float, measured: Array, p: Any, swings: Array, work: Array
) -> None:
    """Advance x by dt, s. measured: (3, 5) at start, middle and end of the step.

    Spool, logic block and bending modes exactly, whatever the step; all else, which is slow, by
    Kutta's rule of third order. Its first rates are the last of the step before, from a state that
    is as good but for what acts on itself. work: (4, s), see START.
    """
    start, middle, end, ahead = work[START], work[MIDDLE], work[END], work[AHEAD]
    for i in range(x.size):
        start[i], ahead[i] = end[i], x[i]
    if _droop_settling(p) < math.inf or _play_settling(p) < math.inf:  # which act on themselves
        write_rates(x, command, measured[0], p, start)
    for i in range(core.DELAY_LINE):
        ahead[i] = x[i] + 0.5 * dt * start[i]
    _swing_spool(x, command, swings[HALF], ahead)
    ahead[core.LOGIC] = _opened(x[core.LOGIC], measured[0], measured[1], 0.5 * dt, p)
    write_rates(ahead, command, measured[1], p, middle)
    half_opened = ahead[core.LOGIC]
    for i in range(core.DELAY_LINE):
        ahead[i] = x[i] + dt * (2.0 * middle[i] - start[i])
    _swing_spool(x, command, swings[WHOLE], ahead)
    ahead[core.LOGIC] = _opened(half_opened, measured[1], measured[2], 0.5 * dt, p)
    write_rates(ahead, command, measured[2], p, end)
    for i in range(core.DELAY_LINE):
        x[i] += dt * mean_rate(work, i)
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
    threshold = logic_block_fault.threshold(opening, p)
    first, last = _pilot(before, p) - threshold, _pilot(after, p) - threshold
    if (first > 0.0) == (last > 0.0):
        return _opened_by(opening, last > 0.0, time, p)
    crossed = time * first / (first - last)
    there = _opened_by(opening, first > 0.0, crossed, p)
    return _opened_by(there, last > 0.0, time - crossed, p)


@compiled_in_place
def _pilot(measured: Array, p: Any) -> float:
    return logic_block.pilot_pressure(measured[0], measured[1], p)


@compiled_in_place
def _opened_by(opening: float, piloted: bool, time: float, p: Any) -> float:  # noqa: FBT001
    if piloted:
        settled = logic_block_fault.fully_open(p)
        left = math.exp(-time / logic_block_fault.time_constant_opening(p))
        return settled - (settled - opening) * left
    return opening * math.exp(-time / logic_block_fault.time_constant_closing(p))


@compiled_in_place
def _bend(  # noqa: PLR0913, PLR0917 (as advance)
    x: Array, dt: float, start: Array, end: Array, p: Any, swings: Array
) -> None:
    """Advance the bending modes of x by dt, s, under a force that grows evenly.

    start, end: rates there, both with the modes as they are at the start; the accelerations at the
    end are put right.
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
        end[speed] = last - k * x[place] - c * x[speed]


@compiled_in_place
def mean_rate(work: Array, i: int) -> float:
    """Return the mean rate of a state over the last step."""
    total: float = work[START, i] + 4.0 * work[MIDDLE, i] + work[END, i]
    return total / 6.0

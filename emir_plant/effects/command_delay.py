"""A command that reaches the valve late.

The delay line keeps the time integral of the command at the instants at which the command last
changed. What arrives during an integration step is the mean of the delayed command over it, a
difference of two such integrals: exact for any delay, not only for multiples of the step, and
so a smooth function of the delay. Commands that change more often than the line has room for
are kept as their mean between two samples. What lags goes through a first-order filter behind
that, exact for a command that is the same all along a step.
"""

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from emir_common.quantity import quantity
from emir_plant.effects.base import Balance, Effect
from emir_plant.jit import compiled, compiled_in_place

Array = NDArray[np.float64]

# The line: command, its integral, the filter's state, then the samples' times ...
LATEST, INTEGRAL, LAGGING, TIMES = range(4)
SAMPLES = 16
INTEGRALS = TIMES + SAMPLES  # ... and integrals, newest first
SIZE = INTEGRALS + SAMPLES
LONG_AGO = -1.0  # s: before the start, by more than any delay, the command was 0


@dataclass(frozen=True)
class CommandDelay(Effect):
    """A command that comes late by T between y2 and the current: y2(t - T).

    lag_share of T is a first-order lag (filter, amplifier), the rest dead time.
    """

    balance: ClassVar[Balance] = "valve"
    sizes: ClassVar[tuple[str, ...]] = ("delay",)
    source: ClassVar[str] = "computing, bus and amplifier: one control period of 32 ms and less"
    trial: ClassVar[dict[str, float]] = {"delay": 0.02, "lag_share": 0.5}

    delay: float = quantity("s", 0.0, 0.2, "T", default=0.0)
    lag_share: float = quantity("1", 0.0, 1.0, "share of T that is a lag", default=0.0)


@compiled
def empty_line() -> Array:
    """Return a delay line, (SIZE,), of a command that was 0 until now, t = 0."""
    line = np.zeros(SIZE)
    line[TIMES:INTEGRALS] = LONG_AGO
    return line


@compiled_in_place
def arriving(line: Array, command: float, now: float, step: float, p: Any) -> float:
    """Return the mean command at the valve from now, s, over a step, s; update the line."""
    if p.command_delay_delay == 0.0:
        return command
    lag = p.command_delay_lag_share * p.command_delay_delay
    delay = p.command_delay_delay - lag
    if command != line[LATEST]:
        if now - line[TIMES] >= delay / (SAMPLES - 2):
            for k in range(SAMPLES - 1, 0, -1):
                line[TIMES + k] = line[TIMES + k - 1]
                line[INTEGRALS + k] = line[INTEGRALS + k - 1]
            line[TIMES], line[INTEGRALS] = now, line[INTEGRAL]
        line[LATEST] = command
    line[INTEGRAL] += command * step
    end = now + step
    dead = (_integral(line, end - delay, end) - _integral(line, now - delay, end)) / step
    return _lagged(line, dead, lag, step)


@compiled_in_place
def _lagged(line: Array, command: float, lag: float, step: float) -> float:
    """Return the mean over a step, s, of a command, all along it the same, behind a lag, s."""
    if lag == 0.0:
        return command
    kept = math.exp(-step / lag)
    behind = line[LAGGING] - command
    line[LAGGING] = command + kept * behind
    return command + behind * (1.0 - kept) * lag / step


@compiled_in_place
def _integral(line: Array, time: float, end: float) -> float:
    """Return the command's integral up to a time, s, the line being known up to its end, s."""
    later_time, later = end, line[INTEGRAL]
    for k in range(SAMPLES):
        sample_time, sample = line[TIMES + k], line[INTEGRALS + k]
        if time >= sample_time:
            share = (time - sample_time) / (later_time - sample_time)
            return sample + share * (later - sample)
        later_time, later = sample_time, sample
    return later


@compiled
def delayed(commands: Array, dt: float, parameters: NDArray[Any]) -> Array:
    """Return a whole command sequence, each held for dt, s, as it arrives at the valve, (k,).

    dt is at most the integration step; the sequence starts the run.
    """
    p = parameters[0]
    line = empty_line()
    result = np.empty_like(commands)
    for k in range(commands.size):
        result[k] = arriving(line, commands[k], k * dt, dt, p)
    return result

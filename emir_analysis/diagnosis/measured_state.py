"""The model's rates along a recording: its state is the measured one wherever a sensor shows it.

Pressures, boom angle and its rate are taken from the recording. What no sensor shows is
simulated from what the sensors do show: the spool from the command, the logic block from
p_H, the bending modes from the measured force. So an error in one balance cannot leak into
another, and every effect that the machine's right-hand side holds is in the right balance.
"""

from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from emir_analysis.signals import Array
from emir_plant import core
from emir_plant.effects import command_delay
from emir_plant.jit import compiled, compiled_parallel


class Rates(NamedTuple):
    """What the model says along the recording, each (m, n) for m machines and n samples."""

    pressure_lifting: Array  # dp_H/dt, Pa/s
    pressure_lowering: Array  # dp_S/dt, Pa/s
    turning: Array  # d^2/dt^2 of the boom's rigid rotation, rad/s^2
    bending: Array  # boom angle minus rigid rotation, rad
    deflection: Array  # alpha_6 - alpha_1, rad


@compiled
def _write_rates(
    x: Array, command: float, measured: Array, parameters: NDArray[Any], dx: Array
) -> None:
    """Put the measured values into the state x and write its rates to dx.

    measured: (4,) p_H, p_S, Pa, boom angle, rad, and its rate, rad/s.
    """
    p = parameters[0]
    n = p.mode_joint.size
    x[core.P_H], x[core.P_S] = measured[0], measured[1]
    bent, bending = 0.0, 0.0
    for i in range(1, n):
        bent += p.mode_joint[i] * x[core.MODES + i]
        bending += p.mode_joint[i] * x[core.MODES + n + i]
    x[core.MODES] = (measured[2] - bent) / p.mode_joint[0]
    x[core.MODES + n] = (measured[3] - bending) / p.mode_joint[0]
    core.write_derivative(x, command, parameters, dx)


@compiled
def _step(  # noqa: PLR0913, PLR0917 (compiled code has no object to bundle them in)
    x: Array, command: float, dt: float, measured: Array, parameters: NDArray[Any], work: Array
) -> None:
    """Advance x by dt, s, with RK4. measured: (3, 4) at start, middle and end of the step."""
    k1, k2, k3, k4, between = work[0], work[1], work[2], work[3], work[4]
    _write_rates(x, command, measured[0], parameters, k1)
    for i in range(x.size):
        between[i] = x[i] + 0.5 * dt * k1[i]
    _write_rates(between, command, measured[1], parameters, k2)
    for i in range(x.size):
        between[i] = x[i] + 0.5 * dt * k2[i]
    _write_rates(between, command, measured[1], parameters, k3)
    for i in range(x.size):
        between[i] = x[i] + dt * k3[i]
    _write_rates(between, command, measured[2], parameters, k4)
    for i in range(x.size):
        x[i] += dt / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])


@compiled
def _follow(
    start: Array, commands: Array, dt: float, measured: Array, parameters: NDArray[Any]
) -> Array:
    """Return (5, n), the columns of Rates along measured (n, 4); steps of dt, s."""
    p = parameters[0]
    samples, n = measured.shape[0], p.mode_joint.size
    every = commands.size // (samples - 1)
    arriving = command_delay.delayed(commands, dt, parameters)
    x, dx, work = start.copy(), np.zeros(start.size), np.zeros((5, start.size))
    at = np.empty((3, measured.shape[1]))
    result = np.zeros((5, samples))
    for k in range(samples):
        _write_rates(x, arriving[min(k * every, commands.size - 1)], measured[k], parameters, dx)
        result[0, k], result[1, k] = dx[core.P_H], dx[core.P_S]
        result[2, k] = p.mode_joint[0] * dx[core.MODES + n]
        for i in range(1, n):
            bent = x[core.MODES + i]
            result[3, k] += p.mode_joint[i] * bent
            result[4, k] += (p.mode_tip_angle[i] - p.mode_joint[i]) * bent
        if k == samples - 1:
            break
        slope = (measured[k + 1] - measured[k]) / every
        for j in range(every):
            at[0] = measured[k] + slope * j
            at[1] = at[0] + 0.5 * slope
            at[2] = at[0] + slope
            _step(x, arriving[k * every + j], dt, at, parameters, work)
    return result


@compiled_parallel
def follow(
    starts: Array, commands: Array, dt: float, measured: Array, parameters: NDArray[Any]
) -> Array:
    """Return (m, 5, n), the columns of Rates, of m machines along one recording.

    starts: (m, s) states. commands: (k,) y2, each held for dt, s; k a multiple of n - 1.
    measured: (n, 4) p_H, p_S, Pa, boom angle, rad, its rate, rad/s. parameters: (m,) records.
    """
    machines = parameters.size
    result = np.empty((machines, 5, measured.shape[0]))
    for m in numba.prange(machines):
        result[m] = _follow(starts[m], commands, dt, measured, parameters[m : m + 1])
    return result

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
from emir_plant.jit import compiled, compiled_parallel


class Rates(NamedTuple):
    """What the model says along the recording, each (m, n) for m machines and n samples."""

    pressure_lifting: Array  # dp_H/dt, Pa/s
    pressure_lowering: Array  # dp_S/dt, Pa/s
    turning: Array  # d^2/dt^2 of the boom's rigid rotation, rad/s^2
    bending: Array  # boom angle minus rigid rotation, rad
    deflection: Array  # alpha_6 - alpha_1, rad


@compiled
def _derivative(
    x: Array, command: float, measured: Array, parameters: NDArray[Any]
) -> tuple[Array, Array]:
    """Return the state with the measured values in it, and its rates.

    measured: (4,) p_H, p_S, Pa, boom angle, rad, and its rate, rad/s.
    """
    p = parameters[0]
    n = p.mode_joint.size
    x = x.copy()
    x[core.P_H], x[core.P_S] = measured[0], measured[1]
    position, rate = x[core.MODES : core.MODES + n], x[core.MODES + n :]
    bent = np.dot(p.mode_joint[1:], position[1:])
    position[0] = (measured[2] - bent) / p.mode_joint[0]
    rate[0] = (measured[3] - np.dot(p.mode_joint[1:], rate[1:])) / p.mode_joint[0]
    return x, core.derivative(x, command, parameters)


@compiled
def _follow(
    x: Array, commands: Array, dt: float, measured: Array, parameters: NDArray[Any]
) -> Array:
    """Return (5, n), the columns of Rates along measured (n, 4); RK4 in steps of dt, s."""
    p = parameters[0]
    samples, n = measured.shape[0], p.mode_joint.size
    every = commands.size // (samples - 1)
    tip = p.mode_tip_angle - p.mode_joint
    result = np.empty((5, samples))
    for k in range(samples):
        command = commands[min(k * every, commands.size - 1)]
        state, rates = _derivative(x, command, measured[k], parameters)
        modes = state[core.MODES + 1 : core.MODES + n]
        result[0, k], result[1, k] = rates[core.P_H], rates[core.P_S]
        result[2, k] = p.mode_joint[0] * rates[core.MODES + n]
        result[3, k] = np.dot(p.mode_joint[1:], modes)
        result[4, k] = np.dot(tip[1:], modes)
        if k == samples - 1:
            break
        slope = (measured[k + 1] - measured[k]) / every
        for j in range(every):
            command = commands[k * every + j]
            at = measured[k] + slope * j
            between, after = at + 0.5 * slope, at + slope
            _, k1 = _derivative(x, command, at, parameters)
            _, k2 = _derivative(x + 0.5 * dt * k1, command, between, parameters)
            _, k3 = _derivative(x + 0.5 * dt * k2, command, between, parameters)
            _, k4 = _derivative(x + dt * k3, command, after, parameters)
            x = x + dt / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
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

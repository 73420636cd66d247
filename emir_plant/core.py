"""The compiled core: the right-hand side of joint 1's integrated model and its integration.

The state vector holds the hydraulic states at the indices named here, then the boom's modal
coordinates and then their rates.
"""

import math
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from emir_plant import linkage
from emir_plant.effects import terms
from emir_plant.hydraulics import chambers, logic_block, valve
from emir_plant.hydraulics.flows import flows
from emir_plant.jit import compiled, compiled_parallel

Array = NDArray[np.float64]

P_H, P_S, SPOOL, SPOOL_RATE, LOGIC, MODES = 0, 1, 2, 3, 4, 5

STEP = 1e-3  # s, integration step: a tenth of the fastest oscillation kept (63 Hz) and less


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


@compiled
def _dot(a: Array, b: Array) -> float:
    """Return the inner product; on a handful of numbers a loop is faster than BLAS."""
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total


@compiled
def derivative(x: Array, command: float, parameters: NDArray[Any]) -> Array:
    """Return dx/dt of the integrated model (paper Fig. 6) at the valve command y2."""
    p = parameters[0]
    n = p.mode_joint.size
    position, rate = x[MODES : MODES + n], x[MODES + n : MODES + 2 * n]
    angle = _dot(p.mode_joint, position)
    stroke, arm = linkage.stroke(angle, p), linkage.lever_arm(angle, p)
    velocity = arm * _dot(p.mode_joint, rate)

    opening = valve.opening(x[SPOOL], p)
    flow_lifting, flow_lowering = flows(opening, x[P_H], x[P_S], x[LOGIC], p)
    leak = terms.cross_flow(x[P_H], x[P_S], p)

    dx = np.empty_like(x)
    dx[P_H] = chambers.pressure_rate(
        flow_lifting - leak,
        p.area_lifting * velocity,
        chambers.volume_lifting(stroke, p),
        x[P_H],
        p,
    )
    dx[P_S] = chambers.pressure_rate(
        flow_lowering + leak,
        -p.area_lowering * velocity,
        chambers.volume_lowering(stroke, p),
        x[P_S],
        p,
    )
    dx[SPOOL] = x[SPOOL_RATE]
    dx[SPOOL_RATE] = valve.spool_acceleration(command, x[SPOOL], x[SPOOL_RATE], p)
    dx[LOGIC] = logic_block.opening_rate(x[LOGIC], x[P_H], p)

    torque = (chambers.piston_force(x[P_H], x[P_S], p) - terms.friction(velocity, p)) * arm
    gravity = math.cos(angle)
    for i in range(n):
        dx[MODES + i] = rate[i]
        dx[MODES + n + i] = (
            p.mode_joint[i] * torque
            - p.mode_weight[i] * gravity
            - p.mode_stiffness[i] * position[i]
            - p.mode_damping[i] * rate[i]
        )
    return dx


@compiled
def truth(x: Array, parameters: NDArray[Any]) -> Truth:
    """Return what an ideal observer would read off the state."""
    p = parameters[0]
    n = p.mode_joint.size
    position, rate = x[MODES : MODES + n], x[MODES + n : MODES + 2 * n]
    angle = _dot(p.mode_joint, position)
    opening = valve.opening(x[SPOOL], p)
    flow_lifting, flow_lowering = flows(opening, x[P_H], x[P_S], x[LOGIC], p)
    return Truth(
        angle,
        _dot(p.mode_tip_angle, position),
        linkage.stroke(angle, p),
        linkage.lever_arm(angle, p) * _dot(p.mode_joint, rate),
        chambers.piston_force(x[P_H], x[P_S], p),
        x[P_H],
        x[P_S],
        flow_lifting,
        flow_lowering,
        x[SPOOL],
        x[LOGIC],
        _dot(p.mode_deflection, position) + p.residual_sag * math.cos(angle),
    )


@compiled
def advance(x: Array, command: float, dt: float, parameters: NDArray[Any]) -> Array:
    """Return the state after dt, s, under a constant command; RK4 in steps of at most STEP."""
    steps = max(1, math.ceil(dt / STEP - 1e-9))
    h = dt / steps
    for _ in range(steps):
        k1 = derivative(x, command, parameters)
        k2 = derivative(x + 0.5 * h * k1, command, parameters)
        k3 = derivative(x + 0.5 * h * k2, command, parameters)
        k4 = derivative(x + h * k3, command, parameters)
        x = x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
        x[P_H] = max(x[P_H], 0.0)
        x[P_S] = max(x[P_S], 0.0)
    return x


@compiled
def simulate(x: Array, commands: Array, dt: float, every: int, parameters: NDArray[Any]) -> Array:
    """Run a whole command sequence.

    commands: (k,), each held for dt, s. Returns (1 + k // every, len(Truth)): the truth at the
    start and after every `every` commands.
    """
    result = np.empty((1 + commands.size // every, len(truth(x, parameters))))
    for k in range(commands.size + 1):
        if k % every == 0:
            for i, value in enumerate(truth(x, parameters)):
                result[k // every, i] = value
        if k < commands.size:
            x = advance(x, commands[k], dt, parameters)
    return result


@compiled_parallel
def simulate_many(
    starts: Array, commands: Array, dt: float, every: int, parameters: NDArray[Any]
) -> Array:
    """Run m machines under the same commands, in parallel.

    starts: (m, n) states; parameters: (m,) records. Returns (m, 1 + k // every, len(Truth)).
    """
    machines = parameters.size
    columns = len(truth(starts[0], parameters[:1]))
    result = np.empty((machines, 1 + commands.size // every, columns))
    for m in numba.prange(machines):
        result[m] = simulate(starts[m], commands, dt, every, parameters[m : m + 1])
    return result

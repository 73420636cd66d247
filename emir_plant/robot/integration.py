"""Steps of the whole robot: stiff elastic part implicit, oil explicit, compiled.

Within a period of REFRESH the mass matrix M and the bias b stay at their values for the posture
expected at its middle. Steps of STEP alternate between the two halves of the machine (Strang's
splitting, second order):

    mechanics, oil pressures held    M dv/dt = -b - K q - D v + torques      implicit midpoint rule
    oil, motion held                 dp/dt, spool, logic block, pump         Runge-Kutta

The midpoint rule is stable at any stiffness and, like the splitting, takes no energy out of a
swing: damping in a result is that of the machine.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from emir_plant.jit import compiled
from emir_plant.robot import actuators, elimination, linkage
from emir_plant.robot.actuators import ACTUATORS
from emir_plant.robot.kinematics import Deflection, Tree, deflection, tips
from emir_plant.robot.stiffness import COORDINATES

Array = NDArray[np.float64]
Index = NDArray[np.int64]

STEP = 1e-3  # s
REFRESH = 4e-3  # s

STROKE, VELOCITY, RATIO, STOP_FORCE = 0, 1, 2, 3  # rows of the drives' motion, (4, 6), base first
LOWEST, HIGHEST, STOP_STIFFNESS, STOP_DAMPING = 0, 1, 2, 3  # rows of the end stops, (4, 6)
HELD_AT, HOLD_STIFFNESS, HOLD_DAMPING = 0, 1, 2  # rows of the brakes, (3, 6)


class Tables(NamedTuple):
    """The machine as the compiled functions read it."""

    spring: Array  # of every cut's coordinates, (6,)
    damper: Array  # likewise
    joints: Index  # places in q, (6,)
    cuts: Index  # places in q, (15, 6)
    linkages: NDArray[Any]  # records, (5,)
    brakes: Array  # (3, 6)
    stops: Array  # (4, 6)
    drives: NDArray[Any]  # records, (6,)
    pump: Array  # see `actuators.pump_record`
    tree: Tree  # of the bodies


@compiled
def drive_motion(q: Array, v: Array, t: Tables, motion: Array) -> None:
    """Write strokes, speeds, ratios and end stops' forces of the drives to motion, (4, 6).

    Base first: its stroke is its angle, its ratio 1, and it has no end.
    """
    base = t.joints[0]
    motion[STROKE, 0], motion[VELOCITY, 0], motion[RATIO, 0] = q[base], v[base], 1.0
    motion[STOP_FORCE, 0] = 0.0
    for k in range(1, ACTUATORS):
        p, joint = t.linkages[k - 1], t.joints[k]
        parts = linkage.motion(q[joint], p)
        motion[STROKE, k] = parts[linkage.LENGTH, 0] - p.length_stretched
        motion[VELOCITY, k] = parts[linkage.LENGTH, 1] * v[joint]
        motion[RATIO, k] = parts[linkage.LENGTH, 1]
        motion[STOP_FORCE, k] = _end_stop(motion[STROKE, k], motion[VELOCITY, k], t.stops[:, k])


@compiled
def shown(state: Array, tcp: tuple[int, Array], t: Tables) -> tuple[Array, Array, Deflection]:
    """Return of a state the drives' motion, (4, 6), the oil's forces, (6,), N, and the TCP.

    tcp: see `kinematics.tips`.
    """
    n = (state.size - actuators.SIZE) // 2
    oil, q, v = state[: actuators.SIZE], state[actuators.SIZE :][:n], state[actuators.SIZE + n :]
    motion, force = np.empty((4, ACTUATORS)), np.empty(ACTUATORS)
    drive_motion(q, v, t, motion)
    for k in range(ACTUATORS):
        force[k] = actuators.oil_force(oil, k, t.drives)
    places, axes = tips(q, t.joints, t.tree, tcp)
    return motion, force, deflection(places, axes)


@compiled
def _end_stop(stroke: float, velocity: float, stop: Array) -> float:
    """Return the force of an end stop on the piston, N; it pushes and never pulls."""
    damping = stop[STOP_DAMPING] * velocity
    if stroke < stop[LOWEST]:
        return max(stop[STOP_STIFFNESS] * (stop[LOWEST] - stroke) - damping, 0.0)
    if stroke > stop[HIGHEST]:
        return min(stop[STOP_STIFFNESS] * (stop[HIGHEST] - stroke) - damping, 0.0)
    return 0.0


@compiled
def _meets_stop(stroke: float, way: float, stop: Array) -> bool:
    """Return whether a piston is, or on its way, m, will be pressed into an end stop."""
    return min(stroke, stroke + way) < stop[LOWEST] or max(stroke, stroke + way) > stop[HIGHEST]


@compiled
def _oil(x: Array, h: float, commands: Array, motion: Array, t: Tables) -> None:
    """Advance the oil, x (31,), by h, s, in place while the motion is held."""
    k = np.empty((4, x.size))
    between = x.copy()
    for stage in range(4):
        actuators.write_rates(between, commands, motion, t.drives, t.pump, k[stage])
        share = h if stage == 2 else 0.5 * h  # noqa: PLR2004 (the last stage stands at h)
        for i in range(x.size):
            between[i] = x[i] + share * k[stage, i]
    for i in range(x.size):
        x[i] += h / 6.0 * (k[0, i] + 2.0 * (k[1, i] + k[2, i]) + k[3, i])
    actuators.limit(x)


@compiled
def _stiffness_added(oil: Array, h: float, ahead: float, motion: Array, t: Tables) -> Array:
    """Return what the midpoint rule adds to the mass matrix's diagonal, (n,).

    ahead: time, s, for which it is to serve.
    """
    added = np.zeros(t.joints.size + t.cuts.size)
    for c in range(t.cuts.shape[0]):
        for i in range(COORDINATES):
            added[t.cuts[c, i]] = 0.5 * h * t.damper[i] + 0.25 * h * h * t.spring[i]
    for k in range(ACTUATORS):
        # friction may be steep where a piston stands; an end stop always is
        pressing = actuators.pressing(oil, k, t.drives)
        damping = actuators.friction_slope(motion[VELOCITY, k], pressing, t.drives[k])
        stiffness = 0.0
        if k > 0 and _meets_stop(motion[STROKE, k], motion[VELOCITY, k] * ahead, t.stops[:, k]):
            damping += t.stops[STOP_DAMPING, k]
            stiffness += t.stops[STOP_STIFFNESS, k]
        square = motion[RATIO, k] * motion[RATIO, k]
        damping = damping * square + t.brakes[HOLD_DAMPING, k]
        stiffness = stiffness * square + t.brakes[HOLD_STIFFNESS, k]
        added[t.joints[k]] = 0.5 * h * damping + 0.25 * h * h * stiffness
    return added


@compiled
def _write_impulse(
    oil: Array, q: Array, v: Array, h: float, motion: Array, t: Tables, impulse: Array
) -> None:
    """Add to impulse, (n,), what drives, springs and dampers give within h, s."""
    force = np.empty(ACTUATORS)
    actuators.forces(oil, motion[VELOCITY], t.drives, force)
    for k in range(ACTUATORS):
        at = t.joints[k]
        middle = q[at] + 0.5 * h * v[at]
        ratio = linkage.ratio(middle, t.linkages[k - 1]) if k > 0 else 1.0
        stop = 0.0
        if k > 0:
            halfway = motion[STROKE, k] + 0.5 * h * motion[VELOCITY, k]
            stop = _end_stop(halfway, motion[VELOCITY, k], t.stops[:, k])
        torque = ratio * (force[k] + stop)
        torque -= t.brakes[HOLD_STIFFNESS, k] * (middle - t.brakes[HELD_AT, k])
        impulse[at] += h * (torque - t.brakes[HOLD_DAMPING, k] * v[at])
    for c in range(t.cuts.shape[0]):
        for i in range(COORDINATES):
            at = t.cuts[c, i]
            impulse[at] -= h * (t.spring[i] * (q[at] + 0.5 * h * v[at]) + t.damper[i] * v[at])


@compiled
def period(
    oil: Array,
    q: Array,
    v: Array,
    commands: Array,
    h: float,
    steps: int,
    posture: tuple[Array, Array],
    bias: Array,
    t: Tables,
) -> None:
    """Advance oil, (31,), q and v, (n,), in place by `steps` steps of h, s.

    commands: (6,). posture: coordinates of the tree and slopes of the linkages' parts for which
    the mass matrix holds (`reduction.expand`). bias: (n,).
    """
    motion, change = np.empty((4, ACTUATORS)), np.empty(q.size)
    drive_motion(q, v, t, motion)
    added = _stiffness_added(oil, h, steps * h, motion, t)
    factors = elimination.factorized(posture[0], posture[1], added, t.tree)
    _oil(oil, 0.5 * h, commands, motion, t)
    for step in range(steps):
        for i in range(q.size):
            change[i] = -h * bias[i]
        _write_impulse(oil, q, v, h, motion, t, change)
        elimination.solve(factors, change)
        for i in range(q.size):
            q[i] += h * (v[i] + 0.5 * change[i])
            v[i] += change[i]
        drive_motion(q, v, t, motion)
        _oil(oil, 0.5 * h if step == steps - 1 else h, commands, motion, t)

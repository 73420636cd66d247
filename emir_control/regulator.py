"""Observer and feedback of the LQG control: linear model about a posture, and both gains.

With s = F / k_h, metres of oil, deviations from a plan obey

    q'' + D q' + K q = J r k_h (s - f) + psi p + (F_0 dr/dalpha J + W sin(alpha)) J^T q
    s' = u + d - r J^T q'

f: unknown force on the piston, friction for one; d: unknown flow; p: unknown force at the TCP, a
load that came or went; all change slowly. psi: the TCP's displacement per q. u acts late.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from emir_common.quantity import check_ranges, quantity
from emir_control.actuator import Actuator
from emir_control.boom import Boom
from emir_control.prefilter import joint_angle, lever_arm

Array = NDArray[np.float64]

ANGLE_STEP = 1e-5  # rad
FLOOR = 1e-18  # of the process noise: what keeps the Riccati equation well posed


@dataclass(frozen=True, kw_only=True)
class NoiseParameters:
    """What the Kalman filter reckons with: standard deviations, drifts from sample to sample."""

    flow_drift: float = quantity("m/s", 1e-7, 1.0, "of d", default=3e-4)
    load_drift: float = quantity("N", 1e-3, 1e6, "of p", default=0.2)
    sudden_load: float = quantity(
        "N", 1e-3, 1e6, "of p while a load seems to come or to go", default=100.0
    )
    force_drift: float = quantity("m", 1e-9, 1.0, "of f", default=2e-5)
    velocity_noise: float = quantity("m/s", 1e-7, 1.0, "of u", default=2e-3)
    angle_noise: float = quantity(
        "rad", 1e-7, 0.1, "of the resolver; its steps are no white noise in a move", default=1.5e-3
    )
    bending_noise: float = quantity("rad", 1e-7, 0.1, "of the strain gauges", default=3e-5)
    force_noise: float = quantity("N", 1.0, 1e6, "of the force by pressures", default=1.5e3)

    def __post_init__(self) -> None:
        check_ranges(self)


AT_REST = NoiseParameters(
    flow_drift=1e-4,
    load_drift=5.0,
    sudden_load=30.0,
    force_drift=1e-5,
    velocity_noise=1e-3,
    angle_noise=4.4e-4,
)  # a resolver of 12 bits: a step over the root of 12


WATCHING = NoiseParameters(flow_drift=3e-3, velocity_noise=2e-2)  # whoever commands u


@dataclass(frozen=True, kw_only=True)
class RegulatorParameters:
    """Noise that the Kalman filter reckons with, and what the feedback weighs.

    Of the weights the size that counts as one.
    """

    modes: int = quantity("1", 2, 16, "of the boom in the model", default=3)
    delay: float = quantity("s", 0.0, 0.2, "from measurement to valve current", default=0.0)
    moving: NoiseParameters = field(default_factory=NoiseParameters)
    at_rest: NoiseParameters = AT_REST
    deflection_weight: float = quantity("m", 1e-5, 1.0, "dynamic deflection", default=1e-3)
    position_weight: float = quantity("m", 1e-5, 1.0, "TCP off its place", default=2e-2)
    velocity_weight: float = quantity("m/s", 1e-5, 1.0, "u off the plan", default=4e-3)

    def __post_init__(self) -> None:
        check_ranges(self)


@dataclass(frozen=True, eq=False)
class Filter:
    """A Kalman filter in its steady state.

    gain, loaded: (n, 3), the latter while a load comes or goes. certainty: (3, 3), inverse
    covariance of the innovation.
    """

    gain: Array
    loaded: Array
    certainty: Array


@dataclass(frozen=True, eq=False)
class Regulator:
    """x(k+1) = A x + B [u(k), u(k-1) ...], y = C x, with x = (q, q', s, f, d, p).

    modes: m in q. A: (n, n), n = 2 m + 4. B: (n, l + 1), for u now and l past ones. C: (3, n):
    joint angle, rad, bending, rad, s, m. moving, at_rest: the filter of x; watching: where another
    one drives, u being in d. feedback: (2 m + 1 + l,), on w = (q, q', s, past u); w(k+1) =
    extended w + driven u. stage, cost: matrices of the cost of a period and to go. deflection,
    position: (m,) of the TCP, m, per q. held: (2 m + 1,) where (q, q', s) rests under p = 1 N,
    the joint in its place.
    """

    modes: int
    A: Array
    B: Array
    C: Array
    moving: Filter
    at_rest: Filter
    watching: Filter
    feedback: Array
    extended: Array
    driven: Array
    stage: Array
    cost: Array
    deflection: Array
    position: Array
    held: Array

    @property
    def controlled(self) -> int:
        """Return how many states the feedback acts on: all but f, d and p."""
        return 2 * self.modes + 1

    @property
    def delays(self) -> int:
        """Return l."""
        return int(self.B.shape[1]) - 1

    @property
    def force(self) -> int:
        """Return the index of f."""
        return 2 * self.modes + 1

    @property
    def flow(self) -> int:
        """Return the index of d."""
        return 2 * self.modes + 2

    @property
    def load(self) -> int:
        """Return the index of p."""
        return 2 * self.modes + 3

    def off(self, estimate: Array, past: Array) -> Array:
        """Return what the feedback acts on, (q, q', s - f, past u + d), held still under p.

        estimate: (n,) x. past: (l,) u, m/s.
        """
        off = np.append(estimate[: self.controlled], past + estimate[self.flow])
        off[self.controlled - 1] -= estimate[self.force]
        off[: self.controlled] -= self.held * estimate[self.load]
        return off

    def command(self, estimate: Array, past: Array) -> float:
        """Return u off the plan, m/s."""
        return -float(estimate[self.flow]) - float(self.feedback @ self.off(estimate, past))


def regulator(
    boom: Boom, drive: Actuator, stroke: float, period: float, p: RegulatorParameters
) -> Regulator:
    """Return the regulator about rest at a stroke, m, for control periods of a length, s."""
    m = min(p.modes, len(boom.joint))
    continuous, stiffness = _continuous(boom, drive, stroke, m)
    A, B = _sampled(continuous, period, p.delay + drive.lag)
    C = np.zeros((3, len(A)))
    C[0, :m], C[1, :m], C[2, 2 * m] = boom.joint[:m], (boom.tip_angle - boom.joint)[:m], 1.0
    extended, driven = _with_past(A, B, m)
    stage = np.zeros_like(extended)
    for row, size in ((boom.deflection, p.deflection_weight), (boom.tip, p.position_weight)):
        stage[:m, :m] += np.outer(row[:m], row[:m]) / size**2
    stage += 1e-9 * np.eye(len(stage))
    effort = np.array([[1.0 / p.velocity_weight**2]])
    cost = scipy.linalg.solve_discrete_are(extended, driven, stage, effort)
    feedback = np.linalg.solve(effort + driven.T @ cost @ driven, driven.T @ cost @ extended)[0]
    return Regulator(
        modes=m,
        A=A,
        B=B,
        C=C,
        moving=_filter((A, B, C), stiffness, p.moving),
        at_rest=_filter((A, B, C), stiffness, p.at_rest),
        watching=_filter((A, B, C), stiffness, WATCHING),
        feedback=feedback,
        extended=extended,
        driven=driven[:, 0],
        stage=stage,
        cost=cost,
        deflection=boom.deflection[:m],
        position=boom.tip[:m],
        held=_held(continuous, boom.joint[:m], m),
    )


def _continuous(boom: Boom, drive: Actuator, stroke: float, m: int) -> tuple[Array, float]:
    """Return [A B], (n, n + 1), of the deviations, and k_h, N/m."""
    linkage = drive.parameters.static
    angle = joint_angle(stroke, linkage)
    arm = lever_arm(angle, linkage)
    ahead, behind = (lever_arm(angle + d, linkage) for d in (ANGLE_STEP, -ANGLE_STEP))
    force = boom.holding_torque * math.cos(angle) / arm
    stiffness = drive.stiffness(stroke)
    joint, n = boom.joint[:m], 2 * m + 4
    follower = joint * force * (ahead - behind) / (2.0 * ANGLE_STEP)
    follower = follower + boom.weight[:m] * math.sin(angle)
    model = np.zeros((n, n + 1))
    model[:m, m : 2 * m] = np.eye(m)
    model[m : 2 * m, :m] = np.outer(follower, joint) - np.diag(boom.stiffness[:m])
    model[m : 2 * m, m : 2 * m] = -np.diag(boom.damping[:m])
    model[m : 2 * m, 2 * m] = joint * arm * stiffness
    model[m : 2 * m, 2 * m + 1] = -joint * arm * stiffness
    model[m : 2 * m, 2 * m + 3] = boom.tip[:m]
    model[2 * m, m : 2 * m] = -arm * joint
    model[2 * m, 2 * m + 2] = model[2 * m, n] = 1.0
    return model, stiffness


def _held(continuous: Array, joint: Array, m: int) -> Array:
    """Return (q, q', s), (2 m + 1,), at rest under p = 1 N with the joint's angle as it was."""
    equations = np.zeros((m + 1, m + 1))
    equations[:m, :m] = continuous[m : 2 * m, :m]
    equations[:m, m] = continuous[m : 2 * m, 2 * m]
    equations[m, :m] = joint
    found = np.linalg.solve(equations, np.append(-continuous[m : 2 * m, 2 * m + 3], 0.0))
    return np.concatenate([found[:m], np.zeros(m), found[m:]])


def _sampled(continuous: Array, period: float, late: float) -> tuple[Array, Array]:
    """Return A, (n, n), and B, (n, l + 1), of an input that is held and comes late, s."""
    n = len(continuous)

    def held(time: float) -> tuple[Array, Array]:
        both = scipy.linalg.expm(time * np.vstack([continuous, np.zeros((1, n + 1))]))
        return both[:n, :n], both[:n, n]

    whole, part = divmod(late, period)
    past = int(whole)
    rest, newer = held(period - part)
    _, older = held(part)
    B = np.zeros((n, past + 2))
    B[:, past], B[:, past + 1] = newer, rest @ older
    return held(period)[0], B


def _with_past(A: Array, B: Array, m: int) -> tuple[Array, Array]:
    """Return the model of (q, q', s, past u): what the feedback acts on."""
    c, past = 2 * m + 1, B.shape[1] - 1
    extended = np.zeros((c + past, c + past))
    extended[:c, :c], extended[:c, c:] = A[:c, :c], B[:c, 1:]
    extended[c + 1 :, c:-1] = np.eye(past - 1)
    driven = np.zeros((c + past, 1))
    driven[:c, 0], driven[c, 0] = B[:c, 0], 1.0
    return extended, driven


def _filter(system: tuple[Array, Array, Array], stiffness: float, p: NoiseParameters) -> Filter:
    gain, certainty = _kalman(*system, stiffness, p)
    loaded, _ = _kalman(*system, stiffness, replace(p, load_drift=p.sudden_load))
    return Filter(gain, loaded, certainty)


def _kalman(
    A: Array, B: Array, C: Array, stiffness: float, p: NoiseParameters
) -> tuple[Array, Array]:
    """Return the gain, (n, 3), and the inverse covariance of the innovation, (3, 3)."""
    driven = B.sum(axis=1)
    noise = p.velocity_noise**2 * np.outer(driven, driven) + FLOOR * np.eye(len(A))
    noise[-3, -3] += p.force_drift**2
    noise[-2, -2] += p.flow_drift**2
    noise[-1, -1] += p.load_drift**2
    sensors = np.diag([p.angle_noise, p.bending_noise, p.force_noise / stiffness]) ** 2
    P = scipy.linalg.solve_discrete_are(A.T, C.T, noise, sensors)
    certainty = np.linalg.inv(C @ P @ C.T + sensors)
    return P @ C.T @ certainty, certainty

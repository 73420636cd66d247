"""The machine of the blind test: joint 1's equations written a second time.

An effect is a subclass that overrides the method in which it acts; two effects are a class with
both as bases. Nothing here is smoothed or compiled: LSODA of scipy integrates it with an error
estimate, from one change of the command to the next.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import odeint
from scipy.optimize import root

from emir_analysis.blind.boom import boom
from emir_analysis.blind.numbers import Numbers

Array = NDArray[np.float64]
Sizes = dict[str, float]

LAMINAR = 1e5  # Pa, below which an orifice is laminar
CAVITY = 5e3  # Pa, below which a falling pressure is brought to a stop
HYDRAULIC = 5  # states in front of the boom's: p_H, p_S, spool, its rate, logic block
RELATIVE = 1e-8  # accuracy of the integration
ABSOLUTE = (1.0, 1.0, 1e-6, 1e-4, 1e-6)  # of the hydraulic states; Pa, Pa, 1, 1/s, 1
ABSOLUTE_MODES = 1e-5  # sqrt(kg) m: 1e-8 rad of the joint
ABSOLUTE_MEMORY = 1e-9
AT_REST = 1e-9  # of the largest force on a mode


class NotSolvedError(RuntimeError):
    """A machine could not be integrated."""


class Machine:
    """Joint 1 with the boom stretched. sizes: of effects, by "effect.size", SI units.

    built: its numbers before effects change any.

    The state is p_H, p_S, spool, its rate, logic block, modal coordinates, their rates, then
    what effects remember.
    """

    def __init__(self, numbers: Numbers, sizes: Sizes | None = None) -> None:
        self.sizes = sizes or {}
        self.built = numbers
        self.n = self.changed(numbers)
        self.boom = boom(self.n)
        modes = self.boom.joint.size
        self.modes = slice(HYDRAULIC, HYDRAULIC + 2 * modes)
        self._slots = 0
        nothing = np.zeros(modes)
        self._rows = np.vstack(
            [
                np.append(self.boom.joint, nothing),
                np.append(self.boom.tip_angle, nothing),
                np.append(nothing, self.boom.joint),
            ]
        )

    # what effects change

    def changed(self, numbers: Numbers) -> Numbers:
        """Return the numbers as an effect makes them."""
        return numbers

    def delay(self) -> float:
        """Return how late a command arrives at the valve, s."""
        return 0.0

    def stroke(self, angle: float) -> float:
        """Return the stroke, m, at the boom angle, rad: cosine rule."""
        return float(self.stated_stroke(angle))

    def lever_arm(self, angle: float) -> float:
        """Return dh/dalpha, m: the distance of the cylinder's line from the joint."""
        n = self.n
        side = float(self._length(angle))
        area = 0.5 * n.triangle_a * n.triangle_b * math.sin(angle + n.triangle_gamma0)
        return 2.0 * area / side

    def resistance(self, velocity: float, force: float, stroke: float) -> float:
        """Return the force, N, that the piston has to overcome beside the boom."""
        return 0.0

    def play(self, x: list[float]) -> float:
        """Return the offset of the piston against the joint, m."""
        return 0.0

    def tip_force(self, time: float) -> float:
        """Return a force across the boom at the TCP, N, up positive."""
        return 0.0

    def weight(self, time: float, angle: float) -> Array:
        """Return what gravity takes from each mode's force, at the boom angle, rad."""
        return self.boom.weight * math.cos(angle)

    def bending(self, position: Array, rate: Array) -> Array:
        """Return the boom's own generalised forces."""
        return -self.boom.stiffness * position - self.boom.damping * rate

    def accelerations(self, x: Array, time: float, angle: float, push: float) -> Array:
        """Return those of the modes; push: force on the joint along the cylinder, N."""
        b = self.boom
        half = HYDRAULIC + b.joint.size
        forces = self.bending(x[HYDRAULIC:half], x[half : self.modes.stop])
        forces += b.joint * (push * self.lever_arm(angle)) - self.weight(time, angle)
        load = self.tip_force(time)
        return forces + b.tip * load if load else forces

    def stiffness(self, pressure: float, volume: float, *, lifting: bool) -> float:
        """Return the stiffness of a chamber's content, Pa."""
        return self.n.beta

    def leaving(self, p_h: float, p_s: float) -> tuple[float, float]:
        """Return the flows that leave both chambers by no valve, m^3/s."""
        return 0.0, 0.0

    def supply(self, time: float, x: list[float]) -> float:
        """Return the pressure at the pump, Pa."""
        return self.n.p0

    def pumped(self, wanted: float, drop: float) -> float:
        """Return the pump's flow, m^3/s, where one is wanted and a pressure, Pa, drives it."""
        n = self.n
        if drop <= 0.0:
            return 0.0  # check valve
        path = n.k_pump_line + n.k_block_in + n.balance_pressure / (wanted * wanted)
        return min(wanted, _orifice(drop, path))

    def acceleration(self, command: float, spool: float, rate: float) -> float:
        """Return the spool's acceleration, 1/s^2."""
        w = self.n.natural_frequency
        return w * (w * (command - spool) - 2.0 * self.n.damping * rate)

    def edges(self, spool: float, x: list[float]) -> float:
        """Return the position of the metering edges."""
        return spool

    def opening(self, edges: float, time: float, stroke: float) -> float:
        """Return the opening of the metering edges, signed."""
        width = self.n.dead_zone
        if edges > width:
            return (edges - width) / (1.0 - width)
        if edges < -width:
            return (edges + width) / (1.0 - width)
        return 0.0

    def pilot(self, p_h: float, p_s: float) -> float:
        """Return the pressure that opens the logic block, Pa."""
        return p_h

    def remembered_rates(self, time: float, x: list[float], now: dict[str, float]) -> list[float]:
        """Return the rates of what effects remember, in the order of their slots."""
        return []

    def start_memory(self, angle: float, x: list[float]) -> list[float]:
        """Return what effects remember at rest, in the same order."""
        return []

    def slot(self) -> int:
        """Return the index in the state of one more number to remember."""
        self._slots += 1
        return self.modes.stop + self._slots - 1

    def shown(self, signals: dict[str, Array], states: Array) -> dict[str, Array]:
        """Return what the sensors show of the truth; states: (n, s)."""
        return signals

    # the machine itself

    def stated_stroke(self, angle: Any) -> Any:
        """Return the stroke by the stated linkage, m, at angles, rad."""
        return self._length(angle) - self._length(0.0)

    def _length(self, angle: Any) -> Any:
        n = self.n
        across = n.triangle_b * np.sin(angle + n.triangle_gamma0)
        along = n.triangle_a - n.triangle_b * np.cos(angle + n.triangle_gamma0)
        return np.hypot(across, along)

    def flows(self, opening: float, supply: float, p_h: float, p_s: float, logic: float) -> Any:
        """Return Q_H, Q_S and the pump's flow, m^3/s."""
        n = self.n
        square = opening * opening
        if opening > 0.0:
            pumped = self.pumped(opening * n.flow_nominal, supply - p_h)
            back = _orifice(p_s - n.pT, n.k_meter_out_lifting / square + n.k_return_line)
            return pumped, -back, pumped
        if opening < 0.0:
            pumped = self.pumped(-opening * n.flow_nominal * n.flow_ratio_lowering, supply - p_s)
            block = n.k_block_out / max(logic * logic, 1e-12)
            back = _orifice(p_h - n.pT, n.k_meter_out_lowering / square + n.k_return_line + block)
            return -back, pumped, pumped
        return 0.0, 0.0, 0.0

    def start(self, angle: float, p_s: float) -> Array:
        """Return the state at rest at a boom angle, rad, with both chambers shut."""
        b, n = self.boom, self.n
        across = b.tip * self.tip_force(0.0) - self.weight(0.0, angle)
        torque = -across[0] / b.joint[0]
        bent = self._bent(across + b.joint * torque)
        bent[0] = (angle - b.joint @ bent) / b.joint[0]
        beside = self.resistance(0.0, torque / self.lever_arm(angle), self.stroke(angle))
        force = torque / self.lever_arm(angle) + beside
        p_h = (force + p_s * n.area_lowering) / n.area_lifting
        opened = float(self.pilot(p_h, p_s) > n.threshold)
        x = [p_h, p_s, 0.0, 0.0, opened, *bent.tolist(), *([0.0] * bent.size)]
        return np.array(x + self.start_memory(angle, x))

    def _bent(self, load: Array) -> Array:
        """Return the modes' positions, the rigid one 0, at rest under forces on each, (m,)."""
        straight, still = load[1:] / self.boom.stiffness[1:], np.zeros(load.size)

        def left(bent: Array) -> Array:
            """Return what is left of the forces, in units of the largest."""
            forces = load + self.bending(np.append(0.0, bent), still)
            return np.asarray(forces[1:] / np.abs(load).max())

        found = root(left, straight, tol=AT_REST)
        if not np.all(np.abs(found.fun) <= AT_REST):
            raise NotSolvedError(f"{type(self).__name__}: the boom bends without end")
        return np.append(0.0, found.x)

    def rates(self, x: Array, time: float, command: float) -> Array:
        """Return dx/dt."""
        state = x.tolist()
        p_h, p_s, spool, rate, logic = state[:HYDRAULIC]
        modes = x[self.modes]
        angle, tip_angle, spin = (self._rows @ modes).tolist()
        stroke = self.stroke(angle) + self.play(state)
        opening = self.opening(self.edges(spool, state), time, stroke)
        q_h, q_s, pumped = self.flows(opening, self.supply(time, state), p_h, p_s, logic)
        now = {
            "angle": angle,
            "deflection": tip_angle - angle,
            "pressure_lifting": p_h,
            "pressure_lowering": p_s,
            "force": p_h * self.n.area_lifting - p_s * self.n.area_lowering,
            "spool": spool,
            "pumped": pumped,
        }
        remembered = self.remembered_rates(time, state, now)
        velocity = self.lever_arm(angle) * spin
        moved = velocity + now.get("play_rate", 0.0)
        dx = np.empty_like(x)
        dx[:2] = self._pressure_rates((p_h, p_s), (q_h, q_s), stroke, moved)
        dx[2:HYDRAULIC] = (
            rate,
            self.acceleration(command, spool, rate),
            self.logic_rate(logic, self.pilot(p_h, p_s)),
        )
        half = HYDRAULIC + modes.size // 2
        dx[HYDRAULIC:half] = x[half : self.modes.stop]
        push = now["force"] - self.resistance(velocity, now["force"], stroke)
        dx[half : self.modes.stop] = self.accelerations(x, time, angle, push)
        dx[self.modes.stop :] = remembered
        return dx

    def _pressure_rates(
        self, p: tuple[float, float], q: tuple[float, float], stroke: float, moved: float
    ) -> tuple[float, float]:
        n = self.n
        out_h, out_s = self.leaving(*p)
        v_h = n.volume_lifting_0 + n.area_lifting * stroke
        v_s = n.volume_lowering_0 - n.area_lowering * stroke
        dp_h = (q[0] - out_h - n.area_lifting * moved) * self.stiffness(p[0], v_h, lifting=True)
        dp_s = (q[1] - out_s + n.area_lowering * moved) * self.stiffness(p[1], v_s, lifting=False)
        return _no_pull(dp_h / v_h, p[0]), _no_pull(dp_s / v_s, p[1])

    def logic_rate(self, opened: float, pilot: float) -> float:
        """Return how fast the logic block opens, 1/s, at its opening and pilot pressure, Pa."""
        if pilot > self.n.threshold:
            return (1.0 - opened) / self.n.time_constant_opening
        return -opened / self.n.time_constant_closing

    def run(self, x: Array, times: Array, command: float) -> Array:
        """Return the states at times, (n, s), the first of which is the start, under a command.

        Raises NotSolvedError where the integration fails.
        """
        memory = x.size - self.modes.stop
        modes = self.modes.stop - HYDRAULIC
        absolute = [*ABSOLUTE, *([ABSOLUTE_MODES] * modes), *([ABSOLUTE_MEMORY] * memory)]
        solve: Any = odeint  # whose stubs know no tolerance by component
        states, told = solve(
            self.rates,
            x,
            times,
            args=(command,),
            rtol=RELATIVE,
            atol=absolute,
            tcrit=[times[-1]],
            h0=1e-4,
            mxstep=20000,
            full_output=True,
        )
        if told["message"] != "Integration successful." or not np.all(np.isfinite(states)):
            raise NotSolvedError(f"{type(self).__name__}: {told['message']}")
        return np.asarray(states)

    def signals(self, states: Array) -> dict[str, Array]:
        """Return what the sensors show of states, (n, s), without noise and quantisation."""
        angle, tip_angle, _ = self._rows @ states[:, self.modes].T
        true = {
            "angle": angle,
            "pressure_lifting": states[:, 0],
            "pressure_lowering": states[:, 1],
            "deflection": tip_angle - angle,
        }
        return self.shown(true, states)


def _no_pull(rate: float, pressure: float) -> float:
    """Return the pressure's rate, Pa/s: oil does not pull, at 0 it falls no further."""
    return rate * pressure / CAVITY if rate < 0.0 and pressure < CAVITY else rate


def _orifice(drop: float, resistance: float) -> float:
    """Return the flow, m^3/s, of dp = k Q|Q|, laminar below 1 bar; k in Pa s^2/m^6."""
    root = math.sqrt(math.hypot(drop, LAMINAR))
    return drop / (root * math.sqrt(resistance))

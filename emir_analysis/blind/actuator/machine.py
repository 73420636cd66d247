"""The actuator of the blind test: its equations written a second time.

An effect is a subclass that overrides the method in which it acts; two effects are a class with
both as bases. LSODA of scipy integrates it with an error estimate.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import odeint

from emir_analysis.blind.machine import Array, NotSolvedError, Sizes

State = list[float]

SPOOL, OIL, MASS, WAY, STRETCH, SWING, SWING_WAY = range(7)
FINE = 20  # places per sample at which the valve's command is known
LONGEST_STEP = 0.5  # samples
RELATIVE, ABSOLUTE = 1e-7, 1e-8  # accuracy of the integration
MOST_STEPS = 20000  # in one sample


@dataclass(frozen=True)
class Numbers:
    """What a data sheet states, in its units.

    gain: flow per opening, negative where a positive opening lowers. lag: time constant of the
    spool. frequency: of the mass on the oil. friction: pressure per velocity.
    """

    gain: float
    lag: float
    frequency: float
    friction: float


class Actuator:
    """A valve, oil and a mass. sizes: of effects, by name.

    The state is spool, pressure of the oil, velocity of the mass, way of the piston, its way
    against the mass, then velocity of a hanging load and the way of what carries it against it.
    """

    def __init__(self, numbers: Numbers, sizes: Sizes | None = None) -> None:
        self.n = numbers
        self.sizes = sizes or {}

    # what effects change

    def delay(self) -> float:
        """Return how late a command arrives at the valve."""
        return 0.0

    def arriving(self, time: Array, opening: Array) -> Array:
        """Return what the spool follows at times, (m,), under an opening of each sample, (n,)."""
        return np.interp(time - self.delay(), np.arange(opening.size), opening)

    def edges(self, spool: float) -> float:
        """Return the position of the metering edges, in the sense of the command."""
        return spool

    def opening(self, spool: float) -> float:
        """Return the valve's opening, positive where it lifts."""
        edges = self.edges(spool)
        return edges if self.n.gain > 0.0 else -edges

    def overlap(self, *, lifting: bool) -> float:
        """Return the opening up to which nothing flows."""
        return 0.0

    def gain(self, time: float, *, lifting: bool) -> float:
        """Return the flow per opening."""
        return abs(self.n.gain)

    def most(self, *, lifting: bool) -> float:
        """Return the greatest flow."""
        return float("inf")

    def driven(self, pressure: float, *, lifting: bool) -> float:
        """Return the share of the flow that is left against a pressure."""
        return 1.0

    def leaving(self, pressure: float) -> float:
        """Return the flow that leaves the oil by no valve."""
        return 0.0

    def capacity(self, flow: float, pressure: float) -> float:
        """Return the volume per pressure that the oil takes up, over the stated one."""
        return 1.0

    def resistance(self, velocity: float, way: float, pressure: float) -> float:
        """Return what resists the piston's motion under the oil's pressure, as a pressure."""
        return self.n.friction * velocity

    def load(self, way: float, time: float) -> float:
        """Return the force on the piston whether it moves or not, as a pressure."""
        return 0.0

    def piston(self, x: State, time: float) -> float:
        """Return the piston's velocity."""
        return x[MASS]

    def push(self, x: State, velocity: float, time: float) -> float:
        """Return the force on the mass, as a pressure, at the piston's velocity."""
        return x[OIL] - self.resistance(velocity, x[WAY], x[OIL]) - self.load(x[WAY], time)

    def hanging(self) -> float:
        """Return the hanging load's mass over that of what carries it."""
        return 0.0

    def tug(self, x: State) -> float:
        """Return the acceleration of the hanging load."""
        return 0.0

    def shown(self, pressure: float, flow: float) -> float:
        """Return the pressure that the transducer shows."""
        return pressure

    # the machine itself

    def flow(self, spool: float, pressure: float, time: float) -> float:
        """Return the flow through the valve, positive where it lifts."""
        opening = self.opening(spool)
        lifting = opening > 0.0
        metered = max(abs(opening) - self.overlap(lifting=lifting), 0.0)
        flow = min(self.gain(time, lifting=lifting) * metered, self.most(lifting=lifting))
        flow *= self.driven(pressure, lifting=lifting)
        return flow if lifting else -flow

    def rates(self, time: float, state: Array, places: Array, arriving: Array) -> State:
        """Return dx/dt under a command, (m,), known at places in time, (m,)."""
        x = state.tolist()
        command = float(np.interp(time, places, arriving))
        flow, velocity, tug = self.flow(x[SPOOL], x[OIL], time), self.piston(x, time), self.tug(x)
        kept = flow - velocity - self.leaving(x[OIL])
        pushed = self.n.frequency**2 * self.push(x, velocity, time)
        return [
            (command - x[SPOOL]) / self.n.lag,
            kept / self.capacity(flow, x[OIL]),
            pushed - self.hanging() * tug,
            velocity,
            velocity - x[MASS],
            tug,
            x[MASS] - x[SWING],
        ]

    def run(self, opening: Array) -> Array:
        """Return the pressure (n,) that is shown from standstill, without noise.

        opening: (n,), one every unit of time, straight between. Raises NotSolvedError where the
        integration fails.
        """
        samples = np.arange(opening.size, dtype=np.float64)
        places = np.linspace(0.0, samples[-1], (samples.size - 1) * FINE + 1)
        arriving = self.arriving(places, opening)
        start = np.zeros(SWING_WAY + 1)
        start[SPOOL] = arriving[0]
        solve: Any = odeint
        states, told = solve(
            self.rates,
            start,
            samples,
            args=(places, arriving),
            tfirst=True,
            rtol=RELATIVE,
            atol=ABSOLUTE,
            hmax=LONGEST_STEP,
            mxstep=MOST_STEPS,
            full_output=True,
        )
        if told["message"] != "Integration successful." or not np.all(np.isfinite(states)):
            raise NotSolvedError(f"{type(self).__name__}: {told['message']}")
        seen = zip(
            samples.tolist(), states[:, SPOOL].tolist(), states[:, OIL].tolist(), strict=True
        )
        return np.array([self.shown(p, self.flow(spool, p, time)) for time, spool, p in seen])

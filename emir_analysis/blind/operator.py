"""Who moves the machine: from target to target at random speeds, by the stroke that is shown."""

import numpy as np

from emir_analysis.blind.numbers import Numbers

Random = np.random.Generator

RANGE = (0.25, 1.30)  # rad, in which the targets lie
REST = 1.0  # s, before the first move
PAUSES = 0.5  # share of moves after which the machine rests
LONGEST = 6.0  # s, of one move
LEAST = 2e-3  # of the nominal speed, for which the valve is opened


class Operator:
    """Follows a trapezoid of speed from target to target, by feedback; between, the valve is shut.

    abrupt: speed in jumps instead of ramps. Commands in [-1, 1], zero while it waits.
    """

    def __init__(self, random: Random, stated: Numbers, strokes: tuple[float, float],
                 *, abrupt: bool) -> None:  # fmt: skip
        self._random, self._stated, self._strokes = random, stated, strokes
        self._feedback = random.uniform(0.1, 0.25)  # 1/s, well below the slow mode
        self._ramp = 0.0 if abrupt else random.uniform(0.3, 0.8)  # s
        self._fastest = random.uniform(0.4, 0.7) if abrupt else random.uniform(0.6, 0.95)
        self._reference = 0.0  # m, where the machine ought to be while it moves
        self._begin, self._end, self._speed = 0.0, REST, 0.0

    def command(self, time: float, shown: float) -> float:
        """Return the valve command y2 at a time, s, by the stroke shown, m."""
        n = self._stated
        if time >= self._end:
            self._next_move(time, shown)
        if self._speed == 0.0:
            return 0.0
        speed = self._speed * self._envelope(time)
        self._reference += speed * n.command_period
        nominal = n.flow_nominal / n.area_lifting
        wanted = (speed + self._feedback * (self._reference - shown)) / nominal
        if wanted < 0.0:
            wanted *= n.area_lowering / n.area_lifting / n.flow_ratio_lowering
        if abs(wanted) < LEAST:
            return 0.0
        return float(np.clip(np.sign(wanted) * n.dead_zone + wanted * (1 - n.dead_zone), -1, 1))

    def _next_move(self, time: float, shown: float) -> None:
        waited = self._speed == 0.0
        if waited:
            self._reference = shown
        self._begin = time
        if not waited and self._random.uniform() < PAUSES:
            self._speed, self._end = 0.0, time + self._random.uniform(0.3, 2.5)
            return
        low, high = self._strokes
        distance = self._random.uniform(low, high) - self._reference
        nominal = self._stated.flow_nominal / self._stated.area_lifting
        speed = nominal * self._fastest * self._random.uniform(0.2, 1.0)
        lasting = max(abs(distance) / speed, 0.5) + self._ramp
        self._speed = float(np.sign(distance)) * speed
        self._end = time + min(lasting, LONGEST)

    def _envelope(self, time: float) -> float:
        if self._ramp == 0.0:
            return 1.0
        return float(np.clip(min(time - self._begin, self._end - time) / self._ramp, 0.0, 1.0))

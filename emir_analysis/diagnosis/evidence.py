"""All recordings of one machine together: their balances and free runs in one vector each."""

from collections.abc import Sequence
from functools import cached_property, lru_cache

import numpy as np

from emir_analysis.diagnosis.balances import (
    LINKAGE,
    Balances,
    available,
    level,
    noise_floor,
)
from emir_analysis.diagnosis.experiment import OUTPUTS, STROKE, Experiment, noise
from emir_analysis.diagnosis.time_limit import TimeLimit
from emir_analysis.errors import InputError
from emir_analysis.signals import Array
from emir_plant.parameters import Machine
from emir_plant.plant import SimulationError


class Evidence:
    """Recordings of one machine, which stands in the data sheet as `stated`.

    experiments: all with the same signals. sensors: (4,) the outputs' noise, NaN where an output
    is not known. told: (5,) which balances the signals allow; fitted: (5,) which of them hold
    something that parameters could change: the linkage's only where the stroke has a sensor of
    its own. complete: all but the linkage's are told. limit: of the time that fits to them take.
    """

    def __init__(
        self, experiments: Sequence[Experiment], stated: Machine, limit: TimeLimit | None = None
    ) -> None:
        self.experiments = tuple(experiments)
        self.stated = stated
        self.limit = limit or TimeLimit()
        self.measured = frozenset.intersection(*(e.measured for e in self.experiments))
        shown = np.array([name in self.measured or name == STROKE for name in OUTPUTS])
        self.sensors = np.where(shown, noise(stated), np.nan)
        for name, size in zip(OUTPUTS, self.sensors, strict=True):
            if size == 0.0:
                raise InputError(f"the data sheet's noise of {name} is 0: an error is told from it")
        self.shown = shown
        self.told = available(self.measured)
        parameters = np.arange(self.told.size) != LINKAGE
        self.complete = bool(np.all(self.told[parameters]))
        self.fitted = self.told & (parameters | bool(stated.sensors.own_stroke))

    @cached_property
    def _balances(self) -> list[Balances]:
        return [Balances(experiment, self.stated) for experiment in self.experiments]

    @property
    def name(self) -> str:
        """The recordings' names."""
        return ", ".join(experiment.name for experiment in self.experiments)

    @property
    def windows_of_first(self) -> int:
        """Number of the balances' windows in the first recording."""
        return self._balances[0].time.size

    def head(self, share: float) -> "Evidence":
        """Return the first part of every recording."""
        return Evidence([e.head(share) for e in self.experiments], self.stated, self.limit)

    def until(self, time: float) -> "Evidence":
        """Return every recording up to a time, s."""
        return Evidence([e.until(time) for e in self.experiments], self.stated, self.limit)

    @property
    def time(self) -> Array:
        """Middle of the balances' windows, (w,) s, one recording behind the other."""
        parts, offset = [], 0.0
        for experiment, balances in zip(self.experiments, self._balances, strict=True):
            parts.append(balances.time + offset)
            offset += float(experiment.time[-1])
        return np.concatenate(parts)

    def place(self, time: float) -> tuple[str, float]:
        """Return of which recording a time of `time` is, s, and which time of it."""
        for experiment in self.experiments[:-1]:
            if time <= experiment.time[-1]:
                return experiment.name, time
            time -= float(experiment.time[-1])
        return self.experiments[-1].name, time

    def duration(self, share: float) -> float:
        """Return the length of a share of all recordings, s."""
        return share * sum(float(e.time[-1]) for e in self.experiments)

    def signals(self) -> dict[str, tuple[str, Array]]:
        """Return unit and window means, (w,), of what a residual may depend on."""
        each = [balances.signals() for balances in self._balances]
        return {
            name: (each[0][name][0], np.concatenate([found[name][1] for found in each]))
            for name in each[0]
            if all(name in found for found in each)
        }

    def residuals(self, machines: Sequence[Machine]) -> Array:
        """Return what is missing in each balance, (m, w, 5), SI units; NaN where it is not told."""
        left = np.concatenate([b.residuals(machines) for b in self._balances], axis=1)
        return np.asarray(np.where(self.told, left, np.nan))

    def in_noise(self, residuals: Array, floor: Array) -> Array:
        """Return those residuals, (m, w, 5), that are fitted, (m, n), in units of a floor, (5,)."""
        return np.asarray((residuals / floor)[:, :, self.fitted].reshape(len(residuals), -1))

    def one_step(self, machine: Machine) -> list[Array]:
        """Return each recording's errors, (n, 4), SI units, as `Balances.one_step`."""
        return [balances.one_step(machine) for balances in self._balances]

    @property
    def velocity(self) -> Array:
        """The piston's velocity, (n,) m/s, smoothed, one recording behind the other."""
        return np.concatenate([balances.velocity for balances in self._balances])

    def check_like(self, other: "Evidence") -> None:
        """Raise InputError where these recordings lack a signal that others have."""
        lacking = sorted(other.measured - self.measured)
        if lacking:
            raise InputError(f"{self.experiments[0].name}: no {lacking[0]}, which the others have")

    def floor(self, machine: Machine) -> Array:
        """Return the level, (5,), that the sensors of a machine alone leave in each balance.

        NaN where it is not told. The linkage balance is exact: there it is the stroke's own noise.
        Of a machine whose run leaves every bound the stated one's. Raises InputError where that
        does, too.
        """
        left = np.concatenate([np.concatenate(draws) for draws in _drawn(self, machine)])
        floor = np.where(self.told, level(left), np.nan)
        floor[LINKAGE] = self.sensors[0]
        return floor

    def drawn_levels(self, machine: Machine) -> Array:
        """Return the same of each of d draws of the sensors' noise, (d, 5), the linkage's NaN."""
        draws = _drawn(self, machine)
        count = min(len(draw) for draw in draws)
        levels = [level(np.concatenate([draw[k] for draw in draws])) for k in range(count)]
        told = self.told & (np.arange(self.told.size) != LINKAGE)
        return np.where(told, levels, np.nan)


@lru_cache(maxsize=8)  # floor and drawn levels are asked for of one machine, and some once more
def _drawn(evidence: Evidence, machine: Machine) -> list[Array]:
    try:
        return [noise_floor(e, machine, evidence.stated) for e in evidence.experiments]
    except SimulationError as error:
        if machine == evidence.stated:
            advice = "check the data sheet, and sign and zero of joint_angle"
            raise InputError(f"{error}; {advice}") from error
        return _drawn(evidence, evidence.stated)

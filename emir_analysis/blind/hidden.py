"""What all that may be hidden in a machine has: how its sizes are drawn, and for which machine.

Each effect draws its sizes at random inside the range that is usual for it (`hidden_*.py`).
"""

from collections.abc import Callable
from typing import ClassVar

import numpy as np

from emir_analysis.blind.machine import Machine, Sizes
from emir_analysis.blind.numbers import Numbers, main_joint

Random = np.random.Generator
Scale = Callable[[Numbers], float]

ATMOSPHERE = 1e5  # Pa
P_H, P_S = 0, 1  # places in the state


def between(random: Random, low: float, high: float) -> float:
    """Return a number between two positive ones, its logarithm evenly spread."""
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def either_sign(random: Random, low: float, high: float) -> float:
    """Return the same, of either sign."""
    return float(random.choice([-1.0, 1.0])) * between(random, low, high)


def lifting_force(n: Numbers) -> float:
    """Return the lifting force of the pump's pressure, N."""
    return n.area_lifting * n.p0


def nominal_speed(n: Numbers) -> float:
    """Return the piston's nominal speed, m/s."""
    return n.flow_nominal / n.area_lifting


def lever(n: Numbers) -> float:
    """Return the lever to which the stroke is in proportion, m."""
    return n.triangle_b


def boom_mass(n: Numbers) -> float:
    """Return the boom's mass, kg, to which loads are in proportion."""
    return n.boom_mass


def nominal_leak(n: Numbers) -> float:
    """Return the nominal flow over the pump's pressure, m^3/(s Pa)."""
    return n.flow_nominal / n.p0


def nominal_hose(n: Numbers) -> float:
    """Return the cylinder's volume over the pump's pressure, m^3/Pa."""
    return n.area_lifting * n.triangle_b / n.p0


class Hidden(Machine):
    """Base of what may be hidden.

    name: as the catalogue has it. grows: sizes to which more of the effect belongs. scales: what
    sizes are in proportion to, from one machine to another.
    """

    name: ClassVar[str]
    grows: ClassVar[tuple[str, ...]]
    scales: ClassVar[dict[str, Scale]] = {}

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        """Return sizes by name, SI units, as in EMIR's main joint."""
        raise NotImplementedError

    @classmethod
    def drawn(cls, random: Random, n: Numbers) -> Sizes:
        """Return sizes by name, SI units, as in a machine with these numbers."""
        sizes, emir = cls.draw(random), main_joint()
        for name in sizes.keys() & cls.scales.keys():
            sizes[name] *= cls.scales[name](n) / cls.scales[name](emir)
        return sizes

    def size(self, name: str) -> float:
        """Return one of the effect's sizes; 0 where it was not drawn."""
        return self.sizes.get(name, 0.0)

"""How large an effect usually is in one machine beside another: what its size is in proportion to.

The registry's trial values are those of EMIR's main joint. A boom of half the length has an
eighth of the leak and eight times the droop; a search that begins at EMIR's may not get there.
"""

from collections.abc import Callable
from functools import cache

from emir_plant.parameters import Machine
from emir_plant.sheet import joint1


def _force(m: Machine) -> float:
    return m.supply.p0 * m.cylinder.area_lifting


def _speed(m: Machine) -> float:
    return m.valve.flow_nominal / m.cylinder.area_lifting


SCALES: dict[str, Callable[[Machine], float]] = {  # by a size's unit; others stay as they are
    "N": _force,
    "N s/m": lambda m: _force(m) / _speed(m),
    "N s^2/m^2": lambda m: _force(m) / _speed(m) ** 2,
    "kg": lambda m: m.geometry.boom_mass,
    "m^3/(s Pa)": lambda m: m.valve.flow_nominal / m.supply.p0,
    "m^3/Pa": lambda m: m.cylinder.area_lifting * m.geometry.triangle_b / m.cylinder.beta,
    "Pa s/m^3": lambda m: m.supply.p0 / m.valve.flow_nominal,
    "1/m": lambda m: 1.0 / m.geometry.triangle_b,
    "1/m^2": lambda m: 1.0 / m.geometry.triangle_b**2,
    "1/m^3": lambda m: 1.0 / m.geometry.triangle_b**3,
    "1/m^4": lambda m: 1.0 / m.geometry.triangle_b**4,
}


def proportion(unit: str, machine: Machine) -> float:
    """Return how large what has a unit is in a machine, as a multiple of EMIR's main joint."""
    scale = SCALES.get(unit)
    return 1.0 if scale is None else scale(machine) / scale(_emir())


@cache
def _emir() -> Machine:
    return joint1()

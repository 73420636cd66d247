"""Turbulent flow through resistances in series."""

from emir_plant.jit import compiled, square_root

LAMINAR_BELOW = 1e5  # Pa: below this drop the square root turns into a straight line


@compiled
def turbulent_flow(drop: float, conductance: float) -> float:
    """Return the flow, m^3/s, that a pressure drop, Pa, drives.

    dp = k Q|Q| with conductance = 1/sqrt(k), m^3/(s sqrt(Pa)); made laminar near dp = 0, where
    the square root's slope would be infinite: Q = c dp / (dp^2 + (1 bar)^2)^(1/4).
    """
    magnitude = square_root(drop * drop + LAMINAR_BELOW * LAMINAR_BELOW)
    return conductance * drop / square_root(magnitude)

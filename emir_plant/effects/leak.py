"""Oil that leaks through a gap, laminar, or through a hole, turbulent."""

from emir_plant.hydraulics.orifice import turbulent_flow
from emir_plant.jit import compiled

REFERENCE = 1e7  # Pa: the drop at which both laws give the same flow


@compiled
def leak(drop: float, coefficient: float, turbulent_share: float) -> float:
    """Return the flow, m^3/s, that a pressure drop, Pa, drives.

    coefficient: m^3/(s Pa), at the REFERENCE drop for the turbulent share.
    """
    laminar = (1.0 - turbulent_share) * coefficient * drop
    if turbulent_share == 0.0:
        return laminar
    return laminar + turbulent_flow(drop, turbulent_share * coefficient * REFERENCE**0.5)

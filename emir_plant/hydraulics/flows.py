"""The flows Q_H and Q_S through pump line, valve and logic block (paper Fig. 4, equations 1-6).

Q > 0 flows into a chamber. Conductances 1/sqrt(k) of a path are written as products, so that a
closed edge or logic block gives 0 instead of dividing by zero.
"""

import math
from typing import Any, NamedTuple

from emir_plant.hydraulics.orifice import turbulent_flow
from emir_plant.jit import compiled


class Pressures(NamedTuple):
    """The pressures between which oil flows, Pa; the tank's is a parameter."""

    supply: float
    lifting: float
    lowering: float


@compiled
def pump_flow(
    opening: float, nominal: float, supply: float, chamber_pressure: float, p: Any
) -> float:
    """Return the pump's flow into a chamber, m^3/s, never negative (check valve).

    While the pressure balance works it holds `balance_pressure` over the metering edge, and the
    flow is opening * nominal; short of pressure, the drop over the whole path decides.
    supply: pressure at the pump, Pa.
    """
    wanted = abs(opening) * nominal
    lines = p.k_pump_line + p.k_block_in
    conductance = wanted / math.sqrt(lines * wanted * wanted + p.balance_pressure)
    available = turbulent_flow(supply - chamber_pressure, conductance)
    return max(0.0, min(wanted, available))


@compiled
def lifting_flows(opening: float, pressures: Pressures, p: Any) -> tuple[float, float]:
    """Return (Q_H, Q_S), m^3/s, for an opening > 0."""
    inflow = pump_flow(opening, p.flow_nominal, pressures.supply, pressures.lifting, p)
    conductance = opening / math.sqrt(p.k_meter_out_lifting + p.k_return_line * opening * opening)
    return inflow, -turbulent_flow(pressures.lowering - p.pT, conductance)


@compiled
def lowering_flows(
    opening: float, pressures: Pressures, logic: float, p: Any
) -> tuple[float, float]:
    """Return (Q_H, Q_S), m^3/s, for an opening < 0; logic is the block's opening y4 in [0, 1]."""
    nominal = p.flow_nominal * p.flow_ratio_lowering
    inflow = pump_flow(opening, nominal, pressures.supply, pressures.lowering, p)
    edge, block = opening * opening, logic * logic
    resistance = p.k_meter_out_lowering * block + p.k_return_line * edge * block
    resistance += p.k_block_out * edge
    conductance = abs(opening) * logic / math.sqrt(resistance)
    return -turbulent_flow(pressures.lifting - p.pT, conductance), inflow


@compiled
def flows(opening: float, pressures: Pressures, logic: float, p: Any) -> tuple[float, float]:
    """Return (Q_H, Q_S), m^3/s; both chambers are shut while the opening is 0."""
    if opening > 0.0:
        return lifting_flows(opening, pressures, p)
    if opening < 0.0:
        return lowering_flows(opening, pressures, logic, p)
    return 0.0, 0.0


@compiled
def delivered(opening: float, flow_lifting: float, flow_lowering: float) -> float:
    """Return the pump's part of the flows (Q_H, Q_S), m^3/s."""
    if opening > 0.0:
        return flow_lifting
    if opening < 0.0:
        return flow_lowering
    return 0.0

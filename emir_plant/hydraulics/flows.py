"""The flows Q_H and Q_S through pump line, valve and logic block (paper Fig. 4, equations 1-6).

Q > 0 flows into a chamber. Conductances 1/sqrt(k) of a path are written as products, so that a
closed edge or logic block gives 0 instead of dividing by zero.
"""

from typing import Any, NamedTuple

from emir_plant.hydraulics.orifice import turbulent_flow
from emir_plant.jit import compiled, square_root


class Edges(NamedTuple):
    """The openings of the metering edges from the pump and to the tank.

    Of one sign, negative while lowering; 0 inside the dead zone, 1 fully open.
    """

    inlet: float
    outlet: float


class Pressures(NamedTuple):
    """The pressures between which oil flows, Pa; the tank's is a parameter."""

    supply: float
    lifting: float
    lowering: float


@compiled
def inlet_flow(wanted: float, drop: float, p: Any) -> float:
    """Return what a drop, Pa, drives through pump line, metering edge and block, m^3/s.

    wanted: flow, m^3/s, at which the edge alone drops `balance_pressure`; it stands for its size.
    """
    lines = p.k_pump_line + p.k_block_in
    return turbulent_flow(drop, wanted / square_root(lines * wanted * wanted + p.balance_pressure))


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
    return max(0.0, min(wanted, inlet_flow(wanted, supply - chamber_pressure, p)))


@compiled
def lifting_flows(edges: Edges, pressures: Pressures, p: Any) -> tuple[float, float]:
    """Return (Q_H, Q_S), m^3/s, for openings > 0."""
    inflow = pump_flow(edges.inlet, p.flow_nominal, pressures.supply, pressures.lifting, p)
    out = edges.outlet
    conductance = out / square_root(p.k_meter_out_lifting + p.k_return_line * out * out)
    return inflow, -turbulent_flow(pressures.lowering - p.pT, conductance)


@compiled
def lowering_flows(edges: Edges, pressures: Pressures, logic: float, p: Any) -> tuple[float, float]:
    """Return (Q_H, Q_S), m^3/s, for openings < 0; logic is the block's opening y4 in [0, 1].

    The pressure balance stands in the inlet, or in the return, where it holds the flow out to
    opening * Q_n as long as the load's pressure suffices; the inlet then is a plain edge.
    """
    nominal = p.flow_nominal * p.flow_ratio_lowering
    supply = min(pressures.supply, p.limit_lowering)
    out = abs(edges.outlet)
    edge, block = out * out, logic * logic
    resistance = p.k_meter_out_lowering * block + p.k_return_line * edge * block
    resistance += p.k_block_out * edge
    conductance = out * logic / square_root(resistance)
    outflow = turbulent_flow(pressures.lifting - p.pT, conductance)
    if p.balance_lowering == 0.0:
        return -outflow, pump_flow(edges.inlet, nominal, supply, pressures.lowering, p)
    inflow = inlet_flow(abs(edges.inlet) * nominal, supply - pressures.lowering, p)
    return -min(outflow, out * p.flow_nominal), max(0.0, inflow)


@compiled
def flows(edges: Edges, pressures: Pressures, logic: float, p: Any) -> tuple[float, float]:
    """Return (Q_H, Q_S), m^3/s; both chambers are shut while the openings are 0."""
    if edges.inlet > 0.0:
        return lifting_flows(edges, pressures, p)
    if edges.inlet < 0.0:
        return lowering_flows(edges, pressures, logic, p)
    return 0.0, 0.0


@compiled
def delivered(edges: Edges, flow_lifting: float, flow_lowering: float) -> float:
    """Return the pump's part of the flows (Q_H, Q_S), m^3/s."""
    if edges.inlet > 0.0:
        return flow_lifting
    if edges.inlet < 0.0:
        return flow_lowering
    return 0.0

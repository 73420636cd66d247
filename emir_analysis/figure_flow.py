"""The paper's figure 5: stationary flow Q_H over the valve's current y2 while lifting."""

import math
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.optimize import brentq

from emir_analysis.report import new_figure
from emir_plant.hydraulics import valve
from emir_plant.hydraulics.flows import Edges, Pressures, lifting_flows
from emir_plant.parameters import Machine
from emir_plant.plant import Plant

Array = NDArray[np.float64]

BAR = 1e5
LITRES_PER_MINUTE = 6e4  # of 1 m^3/s
SUPPLIES = (50.0, 100.0, 150.0, 200.0, 250.0, 320.0)  # bar
NORMAL = 100.0  # bar, from which on the paper calls the flow almost linear
CURRENTS = np.linspace(0.0, 1.0, 101)
HIGHEST = 1e8  # Pa, no chamber stands above it
ANGLES = (80.0, 70.0, 45.0)  # deg, loads of the boom, stretched and empty


@dataclass(frozen=True)
class FlowCurves:
    """Q_H, m^3/s, over CURRENTS under a load on the piston.

    load: what it is. force: N, at rest. flows: {supply, bar: (101,)}.
    """

    load: str
    force: float
    flows: dict[float, Array]

    def nonlinearity(self, supply: float) -> float:
        """Return the largest distance from the best straight line over the largest flow; 1.

        From where the valve opens on; NaN where nothing flows.
        """
        flow = self.flows[supply]
        if not flow.any():
            return math.nan
        open_ = slice(int(np.flatnonzero(flow)[0]), None)
        line = np.polynomial.Polynomial.fit(CURRENTS[open_], flow[open_], 1)
        return float(np.abs(line(CURRENTS[open_]) - flow[open_]).max() / flow.max())

    def worst(self) -> float:
        """Return the largest nonlinearity at normal supply; NaN where at one nothing flows."""
        return float(np.max([self.nonlinearity(s) for s in SUPPLIES if s >= NORMAL]))

    def spread(self) -> float:
        """Return how far the normal supplies' flows lie apart, over the largest of them; 1."""
        normal = np.array([flow for s, flow in self.flows.items() if s >= NORMAL])
        return float(np.ptp(normal, axis=0).max() / normal.max())


def flow_curves(machine: Machine) -> list[FlowCurves]:
    """Return the curves against the boom's weight at ANGLES.

    Raises SimulationError where the cylinder cannot hold it.
    """
    plant, loads = Plant(machine), {}
    for angle in ANGLES:
        loads[f"boom at {angle:g} deg"] = plant.outputs(plant.initial(math.radians(angle))).force
    return [
        FlowCurves(
            load,
            force,
            {s: np.array([stationary(machine, force, s * BAR, y) for y in CURRENTS])
             for s in SUPPLIES},
        )
        for load, force in loads.items()
    ]  # fmt: skip


def stationary(machine: Machine, force: float, supply: float, current: float) -> float:
    """Return Q_H, m^3/s, of the piston in steady motion against a force, N (paper Fig. 4).

    What the piston displaces leaves through the return edge: Q_S = -Q_H A_S / A_H. supply: Pa.
    """
    p = Plant(machine).record[0]
    high, low = machine.cylinder.area_lifting, machine.cylinder.area_lowering
    opening = valve.opening(current, p)
    if opening <= 0.0:
        return 0.0

    def both(pressure: float) -> tuple[float, float]:
        against = (force + pressure * low) / high
        return lifting_flows(Edges(opening, opening), Pressures(supply, against, pressure), p)

    def surplus(pressure: float) -> float:
        inflow, outflow = both(pressure)
        return -outflow - inflow * low / high

    return float(both(brentq(surplus, machine.supply.pT, HIGHEST, xtol=1.0))[0])


def picture(curves: list[FlowCurves]) -> Figure:
    """Return one diagram a load, one line a supply pressure (Fig. 5)."""
    figure = new_figure(4.2)
    diagrams = figure.subplots(1, len(curves), sharey=True, squeeze=False)[0]
    for axes, found in zip(diagrams, curves, strict=True):
        for k, (supply, flow) in enumerate(found.flows.items()):
            colour = f"C{k}"
            width = 0.8 + 0.7 * (len(found.flows) - k)  # lines that coincide stay visible
            axes.plot(
                CURRENTS, flow * LITRES_PER_MINUTE, color=colour, lw=width,
                label=f"{supply:g} bar",
            )  # fmt: skip
        axes.set_title(f"{found.load}, {found.force / 1e3:.0f} kN", fontsize="medium")
        axes.set_xlabel("y2")
        axes.grid(visible=True, alpha=0.3)
    diagrams[0].set_ylabel("Q_H / l/min")
    diagrams[0].legend(title="supply p0", frameon=False, fontsize="small")
    return figure

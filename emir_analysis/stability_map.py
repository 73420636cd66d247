"""Where over posture and payload a predictive controller's loop is stable, as text and picture."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from emir_analysis.design_pfc import OUTPUTS, OperatingPoint, velocity_model
from emir_control import design
from emir_control.pfc import Pfc, PfcParameters
from emir_control.scheduled_pfc import law_of
from emir_plant import linkage
from emir_plant.parameters import Machine
from emir_plant.plant import Plant, SimulationError

Array = NDArray[np.float64]

ANGLES = tuple(math.radians(degrees) for degrees in (30.0, 45.0, 60.0, 75.0))
PAYLOADS = (0.0, 500.0, 1000.0, 1500.0)  # kg
FINE_ANGLES = tuple(math.radians(degrees) for degrees in np.linspace(30.0, 75.0, 7))
FINE_PAYLOADS = tuple(np.linspace(0.0, 1500.0, 7))  # between the models of a schedule, too
VELOCITIES = (0.01, -0.01)  # m/s, of the piston: lifting and lowering


@dataclass(frozen=True)
class StabilityMap:
    """Spectral radius of the closed loop; stable below 1.

    angles: (a,) rad. payloads: (p,) kg. radius: {piston velocity, m/s: (p, a)}; NaN where the
    machine has no such motion.
    """

    angles: Sequence[float]
    payloads: Sequence[float]
    radius: dict[float, Array]

    @property
    def worst(self) -> float:
        """Return the largest radius."""
        return float(np.nanmax(list(self.radius.values())))


def stability_map(machine: Machine, controller: str, parameters: PfcParameters) -> StabilityMap:
    """Return the closed loop's stability over posture, payload and direction.

    Of a schedule between its nodes, too, for a payload that it has read off rightly.
    """
    law, p = law_of(parameters), Plant(machine).record[0]
    fine = parameters.schedule is not None
    angles, payloads = (FINE_ANGLES, FINE_PAYLOADS) if fine else (ANGLES, PAYLOADS)

    def parts(angle: float, payload: float) -> list[design.Part]:
        if isinstance(law, Pfc):
            return [(law, 1.0)]
        weights = law.schedule.weights(linkage.stroke(angle, p), payload)
        return [(law.laws[k], weight) for k, weight in weights.items()]

    def radius(angle: float, payload: float, velocity: float) -> float:
        point = OperatingPoint(angle=angle, payload=payload, velocity=velocity)
        try:
            model = velocity_model(machine, point, OUTPUTS[controller])
        except SimulationError:
            return math.nan
        return design.spectral_radius(parts(angle, payload), model)

    tables = {
        v: np.array([[radius(angle, load, v) for angle in angles] for load in payloads])
        for v in VELOCITIES
    }
    return StabilityMap(angles, payloads, tables)


def as_text(found: StabilityMap) -> str:
    """Return the map as text."""
    lines = []
    for velocity, radius in found.radius.items():
        lines.append(
            f"  {'lifting' if velocity > 0.0 else 'lowering'}, {abs(velocity) * 1e3:g} mm/s"
        )
        lines.append(table(found.angles, found.payloads, radius, _cell))
    return "\n".join(lines)


def table(
    angles: Sequence[float],
    payloads: Sequence[float],
    values: Array,
    cell: Callable[[float], str],
) -> str:
    """Return values, (payloads, angles), as lines of text; cell: one as eleven characters."""
    degrees = "".join(f"{math.degrees(angle):7.0f} deg" for angle in angles)
    lines = [f"  {'payload':>10}{degrees}"]
    for payload, row in zip(payloads, values, strict=True):
        lines.append(f"  {payload:7.0f} kg{''.join(cell(value) for value in row)}")
    return "\n".join(lines)


def _cell(radius: float) -> str:
    if math.isnan(radius):
        return f"{'-':>11}"
    return f"{radius:10.4f}{' ' if radius < 1.0 else '!'}"


def picture(found: StabilityMap) -> Figure:
    """Return the map as a picture: blue stable, red not, grey without such a motion."""
    figure = Figure(figsize=(4.2 * len(found.radius), 3.6), layout="constrained")
    axes = figure.subplots(1, len(found.radius), squeeze=False)[0]
    for axis, (velocity, table) in zip(axes, found.radius.items(), strict=True):
        axis.set_facecolor("0.8")
        image = axis.imshow(table, cmap="RdBu_r", vmin=0.97, vmax=1.03, origin="lower")
        axis.set_xticks(range(len(found.angles)), [f"{math.degrees(a):.0f}" for a in found.angles])
        axis.set_yticks(range(len(found.payloads)), [f"{load:.0f}" for load in found.payloads])
        axis.set_xlabel("boom angle / deg")
        axis.set_ylabel("payload / kg")
        axis.set_title("lifting" if velocity > 0.0 else "lowering")
        for (row, column), value in np.ndenumerate(table):
            if not math.isnan(value):
                axis.text(
                    column, row, f"{value:.4f}", ha="center", va="center", color="k",
                    fontsize=26.0 / len(found.angles) ** 0.7,
                )  # fmt: skip
    figure.colorbar(image, ax=list(axes), label="spectral radius")
    return figure

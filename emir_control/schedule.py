"""Models of a predictive controller over stroke and payload, and which of them count where.

The payload is read off the static force of the piston, which grows with it in every posture.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emir_common.quantity import ParameterError
from emir_control.internal_model import InternalModel

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Schedule:
    """Internal models at the nodes of a grid.

    strokes: (a,) m, rising. payloads: (p,) kg, rising. forces: (p, a) N, of the piston at rest.
    models: p rows of a. Raises ParameterError for other shapes, grids that do not rise, or
    models of different periods.
    """

    strokes: Array
    payloads: Array
    forces: Array
    models: tuple[tuple[InternalModel, ...], ...]

    def __post_init__(self) -> None:
        shape = self.payloads.size, self.strokes.size
        rows = {len(row) for row in self.models}
        if self.forces.shape != shape or len(self.models) != shape[0] or rows != {shape[1]}:
            raise ParameterError(
                f"schedule: forces and models have to be {shape[0]} rows of {shape[1]}"
            )
        for name in ("strokes", "payloads", "forces"):
            if not np.all(np.diff(getattr(self, name), axis=0) > 0.0):
                raise ParameterError(f"schedule: {name} do not rise")
        if len({model.period for row in self.models for model in row}) != 1:
            raise ParameterError("schedule: the models differ in their period")

    @property
    def flat(self) -> tuple[InternalModel, ...]:
        """Return the models in one row, the payloads' rows behind one another."""
        return tuple(model for row in self.models for model in row)

    def payload(self, stroke: float, force: float) -> float:
        """Return the payload, kg, that belongs to a static force, N, within the grid."""
        here = [np.interp(stroke, self.strokes, row) for row in self.forces]
        return float(np.interp(force, here, self.payloads))

    def weights(self, stroke: float, payload: float) -> dict[int, float]:
        """Return the weights, not 0 and 1 in all, of the models about a point, by place in `flat`.

        Bilinear; beyond the grid those of its edge.
        """
        found = {}
        for row, by_payload in _neighbours(self.payloads, payload):
            for column, by_stroke in _neighbours(self.strokes, stroke):
                if by_payload * by_stroke > 0.0:
                    found[row * self.strokes.size + column] = by_payload * by_stroke
        return found


def _neighbours(nodes: Array, value: float) -> tuple[tuple[int, float], tuple[int, float]]:
    """Return the nodes on both sides of a value and how much each counts."""
    place = float(np.interp(value, nodes, np.arange(nodes.size)))
    low = min(int(place), max(nodes.size - 2, 0))
    high = min(low + 1, nodes.size - 1)
    return (low, 1.0 - (place - low)), (high, place - low)

"""Linear design models of the machine as python-control systems, and how good they are.

The machine is linearized in a steady motion, its order reduced to what a controller needs, and
both are held against each other over frequency and against the nonlinear machine after a small
step of the valve. Needs the extra `design` (python-control).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emir_control import reduction
from emir_control.reduction import Linear
from emir_plant import operating_point
from emir_plant.core import Truth
from emir_plant.linearize import linearize
from emir_plant.plant import Plant

Array = NDArray[np.float64]

METHODS: dict[str, Callable[[Linear, int], Linear]] = {
    "balanced": reduction.balanced,
    "modal": reduction.modal,
}
ORDERS = (6, 8)  # paper 2.3
FULL, NONLINEAR = "linear", "nonlinear"  # names beside the reduced models
FREQUENCIES = np.geomspace(0.02, 20.0, 400)  # Hz
UP_TO = (1.0, 2.0, 5.0)  # Hz, up to which the largest error is told
TICK, DURATION = 5e-3, 3.0  # s, of the step response


@dataclass(frozen=True)
class Point:
    """Where the machine is linearized: a boom angle, rad, and a steady motion through it.

    velocity: of the piston, m/s; or, where None, command: y2.
    """

    angle: float
    velocity: float | None = 0.01
    command: float = 0.0

    def steady(self, plant: Plant) -> tuple[Array, float]:
        """Return state and valve command. Raises SimulationError where there is none."""
        if self.velocity is not None:
            return operating_point.at_velocity(plant, self.angle, self.velocity)
        return operating_point.under_command(plant, self.angle, self.command), self.command


@dataclass(frozen=True)
class DesignModels:
    """Models from y2 to some of the machine's outputs, by name, FULL among them.

    systems: control.StateSpace each. outputs: (p,) names from `Truth`. response: by name (p, k),
    at FREQUENCIES. error: by name (p, k), of the reduced ones' response over FULL's size.
    time: (t,) s. step: by name (p, t), deviation of the outputs after a step of the valve, that
    of the nonlinear machine under "nonlinear".
    """

    systems: dict[str, Any]
    outputs: tuple[str, ...]
    response: dict[str, NDArray[np.complex128]]
    error: dict[str, Array]
    time: Array
    step: dict[str, Array]

    def worst(self, name: str, output: str, up_to: float) -> float:
        """Return a reduced model's largest error up to a frequency, Hz."""
        return float(self.error[name][self.outputs.index(output), up_to >= FREQUENCIES].max())

    def off(self, name: str, output: str) -> float:
        """Return the rms difference from the nonlinear step response over its largest size."""
        k = self.outputs.index(output)
        wanted = self.step[NONLINEAR][k]
        return float(np.sqrt(np.mean((self.step[name][k] - wanted) ** 2)) / abs(wanted).max())


def linear(plant: Plant, point: Point, outputs: Sequence[str]) -> Linear:
    """Return the model from y2 to outputs named in `Truth`, about the point."""
    state, command = point.steady(plant)
    found = linearize(plant, state, command)
    rows = found.C[[Truth._fields.index(name) for name in outputs]]
    return Linear(found.A, found.B, rows, np.zeros((len(outputs), 1)))


def state_space(model: Linear, outputs: Sequence[str]) -> Any:
    """Return the model as control.StateSpace with named input and outputs."""
    import control  # noqa: PLC0415 (needs the extra)

    return control.StateSpace(
        model.A, model.B, model.C, model.D, inputs=["y2"], outputs=list(outputs)
    )


def design_models(
    plant: Plant,
    point: Point,
    outputs: Sequence[str] = ("stroke", "tip_angle"),
    orders: Sequence[int] = ORDERS,
    step: float = 0.02,
) -> DesignModels:
    """Linearize, reduce by every method to every order, and compare.

    step: of y2. Raises SimulationError where there is no such motion, ParameterError for an order
    that the model does not allow.
    """
    full = linear(plant, point, outputs)
    models = {FULL: full}
    for method, reduce in METHODS.items():
        models |= {f"{method}, order {order}": reduce(full, order) for order in orders}
    systems = {name: state_space(model, outputs) for name, model in models.items()}
    response = {name: _response(system) for name, system in systems.items()}
    time = np.arange(0.0, DURATION + 0.5 * TICK, TICK)
    steps = {NONLINEAR: _nonlinear_step(plant, point, outputs, step)}
    steps |= {name: _step(system, time, step) for name, system in systems.items()}
    wanted = response[FULL]
    error = {n: abs(r - wanted) / abs(wanted) for n, r in response.items() if n != FULL}
    return DesignModels(systems, tuple(outputs), response, error, time, steps)


def _response(system: Any) -> NDArray[np.complex128]:
    answer = system(2j * math.pi * FREQUENCIES, squeeze=False)
    return np.asarray(answer)[:, 0, :]


def _step(system: Any, time: Array, size: float) -> Array:
    import control  # noqa: PLC0415 (needs the extra)

    found = control.forced_response(system, time, np.full(time.size, size), squeeze=False)
    return np.asarray(found.outputs).reshape(-1, time.size)


def _nonlinear_step(plant: Plant, point: Point, outputs: Sequence[str], size: float) -> Array:
    """Return how far the machine departs from its motion when the valve is opened further."""
    state, command = point.steady(plant)
    columns = [Truth._fields.index(name) for name in outputs]
    ticks = round(DURATION / TICK)
    runs = [plant.simulate(state, np.full(ticks, y), TICK) for y in (command, command + size)]
    return np.asarray((runs[1] - runs[0])[:, columns].T)

"""Predictive functional control (paper 3.3, Fig. 10): a linear model looks a few steps ahead.

At the coincidence points, h_j samples ahead, the predicted output shall meet the reference
trajectory

    y_R(i+h) = c(i+h) - lambda^h (c(i) - y(i)),   lambda = exp(-3 T_s / T_CLRT)

The prediction is that of the internal model (`internal_model.py`) plus what the model's error is
extrapolated to. The command is a sum of basis functions 1, k, k^2 ... of the sample k ahead; the
first value of the one that fits best, in the least-squares sense, is applied.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from emir_common.quantity import ParameterError, check_ranges, quantity
from emir_control.internal_model import InternalModel
from emir_control.schedule import Schedule

Array = NDArray[np.float64]

Form = Literal["positional", "incremental"]
Future = Literal["preview", "velocity", "constant"]

PREVIEW = 20  # samples of the set point known ahead, paper 3.3: N
SAME_PERIOD = 1e-9  # s


@dataclass(frozen=True, kw_only=True)
class PfcParameters:
    """Internal model and tuning.

    model: from the velocity command to the controlled output.
    coincidence: h_j, samples ahead, increasing; at least as many as basis functions.
    form: the command itself, or its change as in the paper's (12); both give the same.
    future: where c(i+h) comes from: known ahead, extrapolated from the set point's rate, or c(i).
    schedule: models in place of that one, by posture and payload (`scheduled_pfc.py`).
    """

    model: InternalModel
    coincidence: tuple[int, ...] = (PREVIEW,)
    form: Form = "positional"
    future: Future = "preview"
    schedule: Schedule | None = None
    basis: int = quantity("1", 1, 4, "number of basis functions 1, k, k^2 ...", default=1)
    response_time: float = quantity(
        "s", 0.05, 20.0, "T_CLRT, after which 5 % of an error are left", default=1.5
    )
    error_degree: int = quantity("1", 0, 3, "of the model error's extrapolation", default=1)
    error_window: int = quantity("1", 1, 500, "samples that it is fitted to", default=32)
    delay: int = quantity("1", 0, 1, "samples from measurement to command; 1 in (12)", default=0)
    speed_limit: float = quantity("m/s", 1e-4, 1.0, "of the command", default=0.05)
    acceleration_limit: float = quantity(
        "m/s^2", 1e-3, 100.0, "of the command, from sample to sample", default=0.5
    )
    load_time: float = quantity(
        "s", 0.01, 60.0, "smooths the force from which a schedule reads the payload", default=3.0
    )

    def __post_init__(self) -> None:
        check_ranges(self)
        for name, choices in (("form", get_args(Form)), ("future", get_args(Future))):
            if getattr(self, name) not in choices:
                raise ParameterError(
                    f"{name} = {getattr(self, name)!r}: there are {', '.join(choices)}"
                )
        points, first = list(self.coincidence), self.delay + 1
        if points != sorted(set(points) & set(range(first, PREVIEW + 1))):
            raise ParameterError(
                f"coincidence = {points}: wanted are rising numbers from {first} to {PREVIEW}"
            )
        if len(points) < self.basis:
            raise ParameterError(f"coincidence = {points}: fewer than basis = {self.basis}")
        if self.error_window <= self.error_degree:
            raise ParameterError(
                f"error_window = {self.error_window}: has to exceed error_degree"
                f" = {self.error_degree}"
            )


class PfcState(NamedTuple):
    """Where model and command stand.

    origin: the output at which the model's output is 0. model: (n,) x_M(i) before the observer's
    correction. errors: (error_window,) y - y_M, the oldest first. command: the last one, m/s.
    shift: of the set point, dies out with T_CLRT; by it a controller takes over without a bump.
    """

    origin: float
    model: Array
    errors: Array
    command: float
    shift: float = 0.0


class PfcInputs(NamedTuple):
    """Set point and measurement of the controlled output, in its unit (m or rad)."""

    set_point: float  # c(i)
    set_rate: float  # dc/dt
    ahead: Sequence[float]  # c(i+1) ... c(i+20)
    output: float  # y(i)
    stroke: float = math.nan  # m, what a schedule goes by
    force: float = math.nan  # of the piston, N, as the stroke


class PfcOutputs(NamedTuple):
    """The command and its terms, those of (12)."""

    velocity_command: float  # applied from now on, m/s
    unlimited: float  # what the law wants, m/s
    reference_term: float  # k^T x_r, m/s
    model_term: float  # a^T x_M, m/s
    command_term: float  # b^T u, incremental with u itself, m/s
    error_term: float  # h^T (x - x_p), m/s
    model_error: float  # y - y_M, m or rad
    limited: bool  # amplitude or rate


@dataclass(frozen=True)
class Gains:
    """The constant vectors of (12).

    reference: (n_H,), k. decay: sum of k_j lambda^h_j. model: (n,), a. command: b, in the
    incremental form 1 + b. error: (error_window,), h, the oldest error first.
    """

    reference: Array
    decay: float
    model: Array
    command: float
    error: Array


@dataclass(frozen=True)
class Pfc:
    """The control law of one output with one command.

    Raises ParameterError where the coincidence points do not tell the basis functions apart.
    """

    parameters: PfcParameters

    def __post_init__(self) -> None:
        _ = self.gains  # a design that cannot work is refused here, not in the loop

    @cached_property
    def gains(self) -> Gains:
        """The constant vectors of the law, paper (12)."""
        p, m = self.parameters, self.parameters.model
        points = np.array(p.coincidence)
        basis = np.array([m.basis_response(h - p.delay, p.basis) for h in points])
        if np.linalg.matrix_rank(basis) < p.basis:
            raise ParameterError(
                f"coincidence = {list(p.coincidence)}: the model responds too little there"
            )
        nu = np.linalg.pinv(basis)[0]
        held = np.array([m.held_response(h) for h in points])
        given = held - basis[:, 0]  # of the command that acts until the new one does
        decay = self._decay**points
        return Gains(
            reference=nu,
            decay=float(nu @ decay),
            model=-nu @ np.array([m.free_response(h) for h in points]),
            command=1.0 - float(nu @ held) if p.form == "incremental" else -float(nu @ given),
            error=-nu @ self._extrapolation(points),
        )

    @cached_property
    def _decay(self) -> float:
        """lambda, by which the reference trajectory approaches the set point in one sample."""
        return math.exp(-3.0 * self.parameters.model.period / self.parameters.response_time)

    def _extrapolation(self, points: NDArray[np.int_]) -> Array:
        """Return E, (n_H, error_window): the errors' least-squares polynomial at the points.

        An observer leaves nothing to extrapolate: it has put the error into its state.
        """
        p = self.parameters
        if p.model.observer is not None:
            return np.zeros((points.size, p.error_window))
        past = np.vander(np.arange(1 - p.error_window, 1), p.error_degree + 1)
        return np.asarray(np.vander(points, p.error_degree + 1) @ np.linalg.pinv(past))

    def initial(self, inputs: PfcInputs, command: float = 0.0) -> PfcState:
        """Return the state in which the machine has moved at a constant command, m/s, for long.

        With the command in force when this controller takes over, it goes on from there.
        """
        p = self.parameters
        model = p.model.steady_state * command
        origin = inputs.output - float(p.model.C @ model)
        state = PfcState(origin, model, np.zeros(p.error_window), command)
        return self.take_over(state, inputs)

    def take_over(self, state: PfcState, inputs: PfcInputs) -> PfcState:
        """Return the state whose next command is the one in force, if limits and numbers allow.

        The set point is shifted to where the machine is, and the shift dies out with T_CLRT.
        """
        g, plain = self.gains, state._replace(shift=0.0)
        _, outputs = self.step(plain, inputs, self.parameters.model.period)
        sensitivity = float(g.reference.sum()) - g.decay
        shift = (state.command - outputs.unlimited) / sensitivity if sensitivity else 0.0
        return plain._replace(shift=shift if math.isfinite(shift) else 0.0)

    def step(self, state: PfcState, inputs: PfcInputs, dt: float) -> tuple[PfcState, PfcOutputs]:
        """Return the velocity command of this control period of dt, s.

        An input that is not a number stops the machine. Raises ValueError when dt is not the
        model's sampling period.
        """
        p, g = self.parameters, self.gains
        if abs(dt - p.model.period) > SAME_PERIOD:
            raise ValueError(f"dt = {dt:g} s: the model's period is {p.model.period:g} s")
        future = self._future(inputs)
        if not all(map(math.isfinite, (inputs.output, inputs.set_point, *future))):
            return self._halted(state)
        if not math.isfinite(state.origin):  # begun without a measurement
            state = self.initial(inputs)
        model, errors = self._corrected(state, inputs.output)
        wanted = np.subtract(future, state.origin - state.shift)
        miss = inputs.set_point + state.shift - inputs.output
        terms = (
            float(g.reference @ wanted) - g.decay * miss,
            float(g.model @ model),
            g.command * state.command,
            float(g.error @ errors),
        )
        unlimited = sum(terms)
        command = self._limited(unlimited, state.command)
        applied = state.command if p.delay else command
        ahead, shift = p.model.next(model, applied), state.shift * self._decay
        after = PfcState(state.origin, ahead, errors, command, shift)
        limited = command != unlimited
        return after, PfcOutputs(applied, unlimited, *terms, float(errors[-1]), limited)

    def follow(self, state: PfcState, inputs: PfcInputs, command: float) -> PfcState:
        """Return the next state while another controller's command, m/s, moves the machine."""
        if not math.isfinite(inputs.output):
            return self._halted(state)[0]
        model, errors = self._corrected(state, inputs.output)
        return PfcState(state.origin, self.parameters.model.next(model, command), errors, command)

    def _corrected(self, state: PfcState, output: float) -> tuple[Array, Array]:
        """Return x_M(i), corrected by the observer if there is one, and the errors up to now."""
        m = self.parameters.model
        error = output - state.origin - float(m.C @ state.model)
        model = state.model if m.observer is None else state.model + m.observer * error
        errors = np.empty_like(state.errors)
        errors[:-1], errors[-1] = state.errors[1:], error
        return model, errors

    def _future(self, inputs: PfcInputs) -> list[float]:
        """Return c(i+h_j)."""
        p = self.parameters
        if p.future == "preview":
            return [inputs.ahead[h - 1] for h in p.coincidence]
        rate = inputs.set_rate * p.model.period if p.future == "velocity" else 0.0
        return [inputs.set_point + h * rate for h in p.coincidence]

    def _limited(self, wanted: float, last: float) -> float:
        p = self.parameters
        most = p.acceleration_limit * p.model.period
        near = min(max(wanted, last - most), last + most)
        return min(max(near, -p.speed_limit), p.speed_limit)

    def _halted(self, state: PfcState) -> tuple[PfcState, PfcOutputs]:
        """Return command 0 at once; the model goes on with it."""
        nan = math.nan
        after = state._replace(model=self.parameters.model.next(state.model, 0.0), command=0.0)
        return after, PfcOutputs(0.0, nan, nan, nan, nan, nan, nan, limited=False)

"""Law (11) against its transfer function."""

import numpy as np
import pytest
from scipy import signal

from emir_control.cascade import Cascade, CascadeInputs, CascadeParameters
from emir_control.trajectory import Reference

DT = 0.032
CASCADE = Cascade(CascadeParameters(gain=2.0, time_constant=0.4))


def _run(references: list[Reference], strokes: np.ndarray) -> np.ndarray:
    state = CASCADE.initial(CascadeInputs(Reference(0.0, 0.0), 0.0))
    commands = []
    for reference, stroke in zip(references, strokes, strict=True):
        state, outputs = CASCADE.step(state, CascadeInputs(reference, stroke), DT)
        commands.append(outputs.velocity_command)
    return np.array(commands)


def test_command_is_that_of_law_11_for_held_inputs() -> None:
    rng = np.random.default_rng(1)
    wanted, velocity, stroke = rng.normal(size=(3, 200))
    commands = _run([Reference(h, v) for h, v in zip(wanted, velocity, strict=True)], stroke)
    low_pass = tuple(np.array([[x]]) for x in (-1.0 / 0.4, 1.0 / 0.4, 1.0, 0.0))
    a, b, _, _, _ = signal.cont2discrete(low_pass, DT)
    smoothed, state = [], 0.0
    for h in wanted:
        state = a[0, 0] * state + b[0, 0] * h
        smoothed.append(state)
    assert commands == pytest.approx(velocity + 2.0 * (np.array(smoothed) - stroke), rel=1e-12)


def test_a_perfect_velocity_loop_follows_a_ramp_with_lag_t() -> None:
    """On a ramp of speed v the stroke stays T v behind, whatever the gain."""
    speed, stroke = 0.025, 0.0
    state = CASCADE.initial(CascadeInputs(Reference(0.0, 0.0), 0.0))
    for k in range(1000):
        wanted = Reference(speed * k * DT, speed)
        state, outputs = CASCADE.step(state, CascadeInputs(wanted, stroke), DT)
        lag = (wanted.stroke - stroke) / speed
        stroke += outputs.velocity_command * DT
    assert lag == pytest.approx(0.4, abs=DT)


def test_at_rest_on_the_reference_nothing_moves() -> None:
    state = CASCADE.initial(CascadeInputs(Reference(0.5, 0.0), 0.5))
    _, outputs = CASCADE.step(state, CascadeInputs(Reference(0.5, 0.0), 0.5), DT)
    assert outputs.velocity_command == 0.0

"""The predictive law against its definition, its limit cases and its other form."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import optimize, signal

from emir_common.quantity import ParameterError
from emir_control import pfc_file
from emir_control.internal_model import InternalModel
from emir_control.pfc import PREVIEW, Pfc, PfcInputs, PfcParameters, PfcState

DT = 0.032
JOINT = pfc_file.load(pfc_file.default_file("stroke"), "stroke")
MODEL = JOINT.model
INTEGRATOR = InternalModel(np.eye(1), np.array([DT]), np.ones(1), DT)
WIDE = {"speed_limit": 1.0, "acceleration_limit": 100.0}


def _inputs(set_point: float, output: float, rate: float = 0.0) -> PfcInputs:
    ahead = [set_point + k * DT * rate for k in range(1, PREVIEW + 1)]
    return PfcInputs(set_point, rate, ahead, output)


def _oscillator(frequency: float, damping: float) -> InternalModel:
    """A valve-to-stroke integrator behind an oscillation, sampled with a held input."""
    w = 2 * math.pi * frequency
    drift = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, -(w**2), -2 * damping * w]])
    force = np.array([[0.0], [0.0], [w**2]])
    held, moved, *_ = signal.cont2discrete((drift, force, np.eye(3), 0.0 * force), DT)
    return InternalModel(held, moved[:, 0], np.array([1.0, 0.0, 0.0]), DT)


def _closed_loop(
    law: Pfc, machine: InternalModel, set_points: np.ndarray, disturbance: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return outputs and commands of a machine from rest at 0, disturbed at its input."""
    x, state = np.zeros(machine.order), None
    outputs, commands = [], []
    for k in range(len(set_points) - PREVIEW):
        y = float(machine.C @ x)
        rate = (set_points[k + 1] - set_points[k]) / DT
        inputs = PfcInputs(set_points[k], rate, set_points[k + 1 : k + 1 + PREVIEW], y)
        state, out = law.step(state or law.initial(inputs), inputs, DT)
        x = machine.next(x, out.velocity_command + disturbance[k])
        outputs.append(y)
        commands.append(out.velocity_command)
    return np.array(outputs), np.array(commands)


@pytest.mark.parametrize("delay", [0, 1])
@pytest.mark.parametrize(("basis", "points"), [(1, (20,)), (1, (10, 15, 20)), (2, (8, 14, 20))])
def test_both_forms_give_the_same_closed_loop(
    basis: int, points: tuple[int, ...], delay: int
) -> None:
    """Paper (12) against the positional law: disturbed, with limits that act, model mismatch."""
    rng = np.random.default_rng(3)
    set_points = np.cumsum(rng.normal(size=400)) * 2e-3
    disturbance = rng.normal(size=400) * 2e-3
    given = replace(JOINT, basis=basis, coincidence=points, delay=delay, speed_limit=0.03)
    found = [
        _closed_loop(Pfc(replace(given, form=form)), _oscillator(0.6, 0.3), set_points, disturbance)
        for form in ("positional", "incremental")
    ]
    assert np.max(np.abs(found[0][1])) == 0.03  # the limit did act
    for one, other in zip(*found, strict=True):
        assert one == pytest.approx(other, abs=1e-9)


@pytest.mark.parametrize("delay", [0, 1])
@pytest.mark.parametrize(("basis", "points"), [(1, (20,)), (1, (8, 20)), (2, (6, 13, 20))])
def test_command_is_the_first_of_the_best_fitting_sequence(
    basis: int, points: tuple[int, ...], delay: int
) -> None:
    """The definition itself: simulate the model ahead, let an optimizer choose mu."""
    law = Pfc(replace(JOINT, coincidence=points, basis=basis, delay=delay, **WIDE))
    rng = np.random.default_rng(5)
    x, errors, last = 1e-2 * rng.normal(size=6), 1e-3 * rng.normal(size=32), 0.01
    ahead = 0.3 + 0.01 * rng.normal(size=PREVIEW)
    output = 0.3 + float(MODEL.C @ x) + errors[-1]
    inputs = PfcInputs(0.31, 0.0, ahead, output)
    state = PfcState(0.3, x, np.append(0.0, errors[:-1]), last)
    after, outputs = law.step(state, inputs, DT)

    line = np.polynomial.Polynomial.fit(np.arange(-31, 1), errors, 1)
    decay = math.exp(-3.0 * DT / JOINT.response_time)

    def miss(mu: np.ndarray) -> np.ndarray:
        state, miss = x, []
        for k in range(max(points)):
            command = last if k < delay else sum(m * (k - delay) ** i for i, m in enumerate(mu))
            state = MODEL.A @ state + MODEL.B * command
            if k + 1 in points:
                wanted = ahead[k] - decay ** (k + 1) * (0.31 - output)
                miss.append(0.3 + MODEL.C @ state + line(k + 1) - wanted)
        return np.array(miss)

    best = optimize.least_squares(miss, np.zeros(basis), x_scale=1e-2, xtol=1e-15, gtol=1e-15)
    assert after.command == pytest.approx(best.x[0], rel=1e-6)
    assert outputs.velocity_command == (last if delay else after.command)


def test_an_error_has_fallen_to_5_percent_after_the_response_time() -> None:
    """A pure integrator follows the reference trajectory; one point of coincidence, h = 1."""
    given = PfcParameters(
        model=INTEGRATOR, coincidence=(1,), response_time=100 * DT, future="constant", **WIDE
    )
    set_points = np.where(np.arange(121 + PREVIEW) < 1, 0.0, 0.01)
    outputs, _ = _closed_loop(Pfc(given), INTEGRATOR, set_points, np.zeros(200))
    assert 1.0 - outputs[101] / 0.01 == pytest.approx(math.exp(-3.0), rel=1e-9)


@pytest.mark.parametrize("future", ["preview", "velocity"])
def test_a_ramp_is_followed_without_lag(future: str) -> None:
    law = Pfc(replace(JOINT, future=future))
    ramp = 0.01 * DT * np.arange(800 + PREVIEW)
    outputs, _ = _closed_loop(law, MODEL, ramp, np.zeros(800))
    assert outputs[-1] == pytest.approx(ramp[799], abs=1e-7)


def test_a_constant_set_point_ahead_lags_on_a_ramp() -> None:
    law = Pfc(replace(JOINT, future="constant"))
    ramp = 0.01 * DT * np.arange(800 + PREVIEW)
    outputs, _ = _closed_loop(law, MODEL, ramp, np.zeros(800))
    assert (ramp[799] - outputs[-1]) / 0.01 > 0.5  # s


def test_a_slope_in_the_errors_extrapolation_removes_the_offset_of_a_leak() -> None:
    """A constant velocity disturbance: the independent model drifts away from the machine."""
    for degree, least, most in ((0, 1e-3, 1.0), (1, 0.0, 1e-6)):
        law = Pfc(replace(JOINT, error_degree=degree))
        outputs, _ = _closed_loop(law, MODEL, np.zeros(2000 + PREVIEW), np.full(2000, 2e-3))
        assert least <= abs(outputs[-1]) <= most


def test_computing_delay_shifts_the_command_by_one_sample() -> None:
    law = Pfc(replace(JOINT, delay=1))
    state = law.initial(_inputs(0.0, 0.0))
    state, first = law.step(state, _inputs(0.01, 0.0), DT)
    _, second = law.step(state, _inputs(0.0, 0.0), DT)
    assert first.velocity_command == 0.0
    assert second.velocity_command == state.command > 0.0


def test_limits_hold_and_the_model_gets_the_limited_command() -> None:
    """After a long time at the limit nothing is wound up: the stop is reached without overshoot."""
    law = Pfc(replace(JOINT, speed_limit=0.01, acceleration_limit=0.1))
    outputs, commands = _closed_loop(law, MODEL, np.full(1500, 0.1), np.zeros(1500))
    assert np.max(np.abs(commands)) == 0.01
    assert np.max(np.abs(np.diff(commands))) <= 0.1 * DT * (1 + 1e-12)
    assert np.sum(commands > 0.0099) > 200
    assert np.max(outputs) < 0.1 * 1.001
    assert outputs[-1] == pytest.approx(0.1, rel=1e-3)


@pytest.mark.parametrize("field", ["set_point", "output", "ahead"])
def test_an_input_that_is_no_number_stops_the_machine_at_once(field: str) -> None:
    law = Pfc(JOINT)
    state = law.initial(_inputs(0.1, 0.1, 0.02), command=0.02)
    bad = _inputs(0.1, 0.1)._replace(**{field: [math.nan] * 20 if field == "ahead" else math.nan})
    state, outputs = law.step(state, bad, DT)
    assert outputs.velocity_command == 0.0
    state, outputs = law.step(state, _inputs(0.1, 0.1), DT)
    assert math.isfinite(outputs.velocity_command)


def test_taking_over_a_steady_motion_is_bumpless() -> None:
    """Machine and reference move alike at a constant command: the first command is that one."""
    law, command = Pfc(JOINT), 0.02
    speed = command * float(MODEL.B[0]) / DT  # the integrator's gain
    inputs = _inputs(0.3, 0.3, speed)
    _, outputs = law.step(law.initial(inputs, command), inputs, DT)
    assert outputs.velocity_command == pytest.approx(command, rel=1e-6)


def test_a_controller_that_only_follows_is_ready_when_it_takes_over() -> None:
    """It watches another one move the machine; switched in, it does what it would have done."""
    active, ready = Pfc(JOINT), Pfc(JOINT)
    x = np.zeros(6)
    start = _inputs(0.0, 0.0)
    moving, waiting = active.initial(start), ready.initial(start)
    for k in range(80):
        inputs = _inputs(0.02 * DT * k, float(MODEL.C @ x), 0.02)
        moving, outputs = active.step(moving, inputs, DT)
        if k < 79:
            waiting = ready.follow(waiting, inputs, outputs.velocity_command)
        x = MODEL.next(x, outputs.velocity_command)
    _, taken_over = ready.step(waiting, inputs, DT)
    assert taken_over == outputs


def test_a_state_begun_without_a_measurement_begins_anew_with_the_first() -> None:
    law = Pfc(JOINT)
    state = law.initial(_inputs(0.1, math.nan))
    for output in (math.nan, 0.1, 0.1):
        state, outputs = law.step(state, _inputs(0.1, output), DT)
        assert outputs.velocity_command == pytest.approx(0.0, abs=1e-12)
    assert math.isfinite(outputs.unlimited)


def test_steady_state_of_the_model_moves_evenly() -> None:
    x = MODEL.steady_state
    strokes = []
    for _ in range(50):
        strokes.append(float(MODEL.C @ x))
        x = MODEL.next(x, 1.0)
    assert np.diff(strokes) == pytest.approx(MODEL.B[0], rel=1e-6)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"coincidence": ()}, "fewer than basis"),
        ({"coincidence": (0, 5)}, "rising numbers from 1 to 20"),
        ({"coincidence": (21,)}, "rising numbers from 1 to 20"),
        ({"coincidence": (9, 9)}, "rising numbers"),
        ({"coincidence": (1,), "delay": 1}, "rising numbers from 2 to 20"),
        ({"basis": 2}, "fewer than basis = 2"),
        ({"error_window": 1}, "has to exceed error_degree = 1"),
        ({"form": "magic"}, "form = 'magic': there are positional, incremental"),
        ({"response_time": -1.0}, "response_time = -1"),
    ],
)
def test_parameters_that_make_no_sense_are_refused(change: dict[str, object], said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        replace(JOINT, **change)


def test_coincidence_points_at_which_the_model_is_silent_are_refused() -> None:
    deaf = InternalModel(np.eye(1), np.zeros(1), np.ones(1), DT)
    with pytest.raises(ParameterError, match="responds too little"):
        Pfc(PfcParameters(model=deaf))


def test_another_period_than_the_models_is_refused() -> None:
    law = Pfc(JOINT)
    with pytest.raises(ValueError, match=r"dt = 0\.01 s: the model's period is 0\.032 s"):
        law.step(law.initial(_inputs(0.0, 0.0)), _inputs(0.0, 0.0), 0.01)

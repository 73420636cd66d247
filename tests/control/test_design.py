"""Reduction, observer and stability against python-control and against simulation."""

import math
from dataclasses import replace
from pathlib import Path

import control
import numpy as np
import pytest
from scipy import linalg

from emir_common.quantity import ParameterError
from emir_control import design, pfc_file
from emir_control.force_loop import ForceLoopParameters
from emir_control.internal_model import InternalModel
from emir_control.pfc import PREVIEW, Pfc, PfcInputs, PfcParameters, PfcState

DT = 0.032
JOINT = pfc_file.load(pfc_file.default_file("stroke"), "stroke")
FAST = (40.0, 55.0, 62.0, 75.0, 88.0)  # rad/s


def _crane(frequency: float, damping: float) -> InternalModel:
    """An integrator, one slow oscillation and five fast ones of little weight."""
    modes = [(2 * math.pi * frequency, damping, 1.0)]
    modes += [(w, 0.02, 1e-3 * sign) for w, sign in zip(FAST, (1, -1, 1, -1, 1), strict=True)]
    system = sum(
        control.ss([[0.0, w], [-w, -2 * zeta * w]], [[0.0], [weight * w]], [[1.0, 0.0]], 0.0)
        for w, zeta, weight in modes
    )
    sampled = control.sample_system(system * control.ss(0.0, 1.0, 1.0, 0.0), DT)
    return InternalModel(sampled.A, sampled.B[:, 0], sampled.C[0], DT)


def _response(model: InternalModel, omega: np.ndarray) -> np.ndarray:
    system = control.ss(model.A, model.B[:, None], model.C[None, :], 0.0, DT)
    return np.asarray(system(np.exp(1j * omega * DT))).ravel()


def test_reduced_model_keeps_the_integrator_and_the_slow_mode() -> None:
    full = _crane(0.7, 0.2)
    small = design.reduced(full, 4)
    omega = np.geomspace(0.05, 20.0, 60)
    exact = _response(full, omega)
    assert small.order == 4
    assert np.max(abs(_response(small, omega) - exact) / abs(exact)) < 0.03
    assert min(abs(np.linalg.eigvals(small.A) - 1.0)) < 1e-12


def test_reduction_to_full_order_changes_nothing() -> None:
    full = _crane(0.7, 0.2)
    omega = np.geomspace(0.05, 90.0, 60)
    assert _response(design.reduced(full, full.order), omega) == pytest.approx(
        _response(full, omega), rel=1e-6
    )


def test_truncation_error_is_within_its_bound() -> None:
    """At most twice the sum of the Hankel singular values left out (Glover 1984)."""
    full = _crane(0.7, 0.2)
    rest, _ = design._split(full)
    stable = InternalModel(*rest, DT)
    from scipy.linalg import eigvals, solve_discrete_lyapunov

    reach = solve_discrete_lyapunov(stable.A, np.outer(stable.B, stable.B))
    observe = solve_discrete_lyapunov(stable.A.T, np.outer(stable.C, stable.C))
    hankel = np.sort(np.sqrt(abs(eigvals(reach @ observe))))[::-1]
    omega = np.linspace(1e-3, math.pi / DT, 4000)
    for kept in (2, 4, 6):
        small = design.reduced(full, kept + 1)
        worst = np.max(abs(_response(small, omega) - _response(full, omega)))
        assert worst <= 2.0 * hankel[kept:].sum() * (1 + 1e-6)


@pytest.mark.parametrize("order", [1, 14])
def test_an_order_that_the_model_does_not_allow_is_refused(order: int) -> None:
    with pytest.raises(ParameterError, match=f"order = {order}: the model allows 2 ... 13"):
        design.reduced(_crane(0.7, 0.2), order)


def test_models_without_integrator_or_stability_are_refused() -> None:
    resting = InternalModel(np.diag([0.9, 0.5]), np.ones(2), np.ones(2), DT)
    with pytest.raises(ParameterError, match="no integrator"):
        design.reduced(resting, 2)
    growing = InternalModel(np.diag([1.0, 1.1]), np.ones(2), np.ones(2), DT)
    with pytest.raises(ParameterError, match="unstable beside its integrator"):
        design.reduced(growing, 2)


def test_observer_gain_is_the_kalman_filters() -> None:
    model, noise = design.reduced(_crane(0.7, 0.2), 4), design.Noise(1e-3, 3e-4)
    found = design.with_observer(model, noise)
    drive = np.zeros((5, 2))
    drive[:4, 0], drive[4, 1] = model.B, 1.0
    gain, _, _ = control.dlqe(
        found.A, drive, found.C[None, :], noise.disturbance**2 * np.eye(2), [[noise.output**2]]
    )
    assert found.observer is not None
    assert found.A @ found.observer == pytest.approx(gain[:, 0], rel=1e-8)


def test_force_loop_in_the_model_is_the_force_loop() -> None:
    """Against the object itself, on a machine whose force follows the valve directly."""
    from emir_control.force_loop import ForceLoop, ForceLoopInputs
    from emir_control.prefilter import PrefilterParameters

    prefilter = PrefilterParameters(standstill=0.0, dead_zone=0.0)
    parameters = ForceLoopParameters(gain=1e-7, prefilter=prefilter)
    loop, area = ForceLoop(parameters), prefilter.area_lifting
    slope = area / prefilter.flow_lifting
    valve = InternalModel(
        np.array([[1.0, DT], [0.0, 0.7]]), np.array([0.0, 0.02]), np.array([1.0, 0.0]), DT
    )
    force = np.array([0.0, 2e5])  # N per unit of the second state
    model = design.with_force_loop(valve, force, slope, parameters)
    x, z = np.zeros(2), np.zeros(3)
    state = loop.initial(ForceLoopInputs(0.0, 0.0, 0.0, 0.0, 0.0))
    for _ in range(100):
        sensed = ForceLoopInputs(0.01, 0.0, 0.0, float(force @ x) / area, 0.0)
        state, out = loop.step(state, sensed, DT)
        assert 0.0 < out.valve_command < 1.0
        x, z = valve.next(x, out.valve_command), model.next(z, 0.01)
        assert model.C @ z == pytest.approx(valve.C @ x, rel=1e-9, abs=1e-15)


@pytest.mark.parametrize("observer", [0.0, 1e-3])
@pytest.mark.parametrize("frequency", [0.35, 0.5, 0.7, 0.9])
def test_spectral_radius_tells_how_fast_a_simulation_settles_or_grows(
    frequency: float, observer: float
) -> None:
    model = design.reduced(_crane(0.7, 0.1), 4)
    if observer:
        model = design.with_observer(model, design.Noise(observer, 3e-4))
    law = Pfc(PfcParameters(model=model, speed_limit=1.0, acceleration_limit=100.0))
    machine = _crane(frequency, 0.1)
    x = 1e-9 * np.random.default_rng(2).normal(size=machine.order)
    state = law.initial(PfcInputs(0.0, 0.0, [0.0] * PREVIEW, 0.0))
    for _ in range(5):
        commands = []
        for _ in range(300):
            inputs = PfcInputs(0.0, 0.0, [0.0] * PREVIEW, float(machine.C @ x))
            state, out = law.step(state, inputs, DT)
            x = machine.next(x, out.velocity_command)
            commands.append(abs(out.velocity_command))
        growth = (max(commands[200:]) / max(commands[:100])) ** (1 / 200)
        scale = 1e-9 / max(commands[200:])  # stay between rounding and the limits
        x = x * scale
        state = PfcState(0.0, state.model * scale, state.errors * scale, state.command * scale)
    assert growth == pytest.approx(design.spectral_radius(law, machine), abs=2e-3)


def test_a_design_survives_its_file(tmp_path: Path) -> None:
    observed = design.with_observer(JOINT.model, design.Noise(1e-4, 3e-4))
    given = replace(JOINT, model=observed, coincidence=(10, 20), basis=2, future="velocity")
    pfc_file.save(tmp_path / "pfc.yaml", given, "stroke", {"why": "a test"})
    back = pfc_file.load(tmp_path / "pfc.yaml", "stroke")
    assert replace(back, model=given.model) == given
    for name in ("A", "B", "C", "observer"):
        assert np.array_equal(getattr(back.model, name), getattr(observed, name))


MODEL = "tuning: {coincidence: [20]}\nmodel: {output: stroke, period: 0.032"

BAD = {
    "no file": (None, "No such file"),
    "not YAML": ("a: [", "not YAML"),
    "empty": ("", "no design in it"),
    "no tuning": ("model: {}", "tuning: missing"),
    "unknown": ("tuning: {magic: 1}", "tuning: magic: there is no such entry"),
    "text": ("tuning: {response_time: fast}", "response_time = 'fast': not a number"),
    "points": ("tuning: {coincidence: 20}", "coincidence = 20: not a list"),
    "output": (
        "tuning: {coincidence: [20]}\nmodel: {output: tip_angle}",
        "made for tip_angle, wanted is one for stroke",
    ),
    "array": (
        f"{MODEL}, A: [[1.0], [2.0, 3]]}}",
        "model: A: not an array of numbers",
    ),
    "missing": ("tuning: {coincidence: [20]}\nmodel: {output: stroke}", "model: A: missing"),
    "shape": (
        f"{MODEL}, A: [[1.0]], B: [1.0, 2.0], C: [1.0]}}",
        r"model: B is \(2,\), expected \(1,\)",
    ),
    "nan": (
        f"{MODEL}, A: [[1.0]], B: [.nan], C: [1.0]}}",
        "model: B holds a number that is not finite",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_file_is_one_clear_line(case: str, tmp_path: Path) -> None:
    content, said = BAD[case]
    file = tmp_path / "design.yaml"
    if content is not None:
        file.write_text(content)
    with pytest.raises(ParameterError, match=said) as caught:
        pfc_file.load(file, "stroke")
    assert str(caught.value).startswith(f"{file}: ")
    assert "\n" not in str(caught.value)


def test_badly_scaled_model_with_poles_all_but_alike_is_reduced_without_loss() -> None:
    """As an identified one of too high an order: a companion form, three poles at 0.98."""
    poles = np.poly([1.0, 0.98, 0.98, 0.98 - 1e-7, 0.94 + 0.2j, 0.94 - 0.2j]).real
    zeros = np.array([1e-3, 0.0, 0.0, 0.0, 0.0, 0.0])
    model = InternalModel(linalg.companion(poles), np.eye(6)[0], zeros, 0.032)
    found = design.reduced(model, 6)
    for steps in (1, 20, 100):
        assert found.held_response(steps) == pytest.approx(model.held_response(steps), rel=1e-3)

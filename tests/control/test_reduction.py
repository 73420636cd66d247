"""Order reduction against python-control, the theorem on balanced models, and known modes."""

from collections.abc import Callable

import control
import numpy as np
import pytest
from scipy import linalg

from emir_common.quantity import ParameterError
from emir_control import reduction
from emir_control.reduction import Linear

FREQUENCIES = np.geomspace(1e-3, 1e3, 400)  # rad/s


def _model(seed: int, modes: int = 5) -> Linear:
    """An integrator, a drift that grows slowly, a lag and some oscillations, well mixed."""
    random = np.random.default_rng(seed)
    blocks = [np.zeros((1, 1)), np.array([[0.01]]), np.array([[-3.0]])]
    turning = np.array([[-0.02, 1.0], [-1.0, -0.02]])
    blocks += [w * turning for w in 4.0 * 3.0 ** np.arange(modes)]
    plain = linalg.block_diag(*blocks)
    n = len(plain)
    mix = random.normal(size=(n, n)) + 3.0 * np.eye(n)
    weight = np.concatenate(([1.0, 1.0, 1.0], np.repeat(0.5 ** np.arange(modes), 2)))
    inputs, outputs = weight[:, None] * random.normal(size=(n, 1)), random.normal(size=(2, n))
    back = linalg.inv(mix)
    return Linear(mix @ plain @ back, mix @ inputs, outputs @ back, np.zeros((2, 1)))


def _answer(m: Linear) -> np.ndarray:
    return control.StateSpace(m.A, m.B, m.C, m.D)(1j * FREQUENCIES, squeeze=False)[:, 0, :]


@pytest.mark.parametrize("reduce", [reduction.balanced, reduction.modal])
def test_nothing_is_lost_at_full_order(reduce: Callable[[Linear, int], Linear]) -> None:
    full = _model(1)
    whole = reduce(full, full.order)
    assert _answer(whole) == pytest.approx(_answer(full), rel=1e-6)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("order", [4, 6, 7, 8])
def test_balanced_model_keeps_to_the_bound_of_its_theorem(seed: int, order: int) -> None:
    """|G - G_r| <= 2 (sum of the Hankel singular values left out), Glover 1984, Enns 1984."""
    full = _model(seed)
    less = reduction.balanced(full, order)
    assert less.order == order
    values = reduction.hankel(full)
    left_out = values[order - (full.order - values.size) :]  # beside the slow modes, which stay
    off = np.linalg.norm(_answer(less) - _answer(full), axis=0)
    assert off.max() <= 2.0 * left_out.sum() * (1.0 + 1e-6)
    assert off[0] < 1e-3 * off.max()  # the static gain is kept


@pytest.mark.parametrize("seed", range(4))
def test_modal_model_has_modes_of_the_full_one_and_its_static_gain(seed: int) -> None:
    full = _model(seed)
    less = reduction.modal(full, 8)
    poles = np.linalg.eigvals(full.A)
    assert all(abs(poles - p).min() < 1e-6 * (1.0 + abs(p)) for p in np.linalg.eigvals(less.A))
    off = np.linalg.norm(_answer(less) - _answer(full), axis=0)
    assert off[0] < 1e-3 * off.max()


def test_slow_modes_stay() -> None:
    full = _model(2)
    assert full.order - reduction.hankel(full).size == 2  # integrator and drift
    for reduce in (reduction.balanced, reduction.modal):
        poles = np.sort(np.linalg.eigvals(reduce(full, 5).A).real)[::-1]
        assert poles[:2] == pytest.approx([0.01, 0.0], abs=1e-8)
        assert poles[2] < -0.02


def test_hankel_values_are_the_eigenvalues_of_both_gramians() -> None:
    full = _model(3)
    shifted = full.A - 0.1 * np.eye(full.order)  # stable
    reach = control.lyap(shifted, full.B @ full.B.T)
    observe = control.lyap(shifted.T, full.C.T @ full.C)
    theirs = np.sort(np.sqrt(abs(np.linalg.eigvals(reach @ observe))))[::-1]
    ours = reduction.hankel(Linear(shifted, full.B, full.C, full.D))
    assert ours == pytest.approx(theirs, rel=1e-5, abs=1e-9)


@pytest.mark.parametrize("order", [0, 2, 14])
def test_an_order_that_cannot_be_is_told(order: int) -> None:
    for reduce in (reduction.balanced, reduction.modal):
        with pytest.raises(ParameterError, match=rf"order = {order}: the model allows 3 \.\.\. 13"):
            reduce(_model(1), order)

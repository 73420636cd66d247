"""Input shaping against its own promise: a lightly damped swing is left at rest."""

import math

import numpy as np
import pytest
from scipy.signal import lsim

from emir_common.quantity import ParameterError
from emir_control.shaping import impulses, shaped
from emir_control.trajectory import Move, Trapezoid

MOVE = Move(0.0, 3.3, -0.06)
STEP = 1e-3


def _left_swinging(velocity: np.ndarray, hertz: float, damping: float) -> float:
    """Largest swing after the move of a mode driven by the acceleration."""
    w = 2.0 * math.pi * hertz
    system = ([[0.0, 1.0], [-w * w, -2.0 * damping * w]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]])
    time = STEP * np.arange(velocity.size)
    _, swing, _ = lsim(system, np.gradient(velocity, STEP), time)
    return float(abs(swing[round(MOVE.duration / STEP) + 10 :]).max())


def _velocity(move: object) -> np.ndarray:
    times = STEP * np.arange(6000)
    return np.array([move.at(float(t)).velocity for t in times])  # type: ignore[attr-defined]


@pytest.mark.parametrize("damping", [0.0, 0.05])
@pytest.mark.parametrize("hertz", [0.55, 1.0])
@pytest.mark.parametrize("shaper", ["zv", "zvd"])
def test_shaped_move_leaves_the_mode_at_rest(shaper: str, hertz: float, damping: float) -> None:
    plain = _velocity(Trapezoid(MOVE.distance, 0.06 / 2.55, 0.75))
    ours = _velocity(shaped(MOVE, impulses(shaper, hertz, damping)))  # type: ignore[arg-type]
    assert _left_swinging(ours, hertz, damping) < 0.05 * _left_swinging(plain, hertz, damping)


def test_zvd_forgives_a_wrong_frequency_more_than_zv() -> None:
    left = {
        shaper: _left_swinging(_velocity(shaped(MOVE, impulses(shaper, 1.0, 0.0))), 1.1, 0.0)
        for shaper in ("zv", "zvd")
    }
    assert left["zvd"] < 0.5 * left["zv"]


def test_shaped_move_takes_its_time_and_goes_all_the_way() -> None:
    move = shaped(MOVE, impulses("zvd", 0.9, 0.01))
    assert move.at(MOVE.duration).stroke == pytest.approx(MOVE.distance)
    assert move.at(MOVE.duration).velocity == pytest.approx(0.0, abs=1e-12)
    assert abs(move.at(MOVE.duration - 0.05).velocity) > 0.0
    assert move.at(0.0).stroke == 0.0


def test_what_cannot_be_shaped() -> None:
    with pytest.raises(ParameterError, match="does not fit"):
        shaped(Move(0.0, 0.5, 0.01), impulses("zvd", 0.9, 0.0))
    with pytest.raises(ParameterError, match="there are zv, zvd"):
        impulses("none", 1.0, 0.0)  # type: ignore[arg-type]

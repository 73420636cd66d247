"""A load that comes or goes: what a change of the machine in mid-run keeps."""

from pathlib import Path

import numpy as np
import pytest

from emir_analysis.cli import main
from emir_analysis.disturbance import push, reloaded
from emir_common.parameter_tree import with_values
from emir_plant import core
from emir_plant.boom import boom_modes
from emir_plant.core import Array
from emir_plant.plant import Plant
from emir_plant.sheet import joint1

LOAD = 500.0


def _moving(payload: float) -> tuple[Plant, Array]:
    plant = Plant(with_values(joint1(), {"geometry.payload": payload}))
    state, _ = plant.step(plant.initial(0.8, 2e6), 0.6, 1.2)
    return plant, state


def _of_modes_left_out(plant: Plant, angle: float) -> float:
    """Their static share of the deflection, m, which follows the load at once."""
    return float(plant.record[0]["residual_sag"] * np.cos(angle))


def _tip_velocity(plant: Plant, state: Array) -> float:
    p = plant.record[0]
    m = p["mode_tip"].size
    return float(p["mode_tip"] @ state[core.MODES + m : core.MODES + 2 * m])


def _momentum(plant: Plant, state: Array) -> float:
    """About the joint, of boom and load, N m s: generalised momentum of a rigid turn."""
    p, modes = plant.record[0], boom_modes(plant.machine.geometry)
    m = p["mode_tip"].size
    rate = state[core.MODES + m : core.MODES + 2 * m]
    return float(rate[0] / modes.joint[0])


@pytest.mark.parametrize(("before", "after"), [(LOAD, 0.0), (0.0, LOAD)])
def test_nothing_that_cannot_jump_jumps(before: float, after: float) -> None:
    plant, state = _moving(before)
    other, changed = reloaded(plant, state, after)
    assert other.machine.geometry.payload == after
    shown, now = plant.outputs(state), other.outputs(changed)
    assert now.angle == pytest.approx(shown.angle, abs=1e-12)
    assert now.stroke == pytest.approx(shown.stroke, abs=1e-12)
    bent = shown.tcp_deflection - _of_modes_left_out(plant, shown.angle)
    bent_now = now.tcp_deflection - _of_modes_left_out(other, now.angle)
    assert bent_now == pytest.approx(bent, rel=0.02)
    assert np.array_equal(changed[: core.MODES], state[: core.MODES])


def test_a_load_that_goes_leaves_the_boom_its_motion() -> None:
    plant, state = _moving(LOAD)
    other, changed = reloaded(plant, state, 0.0)
    assert _tip_velocity(other, changed) == pytest.approx(_tip_velocity(plant, state), rel=0.02)


def test_a_load_that_comes_shares_the_booms_momentum() -> None:
    plant, state = _moving(0.0)
    other, changed = reloaded(plant, state, LOAD)
    assert _momentum(other, changed) == pytest.approx(_momentum(plant, state), rel=1e-6)
    assert abs(_tip_velocity(other, changed)) < abs(_tip_velocity(plant, state))


def test_the_same_load_changes_nothing() -> None:
    plant, state = _moving(LOAD)
    _, changed = reloaded(plant, state, LOAD)
    assert changed == pytest.approx(state, rel=1e-9, abs=1e-12)


def test_push_is_the_force_at_the_tip() -> None:
    pushed = push(joint1(), -3e3, 1.0, 0.2).effects.external_load
    assert (pushed.force, pushed.start, pushed.duration) == (-3e3, 1.0, 0.2)


def test_disturb_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    image = tmp_path / "d.png"
    assert main(["disturb", "--controllers", "cascade", "--picture", str(image)]) == 0
    assert capsys.readouterr().out.count("| cascade |") == 6
    assert image.read_bytes().startswith(b"\x89PNG")
    assert main(["disturb", "--controllers", "magic"]) == 1
    assert "controller 'magic'" in capsys.readouterr().err

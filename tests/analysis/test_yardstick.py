"""The yardstick: what it measures, and what it shows of the controllers."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from emir_analysis.cli import main
from emir_analysis.limit import PAPER_MOVE, Move, least
from emir_analysis.machine_model import actuator, boom, boom_table
from emir_analysis.yardstick import (
    EVERYDAY,
    HARD,
    Draw,
    controllers,
    draws,
    run,
    score,
    tcp_error,
)
from emir_common.parameter_tree import with_values
from emir_control.actuator import Actuator, Oil
from emir_plant import core
from emir_plant.plant import Plant
from emir_plant.sheet import joint1

MOVE = Move(math.radians(45.0), PAPER_MOVE.distance, PAPER_MOVE.duration)


@pytest.mark.parametrize(("payload", "cm"), [(0.0, 1.5), (1500.0, 3.2)])
def test_limit_of_the_papers_move(payload: float, cm: float) -> None:
    """As an independent study of joint 1 found it."""
    found = least(with_values(joint1(), {"geometry.payload": payload}), MOVE)
    assert found.largest * 100.0 == pytest.approx(cm, rel=0.06)


def test_sag_by_the_boom_of_the_controllers_is_the_machines() -> None:
    """The static bending at rest, from the plant's own state."""
    for payload in (0.0, 600.0):
        machine = with_values(joint1(), {"geometry.payload": payload})
        plant = Plant(machine)
        table = boom_table(joint1()).loaded(payload)
        state = plant.initial(0.5)
        shown = plant.outputs(state)
        bending = float((table.tip_angle - table.joint) @ table.sag()) * math.cos(0.5)
        assert shown.tip_angle - shown.angle == pytest.approx(bending, rel=3e-3)
        assert table.deflection == pytest.approx(boom(machine).deflection, rel=0.05)


def test_payload_is_read_from_the_torque_that_holds_the_boom() -> None:
    table = boom_table(joint1())
    arm = joint1().geometry.boom_length
    empty = boom(joint1()).holding_torque
    assert table.payload(empty + 700.0 * 9.81 * arm) == pytest.approx(700.0, rel=1e-3)
    assert table.payload(0.0) == 0.0


@pytest.mark.parametrize("opening", [-0.6, -0.05, 0.05, 0.6])
def test_drive_of_the_controllers_is_the_machines(opening: float) -> None:
    """dF/dt of the plant standing still, against k_h u."""
    machine = joint1()
    plant, drive = Plant(machine), Actuator(actuator(machine))
    state = plant.initial(0.7, 30e5)
    state[core.SPOOL], state[core.LOGIC] = drive.command(opening), 1.0
    shown = plant.outputs(state)
    rates = plant.derivative(state, 0.0)
    pushed = drive.force(rates[core.P_H], rates[core.P_S])
    oil = Oil(shown.stroke, shown.pressure_lifting, shown.pressure_lowering)
    wanted = drive.stiffness(shown.stroke) * drive.velocity(opening, oil)
    assert pushed == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize("opening", [-0.4, 0.4])
def test_pressures_ahead_are_the_machines(opening: float) -> None:
    """A control period of the plant with its valve held open, by its own velocity."""
    machine = joint1()
    plant, drive = Plant(machine), Actuator(actuator(machine))
    state, command = plant.initial(0.7, 30e5), drive.command(opening)
    state[core.SPOOL], state[core.LOGIC] = command, 1.0
    before = plant.outputs(state)
    oil = Oil(before.stroke, before.pressure_lifting, before.pressure_lowering)
    for _ in range(4):
        state, after = plant.step(state, command, 0.008)
        velocity = (after.stroke - oil.stroke) / 0.008
        oil = drive.ahead(oil, opening, velocity, 0.008)
    changed = after.pressure_lifting - before.pressure_lifting
    assert oil.lifting - before.pressure_lifting == pytest.approx(changed, rel=0.03)
    changed = after.pressure_lowering - before.pressure_lowering
    assert oil.lowering - before.pressure_lowering == pytest.approx(changed, rel=0.03)


def test_draws_are_repeatable_and_within_their_ranges() -> None:
    first, again = (list(draws(joint1(), 5, 3)) for _ in range(2))
    assert first == again
    assert first != list(draws(joint1(), 5, 4))
    for draw in draws(joint1(), 30, 0, HARD):
        m = draw.machine
        assert m.geometry.payload == 0.0
        assert HARD.angle[0] <= draw.angle <= HARD.angle[1]
        assert abs(m.cylinder.beta / joint1().cylinder.beta - 1.0) <= 0.2
        assert m.effects.command_delay.delay == 0.032
        assert draw.stroke < 0.0


def test_error_of_the_tcp_where_the_boom_stands() -> None:
    """Half a resolver step at most and the noise, while nothing has moved."""
    draw = next(draws(joint1(), 1, 0))
    signals = run(draw, controllers(joint1())["lqg"])
    waiting = tcp_error(draw.machine, signals)[:20]
    sensors, length = draw.machine.sensors, draw.machine.geometry.boom_length
    half = 0.5 * sensors.resolver_span / 2**sensors.resolver_bits
    assert abs(waiting).max() <= half * length * 1.01
    assert np.ptp(waiting) < 1e-3


def test_lqg_meets_the_aim_where_others_do_not() -> None:
    """Softest oil, full friction, lifting and lowering: the corner that limits it."""
    loops = controllers(joint1())
    values = {
        "geometry.payload": 700.0,
        "cylinder.beta": 0.8 * joint1().cylinder.beta,
        "effects.coulomb_friction.force": 5e3,
        "effects.valve_hysteresis.width": EVERYDAY.hysteresis,
        "effects.command_delay.delay": EVERYDAY.delay,
        "supply.p0": EVERYDAY.supply,
    }
    machine = with_values(joint1(), values)
    limit = least(machine, MOVE).largest
    for stroke in (PAPER_MOVE.distance, -PAPER_MOVE.distance):
        draw = Draw(machine, MOVE.angle, stroke)
        ours = score(draw, loops["lqg"], limit)
        assert ours.ratio < 1.3
        assert ours.settled < 5e-3
        assert ours.position < 45e-3
        assert ours.taken < PAPER_MOVE.duration
        assert score(draw, loops["cascade"], limit).ratio > 1.3 * ours.ratio


def test_limit_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    image = tmp_path / "limit.png"
    assert main(["limit", "--duration", "1.5", "--picture", str(image)]) == 0
    assert "by less than" in capsys.readouterr().out
    assert image.read_bytes().startswith(b"\x89PNG")
    for words, said in (
        (["--stroke", "0"], "one of 0.2 ... 20 s that goes somewhere"),
        (["--duration", "nan"], "0.06375 m in nan s: wanted is one of 0.2 ... 20 s"),
        (["--duration", "120"], "0.06375 m in 120 s: wanted is one of 0.2 ... 20 s"),
        (["--stroke", "500", "--duration", "1"], "no motion turns the joint"),
        (["--stroke", "9000"], "the triangle of joint 1 ends before"),
        (["--payload", "-3"], "geometry.payload = -3"),
        (["--angle", "400"], "angle = 400 deg: outside the linkage's reach, -40.0 ... 140.0 deg"),
    ):
        assert main(["limit", *words]) == 1
        assert said in capsys.readouterr().err


def test_yardstick_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    image, numbers = tmp_path / "y.png", tmp_path / "y.json"
    words = ["--draws", "2", "--seed", "5", "--json", str(numbers), "--picture", str(image)]
    assert main(["yardstick", "--controllers", "cascade", "pfc", *words]) == 0
    shown = capsys.readouterr()
    assert "| cascade |" in shown.out
    assert "draw 2 of 2" in shown.err
    assert image.read_bytes().startswith(b"\x89PNG")
    content = json.loads(numbers.read_text())
    assert len(content["draws"]) == 2
    assert content["draws"][0]["scores"]["cascade"]["ratio"] > 1.0
    assert main(["yardstick", "--draws", "0"]) == 1
    assert "draws = 0: at least 1" in capsys.readouterr().err
    assert main(["yardstick", "--seed", "-1"]) == 1
    assert "seed = -1: 0 or more" in capsys.readouterr().err

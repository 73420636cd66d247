"""The comparison's figures on signals whose figures are known, and what it shows of the paper."""

import csv
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from emir_analysis import damping, trade_off
from emir_analysis.cli import main
from emir_analysis.compare import MoveFigures, controllers, figures, run
from emir_analysis.damping import damping_figures
from emir_analysis.design_pfc import OperatingPoint
from emir_analysis.margin import gain_margin, linear_machine
from emir_analysis.node_controls import PfcControl
from emir_control import pfc_file
from emir_control.design import spectral_radius
from emir_control.force_loop import ForceLoopParameters
from emir_control.pfc import Pfc
from emir_control.trajectory import TrajectoryParameters, named
from emir_plant.plant import Plant
from emir_plant.sheet import joint1

FORTY_FIVE = math.radians(45.0)


def _known_run() -> dict[str, np.ndarray]:
    """Ramps up and down, followed 0.4 s late; the TCP swings from 1 s after the first stop on."""
    control, fine = np.arange(0.0, 16.0, 0.032), np.arange(0.0, 16.0 - 0.024, 0.008)

    def stroke(t: np.ndarray) -> np.ndarray:
        return 0.02 * (np.clip(t - 2.0, 0.0, 3.0) - np.clip(t - 10.0, 0.0, 3.0))

    def speed(t: np.ndarray) -> np.ndarray:
        return 0.02 * (((t > 2.0) & (t < 5.0)) * 1.0 - ((t > 10.0) & (t < 13.0)))

    swing = np.where((fine > 6.5) & (fine < 8.0), 0.03 * np.sin(2 * math.pi * fine), 0.0)
    angle = 0.7 + stroke(fine - 0.4)
    return {
        "reference_stroke": stroke(control),
        "reference_velocity": speed(control),
        "true_stroke": stroke(fine - 0.4),
        "true_velocity": speed(fine - 0.4),
        "true_angle": angle,
        "tcp_deflection": -0.25 * np.cos(angle) + swing,
        "valve_command": np.where(speed(control) != 0.0, 0.5, 0.0) * np.sign(speed(control)),
        "flow_lifting": 0.06 * speed(fine - 0.4),
        "flow_lowering": -0.03 * speed(fine - 0.4),
    }


def test_figures_of_a_known_run() -> None:
    lift, lower = figures(_known_run())
    for move in (lift, lower):
        assert move.lag == pytest.approx(0.4, abs=0.01)
        assert move.error == pytest.approx(0.02 * 0.4, rel=1e-6)
    assert lift.up == pytest.approx(0.0, abs=1e-12)  # the sag of each posture is taken off
    assert lift.after == lift.settled == pytest.approx(0.03, rel=1e-3)
    assert lower.after == pytest.approx(0.0, abs=1e-12)
    assert lift.settling == pytest.approx(3.0, abs=0.1)  # the swing ends 3 s after the stop
    assert lower.settling == 0.0
    assert lift.travel == lower.travel == pytest.approx(1.0)  # to 0.5 and back
    assert lift.oil == pytest.approx(0.06 * 0.06, rel=0.01)  # 60 mm, what comes back is not counted
    assert lower.oil == pytest.approx(0.03 * 0.06, rel=0.01)
    assert lift.error_rms == pytest.approx(0.008 * math.sqrt(2.85 / 8.6), rel=0.05)


@pytest.fixture(scope="module")
def moves() -> dict[str, list[MoveFigures]]:
    """The paper's move at 45 deg, empty: lift, lower."""
    trajectory = named("lift-lower", TrajectoryParameters())
    return {
        name: figures(run(joint1(), trajectory, outer, FORTY_FIVE))
        for name, outer in controllers().items()
    }


def test_conventional_control_lags_by_its_time_constant(
    moves: dict[str, list[MoveFigures]],
) -> None:
    for move in moves["cascade"]:
        assert move.lag == pytest.approx(0.4, abs=0.05)  # paper 3.2


@pytest.mark.parametrize("controller", ["pfc", "pfc_tip"])
def test_predictive_control_is_smoother_and_bends_the_boom_less(
    controller: str, moves: dict[str, list[MoveFigures]]
) -> None:
    """The paper's order of merit against conventional control (3.3, Fig. 9, 11, 12)."""
    for ours, conventional in zip(moves[f"{controller}, preview"], moves["cascade"], strict=True):
        assert ours.roughness < 0.75 * conventional.roughness
        assert max(ours.up, -ours.down) < 0.75 * max(conventional.up, -conventional.down)
        assert ours.settled < 0.5 * conventional.settled
        assert abs(ours.lag) < 0.1


def test_without_a_lag_the_preview_is_what_makes_the_boom_bend_less(
    moves: dict[str, list[MoveFigures]],
) -> None:
    for known, guessed in zip(moves["pfc, preview"], moves["pfc, velocity"], strict=True):
        assert -known.down < 0.75 * -guessed.down
        assert known.after < 0.75 * guessed.after


def test_capillary_line_damps_lets_the_boom_sink_and_wastes_oil() -> None:
    """Why the paper rejects it (3.1); a leak of nothing costs nothing."""
    undamped = ForceLoopParameters(gain=0.0)
    none, some, more = (damping_figures(joint1(), c, undamped) for c in (0.0, 2e-11, 1e-10))
    assert none.damping < some.damping < more.damping
    assert none.sinking == pytest.approx(0.0, abs=1e-4)
    assert 0.1 < some.sinking < more.sinking
    assert none.lifting == pytest.approx(0.0, abs=0.03)  # the sagging pressure gives some back
    assert none.lifting < some.lifting < more.lifting
    plant = Plant(joint1())
    shown = plant.outputs(plant.initial(FORTY_FIVE, 2e6))
    leak = 1e-10 * (shown.pressure_lifting - shown.pressure_lowering)
    assert more.at_rest == pytest.approx(leak, rel=1e-9)


def test_damping_is_seen_in_the_machines_swing_after_a_stop() -> None:
    """What the linear figure says of the slow mode, the nonlinear machine shows."""
    period = round(1.0 / (0.69 * 0.032))  # control periods of the slow mode's swing
    left = []
    for leakage, force_loop in damping.WAYS.values():
        velocity = damping.swing(joint1(), leakage, force_loop)[22:]
        left.append(np.ptp(velocity[2 * period : 3 * period]) / np.ptp(velocity[:period]))
    neither, *lines, feedback = left
    assert neither > lines[0] > lines[1] > lines[2] > feedback


def test_compare_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    image = tmp_path / "compare.png"
    words = ["--angle", "45", "--controllers", "cascade", "pfc, preview"]
    words += ["--picture", str(image)]
    assert main(["compare", *words]) == 0
    out = capsys.readouterr().out
    assert out.count("| lift |") == out.count("| lower |") == 2
    assert image.read_bytes().startswith(b"\x89PNG")
    assert main(["compare", "--size", "20", "--repeat", "2", "--controllers", "pfc, preview"]) == 0
    assert capsys.readouterr().out.count(" \u00b1 ") == 2 * 11
    image.unlink()
    assert main(["compare", "--damping", "--picture", str(image)]) == 0
    assert image.exists()
    assert "force feedback" in capsys.readouterr().out


def test_compare_command_over_a_grid(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    image, table = tmp_path / "grid.png", tmp_path / "grid.csv"
    words = ["--payload", "0", "1500", "--angle", "30", "60", "--size", "20"]
    words += ["--controllers", "cascade", "pfc, preview"]
    assert main(["compare", *words, "--picture", str(image), "--csv", str(table)]) == 1
    captured = capsys.readouterr()
    assert "3 cases; median / worst" in captured.out
    *_, told = captured.err.splitlines()
    left_out = "the first: 30 deg, 1500 kg, 20 mm, model error none: at 30.0 deg the boom needs"
    assert told.startswith(f"emir compare: 1 of 4 cases left out; {left_out}")
    assert "smoother than conventional control (rms dv/dt): in " in captured.out
    assert "angle: 30.0 deg" in captured.out
    with table.open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 3 * 2 * 2
    assert {row["case_error"] for row in rows} == {"none"}
    margins = {
        (row["case_angle"], row["case_payload"]): float(row["gain_margin"])
        for row in rows
        if (row["controller"], row["move"]) == ("pfc, preview", "lift")
    }
    assert margins["60.0", "1500.0"] < 1.0 < margins["60.0", "0.0"]
    assert image.read_bytes().startswith(b"\x89PNG")


def test_trade_off_of_conventional_control(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Paper 3.2: whoever wants to follow closer by these two bends the boom more."""
    monkeypatch.setattr(trade_off, "GAINS", (1.0, 2.0))
    monkeypatch.setattr(trade_off, "TIME_CONSTANTS", (0.1, 0.4))
    image = tmp_path / "curve.png"
    words = ["compare", "--trade-off", "--controllers", "lqg", "--picture", str(image)]
    assert main(words) == 0
    rows = [line.strip("| ").split("|") for line in capsys.readouterr().out.splitlines()[2:]]
    *rows, lqg = rows
    assert lqg[0].strip() == "lqg"
    by_tuning = {(float(row[1]), float(row[2])): [float(cell) for cell in row[3:]] for row in rows}
    assert float(lqg[5]) < min(bent for _, _, bent, _ in by_tuning.values())
    for gain in (1.0, 2.0):
        (quick, _, bent, _), (slow, _, less_bent, _) = by_tuning[gain, 0.1], by_tuning[gain, 0.4]
        assert quick < slow
        assert bent > less_bent
    assert image.read_bytes().startswith(b"\x89PNG")


def test_gain_margin_is_where_the_poles_cross_the_unit_circle() -> None:
    """Against the closed loop's eigenvalues, the machine's gain raised by the margin."""
    law = Pfc(pfc_file.load(pfc_file.default_file("stroke"), "stroke"))
    for payload in (0.0, 1500.0):
        point = OperatingPoint(angle=math.radians(60.0), payload=payload)
        linear = linear_machine(joint1(), point)
        margin = gain_margin(linear, PfcControl(law))
        for factor, stable in ((0.95 * margin, True), (1.05 * margin, False)):
            louder = replace(linear.model, B=factor * linear.model.B)
            assert (spectral_radius(law, louder) < 1.0) == stable


def test_figures_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["figures", "--only", "9,12", "--out", str(tmp_path / "new")]) == 0
    files = sorted((tmp_path / "new").glob("*.png"))
    assert [file.name for file in files] == ["figure_09.png", "figure_12.png"]
    assert all(file.read_bytes().startswith(b"\x89PNG") for file in files)
    for only, said in (("8", "figure 8: there are 3, 5, 7, 9, 11, 12"), ("9;11", "not numbers")):
        assert main(["figures", "--only", only, "--out", str(tmp_path)]) == 1
        assert said in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--controllers", "magic"], "controller 'magic': there are cascade; pfc, preview"),
        (["--angle", "45", "--repeat", "0"], "repeat = 0: at least 1"),
        (["--angle", "45", "--trajectory", "hold"], "nothing moves in it"),
        (["--angle", "45", "--trajectory", "loop"], "there are lift-lower"),
        (["--payload", "-1", "--controllers", "cascade"], "geometry.payload = -1"),
        (["--angle", "30", "45", "--repeat", "2"], "--repeat is for one case"),
        (["--error", "magic"], "model error 'magic': there are none; oil -20%"),
        (["--angle", "45", "--csv", "moves.csv"], "--csv is of a grid"),
        (["--damping", "--csv", "moves.csv"], "--csv: not with --damping"),
        (["--damping", "--controllers", "lqg"], "--controllers: not with --damping"),
        (["--trade-off", "--angle", "45", "--repeat", "3"], "--angle, --repeat: not with --trade"),
        (["--angle", "45", "50", "--trajectory", "loop"], "there are lift-lower"),
        (
            ["--angle", "3", "4", "--trajectory", "lower-lift", "--controllers", "cascade"],
            "no case that the machine can do; the first: 3 deg",
        ),
        (["--picture", "nowhere/x.png"], "nowhere/x.png: no such folder nowhere"),
        (
            ["--payload", "1500", "--angle", "30", "--controllers", "cascade"],
            "compare: 30 deg, 1500 kg, 63.75 mm, model error none: at 30.0 deg the boom needs",
        ),
        (["--angle", "nan"], "angle = nan deg: outside -28.6 ... 91.7 deg"),
        (["--angle", "45", "-60"], "angle = -60 deg: outside -28.6 ... 91.7 deg"),
        (["--payload", "0", "9000"], "geometry.payload = 9000: outside"),
        (
            ["--angle", "85", "--controllers", "cascade"],
            "85.0 deg the move takes the stroke from 0.873 to 0.936 m, the controllers keep it",
        ),
        (
            ["--angle", "3", "--trajectory", "lower-lift", "--controllers", "cascade"],
            "keep it within 0.05 ... 0.9",
        ),
        (
            ["--angle", "-28", "91", "--controllers", "cascade"],
            "no case that the machine can do; the first: -28 deg, 0 kg, 63.75 mm",
        ),
        (["--size", "-3"], "size = -3 mm: outside 0 ... 1000 mm"),
    ],
)
def test_bad_input_is_one_clear_line(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["compare", *words]) == 1
    errors = [line for line in capsys.readouterr().err.splitlines() if line.startswith("emir ")]
    assert len(errors) == 1
    assert said in errors[0]

"""Figures of a run against signals whose figures are known."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from mcap.writer import Writer

from emir_analysis.cli import main
from emir_analysis.errors import InputError
from emir_analysis.metrics import metrics
from emir_analysis.run_report import analyze, text, write_json
from emir_analysis.run_signals import load_run
from emir_analysis.signals import Recording, Signal

LIFT = Path(__file__).parents[2] / "bags" / "lift"


def _signal(name: str, unit: str, time: np.ndarray, value: np.ndarray) -> Signal:
    return Signal(name, time, value, unit)


def _run(delay: float, bending: float) -> Recording:
    """A stroke that follows a ramp with a pure delay, and a TCP that swings with 0.7 Hz."""
    control, plant = np.arange(0.0, 10.0, 0.032), np.arange(0.0, 10.0, 0.008)

    def ramp(t: np.ndarray) -> np.ndarray:
        return np.clip(t - 2.0, 0.0, 4.0) * 0.025 + 0.3

    def speed(t: np.ndarray) -> np.ndarray:
        return np.where((t > 2.0) & (t < 6.0), 0.025, 0.0)

    swing = np.where(plant > 2.0, bending * np.sin(2 * math.pi * 0.7 * (plant - 2.0)), 0.0)
    stroke = ramp(plant - delay)
    signals = {
        "reference_stroke": _signal("reference_stroke", "m", control, ramp(control)),
        "reference_velocity": _signal("reference_velocity", "m/s", control, speed(control)),
        "stroke": _signal("stroke", "m", plant, stroke),
        "true_stroke": _signal("true_stroke", "m", plant, stroke),
        "true_velocity": _signal("true_velocity", "m/s", plant, speed(plant - delay)),
        "true_angle": _signal("true_angle", "rad", plant, stroke / 0.6),
        "tcp_deflection": _signal("tcp_deflection", "m", plant, -0.18 + swing),
        "pressure_lifting": _signal("pressure_lifting", "Pa", plant, 1e7 + 1e5 * swing),
        "pressure_lowering": _signal("pressure_lowering", "Pa", plant, np.full(plant.size, 2e6)),
        "valve_command": _signal("valve_command", "1", control, np.where(control > 5, 0.5, 0.0)),
    }
    return Recording(signals, 0)


def test_figures_of_a_known_run() -> None:
    found = {m.name: m.value for m in metrics(_run(delay=0.4, bending=0.05), 22.5)}
    assert found["tracking_error_peak"] == pytest.approx(0.025 * 0.4, rel=1e-6)
    assert found["lag_velocity"] == pytest.approx(0.4, abs=0.02)
    assert found["lag_stroke"] == pytest.approx(0.4, abs=0.002)
    assert found["lag_plateau"] == pytest.approx(0.4, abs=1e-6)
    assert found["tcp_deflection_static"] == pytest.approx(-0.18)
    assert found["tcp_deflection_up"] == pytest.approx(0.05, rel=1e-3)
    assert found["tcp_deflection_down"] == pytest.approx(-0.05, rel=1e-3)
    # the stroke follows the delayed reference exactly: only the bending is left
    assert found["tcp_error_up"] == pytest.approx(0.05, rel=1e-2)
    assert found["pressure_lowering_peak"] == pytest.approx(2e6)
    assert found["valve_travel"] == pytest.approx(0.5)


@pytest.mark.parametrize("length", [12.0, 22.5])
def test_the_tcp_is_as_far_off_as_the_boom_is_long(length: float) -> None:
    """The piston comes 0.1 s later than law (11) has it: 2.5 mm, over an arm of 0.6 m."""
    run = _run(delay=0.5, bending=0.0)
    found = {m.name: m.value for m in metrics(run, length)}
    assert found["tcp_error_down"] == pytest.approx(-length * 0.0025 / 0.6, rel=1e-3)
    unknown = {m.name: m.value for m in metrics(run, None)}
    assert unknown["tcp_error_down"] is unknown["tcp_error_up"] is None


def test_what_moves_before_the_reference_does_not_count_as_rest() -> None:
    run = _run(delay=-0.5, bending=0.0)
    tcp = run["tcp_deflection"]
    early = np.where(tcp.time > 1.5, -0.18 + 0.01, -0.18)  # it saw the move coming at 2 s
    signals = run.signals | {"tcp_deflection": _signal("tcp_deflection", "m", tcp.time, early)}
    found = {m.name: m.value for m in metrics(Recording(signals, 0), 22.5)}
    assert found["tcp_deflection_static"] == pytest.approx(-0.18, abs=1e-12)
    assert found["tcp_deflection_up"] == pytest.approx(0.01)


def test_a_machine_without_truth_gets_the_figures_that_its_sensors_allow() -> None:
    whole = _run(0.4, 0.05)
    hidden = ("true", "tcp")
    sensed = {n: s for n, s in whole.signals.items() if not n.startswith(hidden)}
    found = {m.name: m.value for m in metrics(Recording(sensed, 0), 22.5)}
    assert found["lag_stroke"] == pytest.approx(0.4, abs=0.002)
    assert found["tcp_deflection_static"] is None
    assert found["lag_velocity"] is None


def test_an_old_recording_is_read_and_reported(tmp_path: Path) -> None:
    run = analyze(LIFT)
    figures = {m.name: m.value for m in run.metrics}
    assert figures["tcp_deflection_static"] == pytest.approx(-0.18, abs=0.01)  # paper 3.2
    assert run.about["controller"] == "cascade"
    assert "tcp_deflection_static" in text(run)
    write_json([run], tmp_path / "figures.json")
    written = json.loads((tmp_path / "figures.json").read_text())["metrics"]
    assert {name: entry["value"] for name, entry in written.items()} == figures


def _earlier(folder: Path) -> Path:
    """The same recording, cut off in the middle of the move."""
    folder.mkdir()
    content = next(LIFT.glob("*.mcap")).read_bytes()
    (folder / "lift_0.mcap").write_bytes(content[: int(0.7 * len(content))])
    return folder


def test_several_recordings_make_one_table(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    short, file = _earlier(tmp_path / "short"), tmp_path / "table.csv"
    assert main(["analyze", str(LIFT), str(short), "--csv", str(file)]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert printed[0].split() == ["lift", "short"]
    table = pd.read_csv(file, index_col="bag")
    for bag in (LIFT, short):
        for metric in analyze(bag).metrics:
            cell = table.loc[str(bag), f"{metric.name} [{metric.unit}]"]
            assert cell == metric.value or (metric.value is None and np.isnan(cell))
    assert set(table["controller"]) == {"cascade"}


def test_a_recording_that_begins_in_mid_move_has_no_deflection_at_rest() -> None:
    whole = _run(0.5, 0.1)
    late = {
        name: _signal(name, s.unit, s.time[s.time >= 3.0], s.value[s.time >= 3.0])
        for name, s in whole.signals.items()
    }
    before = late["tcp_deflection"]
    late["tcp_deflection"] = _signal(
        "tcp_deflection", "m", before.time[before.time > 3.5], before.value[before.time > 3.5]
    )
    figures = {m.name: m.value for m in metrics(replace(whole, signals=late), 22.5)}
    assert figures["tcp_deflection_static"] is figures["tcp_deflection_up"] is None
    assert figures["tracking_error_peak"] is not None


def test_a_recording_of_something_else_is_refused(shared: Path) -> None:
    with pytest.raises(InputError, match="no topic cylinder_states; there are /rig"):
        load_run(shared / "recordings" / "elm_a")


@pytest.mark.parametrize(
    "words", [["analyze"], ["replay", "--node", "cascade"], ["view", "--bag"], ["design", "--from"]]
)
def test_a_recording_without_messages_is_refused(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = tmp_path / "none.mcap"
    with bag.open("wb") as stream:
        writer = Writer(stream)
        writer.start()  # type: ignore[no-untyped-call]  # mcap's, untyped
        writer.finish()  # type: ignore[no-untyped-call]
    more = ["--out", str(tmp_path / "pfc.yaml")] if words[0] == "design" else []
    assert main([*words, str(bag), *more]) == 1
    *_, told = capsys.readouterr().err.splitlines()
    assert told.startswith(f"emir {words[0]}: {bag}: no topic ")
    assert told.endswith("; there are none")

"""The diagnosis of an actuator, on recordings that other code has made."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import actuator_recorded as recorded
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from emir_analysis.cli import main
from emir_analysis.diagnosis.actuator import ActuatorDiagnosis, command, summary
from emir_analysis.diagnosis.actuator.fitting import fit
from emir_analysis.diagnosis.actuator.record import ActuatorRecord, noise_of, open_record
from emir_analysis.import_command import import_csv
from emir_analysis.signals import load, read_signal_map
from emir_common.parameter_tree import with_values
from emir_plant import actuator
from emir_plant.actuator import ActuatorSheet, is_actuator, load_actuator

Spoiler = Callable[[recorded.Array, recorded.Array], tuple[recorded.Array, recorded.Array]]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with data sheet and signal map."""
    (tmp_path / "sheet.yaml").write_text(recorded.SHEET)
    (tmp_path / "signals.yaml").write_text(recorded.SIGNALS)
    return tmp_path


def _diagnose(folder: Path, bag: Path, judge: Path | None) -> ActuatorDiagnosis:
    return command(
        bag,
        folder / "sheet.yaml",
        folder / "signals.yaml",
        judge,
        json=folder / "found.json",
        html=folder / "found.html",
        model_out=folder / "model.yaml",
        predictions=folder / "runs",
        progress=lambda _: None,
    )


def _proportional(spool: float, _: float) -> float:
    return recorded.GAIN * spool


def _limited(spool: float, _: float) -> float:
    return float(np.clip(recorded.GAIN * spool, -0.8, 0.5))


def test_the_noise_of_a_pressure_is_at_least_that_of_its_steps() -> None:
    """Third differences of a slow signal in coarse steps are mostly 0."""
    slow = np.round(20.0 * np.sin(np.arange(5000) / 600.0))
    assert noise_of(slow) == pytest.approx(1.0 / np.sqrt(12.0))
    fine = np.random.default_rng(1).standard_normal(5000)
    assert noise_of(fine) == pytest.approx(1.0, rel=0.05)


def test_a_machine_as_its_sheet_says_lacks_nothing(folder: Path) -> None:
    result = _diagnose(folder, *recorded.record(folder, _proportional))
    assert result.verdict == "nothing_missing", summary(result)
    assert result.effects == ()
    assert result.parameters["valve.gain"].value == pytest.approx(recorded.GAIN, rel=0.02)
    signal = result.signals["oil_pressure"]
    assert signal.refitted < 1.1 * recorded.NOISE < 0.5 * signal.nominal
    assert signal.black_box < 1.2 * recorded.NOISE  # the machine is linear


def test_an_effect_is_found_and_carries_to_the_other_recording(
    folder: Path,
) -> None:
    bag, judge = recorded.record(folder, _limited)
    result = _diagnose(folder, bag, judge)
    assert result.verdict == "found", summary(result)
    (effect,) = result.effects
    assert (effect.name, effect.balance) == ("flow_limit", "supply")
    assert effect.parameters["lifting"].value == pytest.approx(0.5, rel=0.03)
    assert effect.parameters["lowering"].value == pytest.approx(0.8, rel=0.03)
    signal = result.signals["oil_pressure"]
    assert signal.with_effect < 1.2 * recorded.NOISE < 0.2 * signal.refitted
    assert not result.judged_from_its_own_start
    written = json.loads((folder / "found.json").read_text())
    assert written["signals"]["oil_pressure"].keys() == {
        "unit", "noise", "nominal", "refitted", "with_effect", "black_box",
    }  # fmt: skip
    tests = result.tests["oil_pressure"]
    for stage in ("nominal", "refitted", "with_effect", "black_box"):
        inside = tests.intervals[stage]
        assert inside.low <= getattr(signal, stage) <= inside.high
    ahead = result.one_step["oil_pressure"]
    assert ahead.with_effect < 1.2 * ahead.noise < ahead.nominal
    assert written["balances"]["oil"].keys() == {"unit", "noise", "before", "refitted", "after"}
    assert (folder / "found.html").read_text().count("<img") == 1
    model = load_actuator(folder / "model.yaml").machine
    assert model.effects.flow_limit.lifting == effect.parameters["lifting"].value
    runs = load(folder / "runs", {"with": ("/oil_pressure/with_effect", "position[0]", "1")})
    measured = open_record(judge, read_signal_map(folder / "signals.yaml"))
    error = runs["with"].value - measured.pressure
    assert np.sqrt(np.mean(error**2)) == pytest.approx(signal.with_effect, rel=1e-6)


def test_a_parameter_stated_as_zero_is_fitted(folder: Path) -> None:
    stated = "viscous_friction: {value: 0.5"
    assert stated in recorded.SHEET
    text = recorded.SHEET.replace(stated, "viscous_friction: {value: 0.0")
    (folder / "sheet.yaml").write_text(text)
    bag, _ = recorded.record(folder, _proportional)
    sheet = load_actuator(folder / "sheet.yaml")
    record = open_record(bag, read_signal_map(folder / "signals.yaml"))
    found = fit(sheet, (), record).machine
    assert found.load.viscous_friction == pytest.approx(recorded.FRICTION, rel=0.05)


def _one_unknown(folder: Path) -> tuple[ActuatorSheet, ActuatorRecord]:
    """Return a sheet that leaves the gain open, alone, and a recording."""
    bag, _ = recorded.record(folder, _proportional)
    sheet = load_actuator(folder / "sheet.yaml")
    gain = {"valve.gain": sheet.ranges["valve.gain"]}
    return replace(sheet, ranges=gain), open_record(bag, read_signal_map(folder / "signals.yaml"))


def test_the_evidence_is_the_integral_over_what_is_expected(folder: Path) -> None:
    sheet, record = _one_unknown(folder)
    found = fit(sheet, (), record)
    expected, deviation = np.log(1.0), np.log(10.0 / 0.1) / 4.0  # range 0.1 ... 10 around 1
    independent = 4.0 * record.pressure.size / (2.0 * np.pi / 0.25)

    def density(x: float) -> float:
        machine = with_values(sheet.machine, {"valve.gain": np.exp(x)})
        error = actuator.simulate(machine, record.opening, 1.0) - record.pressure
        likely = -0.5 * independent * np.mean(error**2) / found.rms**2
        return float(np.exp(likely + 0.5 * independent) * norm.pdf(x, expected, deviation))

    (at,) = found.x
    integral, _ = quad(density, at - 1.0, at + 1.0, points=[at - 0.1, at, at + 0.1])
    whole = np.log(integral) - 0.5 * independent - independent * np.log(found.rms)
    assert found.evidence == pytest.approx(whole, abs=0.05)


def test_a_recording_of_the_model_itself_is_fitted_exactly(folder: Path) -> None:
    sheet, record = _one_unknown(folder)
    own = actuator.simulate(sheet.machine, record.opening, record.period)
    found = fit(sheet, (), replace(record, pressure=own))
    assert found.rms == 0.0
    assert found.machine == sheet.machine
    assert np.isfinite(found.evidence)


def test_what_the_recording_says_nothing_about_stays_as_expected(folder: Path) -> None:
    sheet, record = _one_unknown(folder)
    record = replace(record, opening=0.2 * record.opening, pressure=0.2 * record.pressure)
    without = fit(sheet, (), record)
    found = fit(sheet, ("relief_valve",), record)  # opens at a pressure that is never reached
    valve = found.machine.effects.relief_valve
    assert (valve.high, valve.low) == pytest.approx((3.0, 3.0))
    assert np.diag(found.covariance)[1:] == pytest.approx(4.0)
    assert found.evidence == pytest.approx(without.evidence, abs=1e-3)


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda u, p: (0.0 * u, p), "valve_opening is constant"),
        (lambda u, p: (u, 0.0 * p + 3.0), "oil_pressure is constant"),
        (lambda u, p: (u[:50], p[:50]), "record at least 200"),
    ],
)
def test_a_recording_of_no_use_is_told(
    folder: Path, spoil: Spoiler, reason: str, capsys: pytest.CaptureFixture[str]
) -> None:
    opening = recorded.moves(300, 1)
    recorded.write(folder / "bag", *spoil(opening, np.sin(opening)))
    words = ["--datasheet", str(folder / "sheet.yaml"), "--signals", str(folder / "signals.yaml")]
    assert main(["diagnose", str(folder / "bag"), *words]) == 1
    told = capsys.readouterr().err.splitlines()
    assert reason in told[-1]


def test_the_crane_actuator_of_the_benchmark(shared: Path, tmp_path: Path) -> None:
    """On the estimation half alone: the validation half is no business of a test."""
    (tmp_path / "signals.yaml").write_text(
        "time: {column: k, unit: sample}\n"
        'valve_opening: {column: u, topic: /opening, field: data, unit: "1"}\n'
        'oil_pressure: {column: p, topic: /pressure, field: data, unit: "1"}\n'
    )
    table = shared / "measured" / "crane-actuator" / "actuator.csv"
    import_csv(table, tmp_path / "signals.yaml", tmp_path / "bag", slice(0, 512))
    record = open_record(tmp_path / "bag", read_signal_map(tmp_path / "signals.yaml"))
    own = Path(actuator.__file__).parent / "data" / "crane_actuator.yaml"
    assert is_actuator(own)
    sheet = load_actuator(own)
    plain = fit(sheet, (), record, drawn=8)
    limited = fit(sheet, ("flow_limit", "turbulent_resistance"), record, drawn=8)
    assert limited.rms < 0.7 * plain.rms < 0.7 * np.std(record.pressure)
    both = ("flow_limit", "turbulent_resistance", "elastic_boom", "swinging_load")
    behind = fit(sheet, both, record, [limited.machine], drawn=3)
    assert behind.rms < 0.9 * limited.rms
    assert behind.evidence > limited.evidence > plain.evidence

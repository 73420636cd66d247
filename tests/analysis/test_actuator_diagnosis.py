"""The diagnosis of an actuator, on recordings that other code has made."""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from shutil import copy

import actuator_recorded as recorded
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from emir_analysis.cli import main
from emir_analysis.diagnosis.actuator import ActuatorDiagnosis, command, summary
from emir_analysis.diagnosis.actuator.fitting import Begin, Fitting, narrowed
from emir_analysis.diagnosis.actuator.record import ActuatorRecord, noise_of, open_record
from emir_analysis.errors import IncompleteError
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


EXACT = f"""\
machine: actuator
time_unit: sample
valve: {{gain: {recorded.GAIN}, time_constant: {recorded.LAG}}}
load: {{frequency: {recorded.FREQUENCY}, viscous_friction: {recorded.FRICTION}}}
sensor: {{pressure_noise: {recorded.NOISE}}}
"""


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


@pytest.mark.parametrize(("law", "lacking"), [(_proportional, []), (_limited, ["flow_limit"])])
def test_a_sheet_that_leaves_nothing_open_is_asked_what_it_lacks(
    folder: Path, law: recorded.Flow, lacking: list[str]
) -> None:
    (folder / "sheet.yaml").write_text(EXACT)
    result = _diagnose(folder, *recorded.record(folder, law))
    assert result.verdict == ("found" if lacking else "nothing_missing"), summary(result)
    assert [effect.name for effect in result.effects] == lacking
    assert result.parameters == {}


def test_a_limit_that_is_not_reached_is_not_told(folder: Path) -> None:
    """The pump limits lifting alone; lowering goes no faster than the valve lets it."""

    def lifting_alone(spool: float, _: float) -> float:
        return min(recorded.GAIN * spool, 0.5)

    result = _diagnose(folder, *recorded.record(folder, lifting_alone))
    (effect,) = result.effects
    assert effect.name == "flow_limit", summary(result)
    assert effect.parameters["lifting"].value == pytest.approx(0.5, rel=0.03)
    assert "lowering" not in effect.parameters
    signal = result.signals["oil_pressure"]
    assert signal.with_effect < 1.2 * recorded.NOISE < 0.2 * signal.refitted


def test_what_no_recording_can_tell_apart_is_ambiguous(folder: Path) -> None:
    """A valve that is not shut at zero, for long, and a steady load: at rest both are the same."""
    opening = np.append(np.zeros(150), recorded.moves(450, 1))
    oil = recorded.pressure(opening, lambda spool, _: recorded.GAIN * (spool + 0.15))
    oil += recorded.NOISE * np.random.default_rng(2).standard_normal(oil.size)
    recorded.write(folder / "crept", opening[130:], oil[130:])
    result = _diagnose(folder, folder / "crept", None)
    assert result.verdict == "ambiguous", summary(result)
    told = {effect.name for effect in result.effects}.union(
        *(r.split(" and ") for r in result.rivals)
    )
    assert told == {"external_load", "valve_null_offset"}


def test_a_threshold_far_from_where_a_fit_begins_is_found(folder: Path) -> None:
    """Beyond a relief valve's setting alone anything changes, and the gain makes up for it."""

    def relieved(spool: float, oil: float) -> float:
        return recorded.GAIN * spool - 5.0 * (max(oil - 0.4, 0.0) - max(-oil - 0.6, 0.0))

    bag, _ = recorded.record(folder, relieved)
    sheet = load_actuator(folder / "sheet.yaml")
    record = open_record(bag, read_signal_map(folder / "signals.yaml"))
    fitting = Fitting(sheet, record, recorded.NOISE)
    plain = fitting.fit((), Begin(drawn=8))
    found = fitting.fit(("relief_valve",), Begin([plain.machine], levels=True))
    assert found.rms < 1.1 * recorded.NOISE < 0.2 * plain.rms
    valve = found.machine.effects.relief_valve
    assert (valve.high, valve.low) == pytest.approx((0.4, 0.6), rel=0.02)


def test_a_law_that_no_effect_has_is_unexplained_and_measured(folder: Path) -> None:
    """Edges whose opening grows with its square: what comes closest is told, not named."""
    bag, judge = recorded.record(folder, lambda spool, _: 2.0 * spool * abs(spool))
    result = _diagnose(folder, bag, judge)
    assert result.verdict == "unexplained", summary(result)
    assert result.effects == ()
    assert re.search("comes? closest", result.statement)
    assert "a flow over the valve opening" in result.statement
    curve = result.curve
    assert curve is not None
    assert (curve.name, curve.balance) == ("unnamed_flow", "valve")
    machine = load_actuator(folder / "model.yaml").machine
    opening, more = np.array(curve.points).T
    law = 2.0 * opening * np.abs(opening)
    assert machine.valve.gain * opening + more == pytest.approx(law, abs=0.1 * law.max())
    signal = result.signals["oil_pressure"]
    assert signal.with_effect < 0.2 * signal.refitted
    assert (folder / "found.html").read_text().count("<img") == 2


def test_another_value_in_the_sheet_is_told_where_that_is_what_is_wrong(folder: Path) -> None:
    """The gain is beyond its range: no effect, though some come near."""
    stated = "gain: {value: 1.0, range: [0.1, 10.0]}"
    assert stated in recorded.SHEET
    wrong = recorded.SHEET.replace(stated, "gain: {value: 1.0, range: [0.8, 1.2]}")
    (folder / "sheet.yaml").write_text(wrong)
    result = _diagnose(folder, *recorded.record(folder, _proportional))
    assert result.verdict == "unexplained", summary(result)
    told = result.misstated
    assert told is not None
    assert (told.name, told.stated) == ("valve.gain", 1.0)
    assert told.wanted.value == pytest.approx(recorded.GAIN, rel=0.02)
    assert "another value in the data sheet: valve.gain" in result.statement
    signal = result.signals["oil_pressure"]
    assert signal.with_effect < 1.2 * recorded.NOISE < 0.5 * signal.refitted
    assert "another valve.gain" in summary(result)
    machine = load_actuator(folder / "model.yaml").machine
    assert machine.valve.gain == told.wanted.value


@pytest.mark.parametrize("law", [_proportional, _limited])
def test_a_pressure_noisier_than_stated_lacks_nothing_for_that(
    folder: Path, law: recorded.Flow
) -> None:
    stated = f"value: {recorded.NOISE}}}"
    assert stated in recorded.SHEET
    (folder / "sheet.yaml").write_text(recorded.SHEET.replace(stated, "value: 0.005}"))
    result = _diagnose(folder, *recorded.record(folder, law))
    assert result.verdict == ("nothing_missing" if law is _proportional else "found")
    assert result.signals["oil_pressure"].noise == pytest.approx(recorded.NOISE, rel=0.1)
    machine = load_actuator(folder / "model.yaml").machine
    assert machine.sensor.pressure_noise == pytest.approx(recorded.NOISE, rel=0.1)


def test_a_large_leak_is_no_relief_valve(folder: Path) -> None:
    """A relief valve that opens at no pressure would be the same."""

    def leaking(spool: float, oil: float) -> float:
        return recorded.GAIN * spool - 0.35 * oil

    result = _diagnose(folder, *recorded.record(folder, leaking))
    assert [e.name for e in result.effects] == ["internal_leakage"], summary(result)
    leak = result.effects[0].parameters["conductance"]
    assert leak.value == pytest.approx(0.35, rel=0.05)


def test_a_simulation_without_noise_lacks_nothing(folder: Path) -> None:
    """What two integrators differ by is nothing that a machine has."""
    text = recorded.SHEET[: recorded.SHEET.index("sensor:")]
    (folder / "sheet.yaml").write_text(text)
    opening = recorded.moves(320, 1)
    recorded.write(folder / "a", opening, recorded.pressure(opening, _proportional))
    result = _diagnose(folder, folder / "a", None)
    assert result.verdict == "nothing_missing", summary(result)


def test_a_recording_that_begins_in_the_middle_of_a_move_is_told(folder: Path) -> None:
    opening = recorded.moves(600, 1)
    oil = recorded.pressure(opening, _proportional)
    oil += recorded.NOISE * np.random.default_rng(2).standard_normal(600)
    shut = 30 + int(np.argmin(np.abs(opening[30:200])))  # the valve crosses zero, the mass swings
    for name, begin in (("whole", 0), ("late", shut)):
        recorded.write(folder / name, opening[begin:], oil[begin:])
        record = open_record(folder / name, read_signal_map(folder / "signals.yaml"))
        assert record.begins_moving(recorded.GAIN, recorded.NOISE) == (name == "late"), name
    (folder / "sheet.yaml").write_text(EXACT)
    result = _diagnose(folder, folder / "late", None)
    assert "begins while the machine moves" in result.statement


def test_a_sheet_in_samples_is_right_for_any_rate(folder: Path) -> None:
    """The same run with a sample every 3 s: nothing of the machine in samples is another."""
    (folder / "sheet.yaml").write_text(EXACT)
    bag, judge = recorded.record(folder, _proportional)
    signals = read_signal_map(folder / "signals.yaml")
    other = folder / "slow"
    other.mkdir()
    for file in ("sheet.yaml", "signals.yaml"):
        copy(folder / file, other)
    for name, begin in (("a", 0), ("b", 320)):
        run = open_record(folder / name, signals)
        recorded.write(other / name, run.opening, run.pressure, 3 * begin, seconds=3)
    fast = _diagnose(folder, bag, judge)
    slow = _diagnose(other, other / "a", other / "b")
    assert slow.verdict == fast.verdict == "nothing_missing"
    assert not slow.judged_from_its_own_start
    errors = (each.signals["oil_pressure"].refitted for each in (slow, fast))
    assert next(errors) == pytest.approx(next(errors), rel=1e-6)


def test_the_right_machine_leaves_white_errors(folder: Path) -> None:
    """One sample ahead, though the noise of one reading is in two of them."""
    (folder / "sheet.yaml").write_text(EXACT)
    result = _diagnose(folder, *recorded.record(folder, _proportional))
    assert result.tests["oil_pressure"].whiteness["with_effect"] < 1.0


def test_what_the_judge_recording_alone_shows_is_told(folder: Path) -> None:
    (folder / "sheet.yaml").write_text(EXACT)
    bag, _ = recorded.record(folder, _proportional)
    opening = recorded.moves(300, 3)
    recorded.write(folder / "other", opening, recorded.pressure(opening, _limited))
    result = _diagnose(folder, bag, folder / "other")
    assert result.verdict == "unexplained"
    assert f"but {folder / 'other'}, " in result.statement
    assert "times the noise, shows more" in result.statement


def test_a_parameter_stated_as_zero_is_fitted(folder: Path) -> None:
    stated = "viscous_friction: {value: 0.5"
    assert stated in recorded.SHEET
    text = recorded.SHEET.replace(stated, "viscous_friction: {value: 0.0")
    (folder / "sheet.yaml").write_text(text)
    bag, _ = recorded.record(folder, _proportional)
    sheet = load_actuator(folder / "sheet.yaml")
    record = open_record(bag, read_signal_map(folder / "signals.yaml"))
    found = Fitting(sheet, record, recorded.NOISE).fit((), Begin()).machine
    assert found.load.viscous_friction == pytest.approx(recorded.FRICTION, rel=0.05)


def _one_unknown(folder: Path) -> tuple[ActuatorSheet, ActuatorRecord]:
    """Return a sheet that leaves the gain open, alone, and a recording."""
    bag, _ = recorded.record(folder, _proportional)
    sheet = load_actuator(folder / "sheet.yaml")
    gain = {"valve.gain": sheet.ranges["valve.gain"]}
    return replace(sheet, ranges=gain), open_record(bag, read_signal_map(folder / "signals.yaml"))


def test_the_evidence_is_the_integral_over_what_is_expected(folder: Path) -> None:
    sheet, record = _one_unknown(folder)
    noise = recorded.NOISE
    found = Fitting(sheet, record, noise).fit((), Begin())
    assert found.rms > 3.0 * noise
    expected, deviation = np.log(1.0), np.log(10.0 / 0.1) / 4.0  # range 0.1 ... 10 around 1
    samples, lasting = record.pressure.size, 2.0 * np.pi / 0.25 / 4.0

    def independent(rms: float) -> float:
        """Return Bartlett's number of independent errors: noise, and errors that last."""
        return float(samples / (1.0 + (lasting - 1.0) * (1.0 - (noise / rms) ** 2) ** 2))

    def density(x: float) -> float:
        machine = with_values(sheet.machine, {"valve.gain": np.exp(x)})
        error = actuator.simulate(machine, record.opening, 1.0) - record.pressure
        likely = -0.5 * independent(found.rms) * (np.mean(error**2) / found.rms**2 - 1.0)
        return float(np.exp(likely) * norm.pdf(x, expected, deviation))

    (at,) = found.x
    integral, _ = quad(density, at - 1.0, at + 1.0, points=[at - 0.1, at, at + 0.1])
    beyond, _ = quad(lambda size: independent(np.exp(size)), np.log(noise), np.log(found.rms))
    whole = np.log(integral) - samples / lasting * np.log(noise) - beyond
    assert found.evidence == pytest.approx(whole, abs=0.05)


def test_what_data_narrow_is_told_however_much_it_is() -> None:
    """det(1 + s^2 a a') = 1 + s^2 a'a, while the matrix itself is singular in rounding."""
    jacobian = np.vstack([np.eye(2), [1e9, 1e9]])
    assert np.linalg.slogdet(jacobian.T @ jacobian)[1] < 0.0
    assert narrowed(jacobian, np.ones(2)) == pytest.approx(0.5 * np.log(1.0 + 2e18))


def test_a_recording_of_the_model_itself_is_fitted_exactly(folder: Path) -> None:
    sheet, record = _one_unknown(folder)
    own = actuator.simulate(sheet.machine, record.opening, record.period)
    found = Fitting(sheet, replace(record, pressure=own), recorded.NOISE).fit((), Begin())
    assert found.rms == 0.0
    assert found.machine == sheet.machine
    assert np.isfinite(found.evidence)


def test_what_the_recording_says_nothing_about_stays_as_expected(folder: Path) -> None:
    sheet, record = _one_unknown(folder)
    record = replace(record, opening=0.2 * record.opening, pressure=0.2 * record.pressure)
    fitting = Fitting(sheet, record, recorded.NOISE)
    without = fitting.fit((), Begin())
    found = fitting.fit(("relief_valve",), Begin())  # opens at a pressure that is never reached
    valve = found.machine.effects.relief_valve
    assert (valve.high, valve.low) == pytest.approx((3.0, 3.0))
    expected = [unknown.deviation**2 for unknown in found.unknowns]
    assert np.diag(found.covariance)[1:] == pytest.approx(expected[1:])
    assert found.evidence == pytest.approx(without.evidence, abs=1e-3)


@pytest.mark.parametrize(
    ("samples", "seconds", "reason"),
    [(50, 1, "record at least 200"), (300, 2, "a sample every 2,")],
)
def test_a_judge_of_no_use_does_not_lose_what_was_found(
    folder: Path, samples: int, seconds: int, reason: str
) -> None:
    (folder / "sheet.yaml").write_text(EXACT)
    bag, _ = recorded.record(folder, _proportional)
    opening = recorded.moves(samples, 3)
    recorded.write(folder / "judge", opening, np.sin(opening), seconds=seconds)
    with pytest.raises(IncompleteError, match=reason) as told:
        _diagnose(folder, bag, folder / "judge")
    assert isinstance(told.value.result, ActuatorDiagnosis)
    assert told.value.result.verdict == "nothing_missing"
    assert json.loads((folder / "found.json").read_text())["judged_on"] == str(bag)
    assert (folder / "found.html").exists()


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda u, p: (0.0 * u, p), "valve_opening is constant"),
        (lambda u, p: (u, 0.0 * p + 3.0), "oil_pressure is constant"),
        (lambda u, p: (u[:50], p[:50]), "record at least 200"),
        (lambda u, p: (u, 200.0 * p), "valve.gain and sensor.pressure_noise by 100"),
        (lambda u, p: (100.0 * u, p), "by 100 and multiply the data sheet's valve.gain by that"),
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


def test_a_wild_reading_is_left_out_and_told(folder: Path) -> None:
    opening = recorded.moves(300, 1)
    oil = recorded.pressure(opening, lambda spool, _: recorded.GAIN * spool)
    oil += recorded.NOISE * np.random.default_rng(2).standard_normal(oil.size)
    wild = oil.copy()
    wild[[150, 222]] += (12.0, -12.0)
    recorded.write(folder / "right", opening, oil)
    recorded.write(folder / "wild", opening, wild)
    signals = read_signal_map(folder / "signals.yaml")
    right, mended = (open_record(folder / name, signals) for name in ("right", "wild"))
    assert right.left_out == ""
    assert "2 of 300 readings wild and left out: oil_pressure shows" in mended.left_out
    assert "at 150 alone" in mended.left_out
    apart = np.abs(mended.pressure - right.pressure)
    assert np.flatnonzero(apart).tolist() == [150, 222]
    assert np.max(apart) < 0.5


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
    noise = noise_of(record.pressure)
    fitting = Fitting(sheet, record, noise)
    plain = fitting.fit((), Begin(drawn=8))
    limited = fitting.fit(("flow_limit", "turbulent_resistance"), Begin(drawn=8))
    assert limited.rms < 0.7 * plain.rms < 0.7 * np.std(record.pressure)
    both = ("flow_limit", "turbulent_resistance", "elastic_boom", "swinging_load")
    behind = fitting.fit(both, Begin([limited.machine], drawn=3))
    assert behind.rms < 0.9 * limited.rms
    assert behind.evidence > limited.evidence > plain.evidence

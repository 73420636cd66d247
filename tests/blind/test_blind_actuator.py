"""`emir blind --actuator`: repeatable machines, files a user might have, answers to them."""

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from emir_analysis.blind.actuator.hidden import CATALOGUE, Hidden
from emir_analysis.blind.actuator.puzzle import HIGHEST, MATTERS, puzzle
from emir_analysis.blind.actuator.recording import FACTORS, NOISE, STATED
from emir_analysis.blind.campaign import campaign, read_log
from emir_analysis.blind.family import ACTUATOR, JUDGE, LEARN, SHEET, SIGNALS
from emir_analysis.blind.plan import Plan, foreign_effects
from emir_analysis.blind.turns import KINDS, hidden_in
from emir_analysis.cli import main
from emir_analysis.diagnosis.actuator.record import FEWEST, open_record
from emir_analysis.errors import InputError
from emir_analysis.signals import read_signal_map
from emir_common.parameter_tree import declared
from emir_plant.actuator import load_actuator

HERE = Path(__file__).parent
SOURCE = (HERE / "foreign_actuator.py").read_text()
FOREIGN = foreign_effects(SOURCE, Hidden)
PATHS = {
    "gain": "valve.gain",
    "lag": "valve.time_constant",
    "frequency": "load.frequency",
    "friction": "load.viscous_friction",
}


def test_a_seed_gives_the_same_actuators_wherever_they_are_built() -> None:
    in_a_row = [puzzle(7, k, FOREIGN, 400) for k in range(len(KINDS))]
    for k, one in reversed(list(enumerate(in_a_row))):
        same = puzzle(7, k, FOREIGN, 400)
        assert (one.kind, one.hidden, one.size) == (same.kind, same.hidden, same.size)
        assert (one.machine.n, one.machine.sizes) == (same.machine.n, same.machine.sizes)
        np.testing.assert_array_equal(one.opening, same.opening)
        np.testing.assert_array_equal(one.pressure, same.pressure)


def test_what_is_hidden_is_of_its_kind_and_matters() -> None:
    count = {"one": 1, "none": 0, "two": 2, "foreign": 1}
    known, foreign = ({effect.name for effect in effects} for effects in (CATALOGUE, FOREIGN))
    for k in range(12):
        made = puzzle(8, k, FOREIGN, 400)
        assert made.kind == KINDS[k % len(KINDS)]
        assert len(made.hidden) == count[made.kind]
        assert set(made.hidden) <= (foreign if made.kind == "foreign" else known)
        assert made.size >= MATTERS or made.kind == "none"
        assert np.abs(made.pressure).max() <= HIGHEST


def test_every_effect_has_its_turn() -> None:
    for kind, effects in (("one", CATALOGUE), ("foreign", FOREIGN)):
        numbers = [k for k in range(6 * len(effects)) if KINDS[k % len(KINDS)] == kind]
        drawn = [hidden_in(7, k, CATALOGUE, FOREIGN)[0] for k in numbers[: len(effects)]]
        assert set(drawn) == set(effects)


def test_a_machine_comes_with_the_files_of_a_user(tmp_path: Path) -> None:
    plan = Plan(3, 250.0, SOURCE, actuator=True)
    secret = ACTUATOR.made(plan, 5, tmp_path)
    made = puzzle(3, 5, FOREIGN, 500)
    assert secret == (made.kind, made.hidden, made.machine.sizes, made.size, {})
    assert made.kind == "foreign"
    sheet = load_actuator(tmp_path / SHEET)
    values = {path: value for path, (_, value) in declared(sheet.machine).items()}
    assert sheet.ranges.keys() == set(PATHS.values())
    for name, path in PATHS.items():
        low, high = sheet.ranges[path]
        built = getattr(made.machine.n, name)
        assert low < built < high
        assert abs(np.log(values[path] / built)) <= STATED * np.log(FACTORS[name]) + 1e-3
    learn, judge = (
        open_record(tmp_path / name, read_signal_map(tmp_path / SIGNALS)) for name in (LEARN, JUDGE)
    )
    whole = judge.behind(learn)
    assert judge.follows(learn)
    assert learn.period == 1.0
    np.testing.assert_allclose(whole.opening, made.opening, atol=1e-12)
    noise = (whole.pressure - made.pressure).std() / made.pressure.std()
    assert noise == pytest.approx(NOISE, rel=0.15)
    assert values["sensor.pressure_noise"] == pytest.approx(NOISE * made.pressure.std(), rel=1e-3)


def test_machines_are_diagnosed_and_answered_for(tmp_path: Path) -> None:
    plan = Plan(2, 300.0, only=("command_delay",), actuator=True)
    log = tmp_path / "log.jsonl"
    with ThreadPoolExecutor(1) as executor:
        late, healthy = campaign(plan, 2, log, executor, lambda _: None, keep=tmp_path)
    assert (late.verdict, late.named) == ("found", ["command_delay"]), late.failure
    assert late.errors["with_effect"]["oil_pressure"] < 1.5
    assert late.errors["refitted"]["oil_pressure"] > 2.0
    assert (healthy.kind, healthy.verdict) == ("none", "nothing_missing"), healthy.failure
    answer = json.loads((tmp_path / "machine0000" / "answer.json").read_text())
    delay = answer["effects"][0]["parameters"]["delay"]["value"]
    assert delay == pytest.approx(late.sizes["late"], rel=0.1)
    assert not answer["judged_from_its_own_start"]
    assert read_log(log, plan) == [late, healthy]
    with pytest.raises(InputError, match="or kind"):
        read_log(log, Plan(2, 300.0, only=("command_delay",)))


def test_a_log_from_before_there_were_actuators_goes_on(tmp_path: Path) -> None:
    old = tmp_path / "log.jsonl"
    old.write_text(
        '{"seed": 31, "duration": 60.0, "foreign": "e3b0c44298fc", "only": [], "varied": false}\n'
    )
    assert read_log(old, Plan(31, 60.0)) == []
    for other in (Plan(32, 60.0), Plan(31, 512.0, actuator=True)):
        with pytest.raises(InputError, match="another seed"):
            read_log(old, other)


def test_the_shortest_recording_is_one_that_can_be_diagnosed() -> None:
    assert ACTUATOR.shortest >= FEWEST


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--duration", "199"], "at least 200 samples"),
        (["--duration", "300.5"], "whole number of samples"),
        (["--duration", "inf"], "whole number of samples"),
        (["--varied"], "--varied"),
        (["--only", "payload"], "--only payload"),
        (["--foreign", str(HERE / "foreign.py")], "TightSpot is no"),
    ],
)
def test_what_cannot_be_used_is_told_in_a_line(
    words: list[str], reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    assert main(["blind", "--actuator", *words]) == 1
    told = capsys.readouterr().err
    assert reason in told
    assert told.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_the_booms_effects_are_none_of_an_actuators(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["blind", "--foreign", str(HERE / "foreign_actuator.py")]) == 1
    assert "WanderingGain is no emir_analysis.blind.hidden.Hidden" in capsys.readouterr().err

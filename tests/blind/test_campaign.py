"""The blind test itself: repeatable machines, nothing lost, figures that mean what they say."""

import json
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from emir_analysis.blind import campaign as campaigns
from emir_analysis.blind import puzzle as puzzles
from emir_analysis.blind import trial as trials
from emir_analysis.blind.campaign import campaign, workers
from emir_analysis.blind.catalogue import CATALOGUE
from emir_analysis.blind.family import Secret, family
from emir_analysis.blind.hidden import Hidden
from emir_analysis.blind.machine import NotSolvedError
from emir_analysis.blind.numbers import (
    DATA_SHEET,
    SIGNAL_MAP,
    data_sheet,
    read_numbers,
    signal_map,
)
from emir_analysis.blind.plan import Plan, foreign_effects
from emir_analysis.blind.puzzle import MATTERS, difference, puzzle
from emir_analysis.blind.recording import SEEN_IN, Run
from emir_analysis.blind.report import report
from emir_analysis.blind.trial import Outcome
from emir_analysis.blind.turns import KINDS, hidden_in
from emir_analysis.blind.varied import varied
from emir_analysis.cli import main
from emir_analysis.errors import InputError
from emir_analysis.signals import read_signal_map
from emir_plant.effects import REGISTRY
from emir_plant.sheet import load_sheet

FOREIGN = (Path(__file__).parent / "foreign.py").read_text()


def outcome(
    machine: int, kind: str, hidden: list[str], verdict: str, named: list[str] | None = None
) -> Outcome:
    """Return an outcome with errors of 3, 2 and 1 times the noise."""
    stages = {"nominal": 3.0, "refitted": 2.0, "with_effect": 1.0}
    errors = {stage: {"piston_stroke": value} for stage, value in stages.items()}
    return Outcome(machine, kind, hidden, {}, 0.1, verdict, named or [], [], "", errors, 1.0)


def fake(plan: Plan, number: int, threads: int, keep: Path | None = None) -> Outcome:
    """Answer at once."""
    return outcome(number, "none", [], "nothing_missing")


@pytest.fixture(autouse=True)
def no_diagnosis(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is diagnosed here, and nobody waits long."""
    monkeypatch.setattr(campaigns, "PATIENCE", 0.5)
    monkeypatch.setattr(campaigns, "trial", fake)


def test_the_catalogue_is_all_of_the_registry() -> None:
    assert {effect.name for effect in CATALOGUE} == REGISTRY.keys()
    assert not {effect.name for effect in foreign_effects(FOREIGN, Hidden)} & REGISTRY.keys()


def test_every_effect_has_its_turn() -> None:
    of_one = [k for k in range(6 * len(CATALOGUE)) if KINDS[k % len(KINDS)] == "one"]
    drawn = [hidden_in(7, k, CATALOGUE, ())[0].name for k in of_one[: len(CATALOGUE)]]
    assert sorted(drawn) == sorted(REGISTRY)


def test_a_seed_gives_the_same_machine_and_its_effect_matters(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(puzzles, "PROBE", 4.0)
    stated = read_numbers(DATA_SHEET)
    one, same = (puzzle(stated, 11, 0, (), 4.0, ("payload",)) for _ in range(2))
    assert one.hidden == same.hidden
    assert one.size == same.size >= MATTERS
    np.testing.assert_array_equal(one.learn.commands, same.learn.commands)
    np.testing.assert_array_equal(
        one.judge.shown["pressure_lifting"], same.judge.shown["pressure_lifting"]
    )
    for name, tolerance in stated.tolerances.items():
        factor = getattr(one.machine.n, name) / getattr(stated.numbers, name)
        assert abs(factor - 1.0) <= tolerance


def test_a_machine_in_which_nothing_matters_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(puzzles, "_large_enough", lambda *_: (None, 0.0))
    with pytest.raises(NotSolvedError, match="of 30 draws"):
        puzzle(read_numbers(DATA_SHEET), 11, 0, (), 4.0)


def test_a_diagnosis_that_does_not_end_is_an_outcome(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Of this machine alone: the campaign goes on, and knows it when it is continued."""

    def endless(*_: object, timeout: float, **__: object) -> None:
        raise subprocess.TimeoutExpired("emir diagnose", timeout)

    secret = Secret("none", (), {}, 0.0, {})
    boom = family(actuator=False)._replace(made=lambda *_: secret)
    monkeypatch.setattr(trials, "family", lambda **_: boom)
    monkeypatch.setattr(subprocess, "run", endless)
    answered = trials.trial(Plan(1, 60.0, ""), 3, 1, tmp_path)
    assert (answered.machine, answered.verdict) == (3, "failed")
    assert "no answer within 3600 s" in answered.failure


def test_a_varied_machine_is_another_one_that_works_as_well(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """It rests and moves, no pressure far above the pump's, and its sheet can be read."""
    monkeypatch.setattr(puzzles, "PROBE", 4.0)
    for seed in range(8):
        stated = varied(read_numbers(DATA_SHEET), np.random.default_rng(seed))
        n = stated.numbers
        assert 0.4 * 22.5 <= n.boom_length <= 1.3 * 22.5
        made = puzzle(stated, seed, 1, (), 6.0)
        shown = made.learn.shown
        assert shown["angle"].size == round(6.0 / n.command_period) * n.command_period * n.rate // 1
        assert np.ptp(shown["angle"]) > 0.01
        for name in ("pressure_lifting", "pressure_lowering"):
            assert shown[name].min() > -1e5
            assert shown[name].max() < 1.5 * n.p0
        (tmp_path / "sheet.yaml").write_text(data_sheet(stated))
        sheet = load_sheet(tmp_path / "sheet.yaml", strict=True)
        assert sheet.machine.geometry.boom_length == n.boom_length
        assert sheet.tolerances["cylinder.beta"] == stated.tolerances["beta"]


def test_what_no_sensor_shows_does_not_matter() -> None:
    time = np.linspace(0.0, 1.0, 11)
    shown = dict.fromkeys(SEEN_IN, time)
    plain = Run(np.zeros(3), shown)
    bent = Run(plain.commands, shown | {"deflection": time + 1.0})
    assert difference(bent, plain, ("pressure_lowering",)) > MATTERS
    assert difference(bent, plain, ("tip_deflection_angle",)) == 0.0
    turned = Run(plain.commands, shown | {"angle": time + 1.0})
    assert difference(turned, plain, ("joint_angle",)) > MATTERS  # the stroke shows it


def test_a_smaller_machine_has_a_smaller_load_hidden_in_it() -> None:
    payload = next(effect for effect in CATALOGUE if effect.name == "payload")
    emir = read_numbers(DATA_SHEET).numbers
    half = emir.with_factors({"boom_mass": 0.5})
    as_is, smaller = (payload.drawn(np.random.default_rng(3), n)["mass"] for n in (emir, half))
    assert as_is == payload.draw(np.random.default_rng(3))["mass"]
    assert smaller == 0.5 * as_is


def test_a_signal_map_leaves_out_the_sensors_that_are_missing(tmp_path: Path) -> None:
    (tmp_path / "signals.yaml").write_text(signal_map(("pressure_lowering",)))
    left = read_signal_map(tmp_path / "signals.yaml")
    assert left.keys() == read_signal_map(SIGNAL_MAP).keys() - {"pressure_lowering"}


def test_an_interrupted_test_goes_on_where_it_was(tmp_path: Path) -> None:
    log, plan, told = tmp_path / "log.jsonl", Plan(1, 60.0), []

    def until_the_third(line: str) -> None:
        told.append(line)
        if len(told) == 3:
            raise KeyboardInterrupt

    with ThreadPoolExecutor(1) as executor, pytest.raises(KeyboardInterrupt):
        campaign(plan, 5, log, executor, until_the_third)
    with log.open("a") as lines:
        lines.write('{"machine": 4, "ki')  # cut off in the middle of a line
    with ThreadPoolExecutor(1) as executor:
        outcomes = campaign(plan, 5, log, executor, told.append)
    assert [o.machine for o in outcomes] == [0, 1, 2, 3, 4]
    assert f"{log} has 3 of 5 machines" in told
    assert len(log.read_text().splitlines()) == 1 + 5
    for line in log.read_text().splitlines():
        json.loads(line)


def test_the_log_of_another_seed_is_not_continued(tmp_path: Path) -> None:
    log = tmp_path / "log.jsonl"
    with ThreadPoolExecutor(1) as executor:
        campaign(Plan(1, 60.0), 1, log, executor, lambda _: None)
        with pytest.raises(InputError, match="another seed"):
            campaign(Plan(2, 60.0), 1, log, executor, lambda _: None)


def test_a_cluster_does_the_same_work(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    quiet: list[str] = []
    with (
        distributed.LocalCluster(n_workers=1, processes=False, dashboard_address=None) as cluster,
        workers(1, cluster.scheduler_address) as executor,
    ):
        outcomes = campaign(Plan(1, 60.0), 3, tmp_path / "log", executor, quiet.append)
    assert [o.machine for o in outcomes] == [0, 1, 2]
    assert len(quiet) == 3


def test_figures_mean_what_they_say() -> None:
    outcomes = [
        outcome(0, "one", ["payload"], "found", ["payload"]),
        outcome(1, "one", ["payload"], "found", ["viscous_friction"]),
        outcome(2, "one", ["backlash"], "nothing_missing"),
        outcome(3, "two", ["payload", "backlash"], "found", ["backlash", "payload"]),
        outcome(4, "two", ["payload", "backlash"], "found", ["payload"]),
        outcome(5, "none", [], "nothing_missing"),
        outcome(6, "none", [], "found", ["payload"]),
        outcome(7, "foreign", ["tight_spot"], "unexplained"),
        outcome(8, "foreign", ["tight_spot"], "found", ["coulomb_friction"]),
        outcome(9, "foreign", ["tight_spot"], "unexplained"),
    ]
    lines = [" ".join(line.split()) for line in report(outcomes).splitlines()]
    assert "payload 1 payload, 1 viscous_friction" in lines
    assert "tight_spot (foreign) 2 unexplained, 1 coulomb_friction" in lines
    assert "one effect, named 1 of 3" in lines
    assert "two effects, both named 1 of 2" in lines
    assert "one of them, and no other 1 of 2" in lines
    assert "a wrong effect named 1 of 5" in lines
    assert "an effect of the catalogue called nothing 1 of 5" in lines
    assert "healthy machine, false alarm 1 of 2" in lines
    assert "foreign effect, unexplained 2 of 3" in lines
    assert "and yet modelled, within twice the noise 2 of 3" in lines
    assert "piston_stroke 3.00 (3.00) 2.00 (2.00) 1.00 (1.00)" in lines
    assert "every signal within 1.1 times the noise: 2 of 2" in lines


def test_intervals_count_where_the_machine_was_understood() -> None:
    """As built inside two of three intervals; of a foreign effect none is asked."""
    right = outcome(0, "none", [], "nothing_missing")
    wrong = outcome(1, "none", [], "found", ["payload"])
    foreign = outcome(2, "foreign", ["tight_spot"], "unexplained")
    right.intervals.update({"a": [1.0, 0.9, 1.1], "b": [1.0, 1.0, 1.1], "c": [1.0, 0.8, 0.9]})
    for other in (wrong, foreign):
        other.intervals["a"] = [1.0, 2.0, 3.0]
    (line,) = report([right, wrong, foreign]).splitlines()[-1:]
    assert " ".join(line.split()) == "numbers of the machine inside their intervals 2 of 3"


def test_what_a_machine_was_built_with_has_the_diagnosis_s_names(tmp_path: Path) -> None:
    """Those of the data sheet's tolerances, within which they are."""
    stated = read_numbers(DATA_SHEET)
    (tmp_path / "sheet.yaml").write_text(data_sheet(stated))
    tolerances = load_sheet(tmp_path / "sheet.yaml").tolerances
    assert stated.toleranced.keys() == tolerances.keys()
    for path, name in stated.toleranced.items():
        assert stated.tolerances[name] == tolerances[path]


def test_machines_may_have_different_sensors() -> None:
    """The figures of a signal are those of the machines that have it."""
    outcomes = [outcome(k, "one", ["payload"], "found", ["payload"]) for k in range(3)]
    for stage, errors in outcomes[1].errors.items():
        errors["pressure_lifting"] = 5.0 if stage == "nominal" else 1.0
    lines = [" ".join(line.split()) for line in report(outcomes).splitlines()]
    assert "pressure_lifting 5.00 (5.00) 1.00 (1.00) 1.00 (1.00)" in lines
    assert "every signal within 1.1 times the noise: 3 of 3" in lines


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--machines", "0"], "--machines 0"),
        (["--jobs", "0"], "--jobs 0"),
        (["--seed", "-1"], "--seed -1"),
        (["--duration", "3"], "at least 20 s"),
        (["--only", "magic"], "--only magic"),
        (["--foreign", "nowhere.py"], "nowhere.py"),
        (["--foreign", str(DATA_SHEET)], "foreign effects' file"),
        (["--scheduler", "127.0.0.1:1"], "--scheduler 127.0.0.1:1"),
        (["--log", "nowhere/log.jsonl"], "nowhere/log.jsonl: no such folder"),
        (["--keep", str(DATA_SHEET)], f"{DATA_SHEET}: File exists"),
    ],
)
def test_what_cannot_be_used_is_told_in_a_line(
    words: list[str],
    reason: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    if "--scheduler" in words:
        pytest.importorskip("distributed")
    assert main(["blind", *words]) == 1
    told = capsys.readouterr().err
    assert reason in told
    assert told.count("\n") == 1

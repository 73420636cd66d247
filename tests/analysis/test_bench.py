"""The benchmarks run and say what they compare; how fast anything is, no test decides."""

import json
import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from emir_analysis.bench.joint import SAMPLE, Task, plain_c
from emir_analysis.bench.quadratic_program import Problem, Query, by_do_mpc, by_osqp
from emir_analysis.cli import main
from emir_control import pfc_file
from emir_control.pfc_file import STROKE
from emir_plant.plant import Plant
from emir_plant.sheet import joint1


@pytest.fixture(scope="module")
def task() -> Task:
    return Task(Plant(joint1()))


def test_plain_c_is_the_same_model(task: Task) -> None:
    if shutil.which("cc") is None:
        pytest.skip("no C compiler (cc)")
    with plain_c(task.plant) as c:
        theirs = task.shown(c.simulate(task.small_start, task.commands, SAMPLE / 20))
    ours = task.ours(SAMPLE / 20)
    assert (np.abs(ours - theirs) / np.ptp(ours, axis=0)).max() < 1e-10


def test_lsoda_confirms_the_reference(task: Task) -> None:
    reference, theirs = task.ours(SAMPLE / 800), task.lsoda(1e-7)
    assert (np.abs(reference - theirs) / np.ptp(reference, axis=0)).max() < 1e-5


def _assert_measured(parts: dict[str, list[dict[str, Any]]]) -> None:
    """Every figure has a value, or a note that says why not."""
    for figure in (figure for figures in parts.values() for figure in figures):
        assert figure["note"] if figure["value"] is None else figure["value"] > 0.0


def test_the_plant_is_measured_beside_others(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("pinocchio", reason="the robot needs Pinocchio")
    file = tmp_path / "bench.json"
    assert main(["bench", "plant", "--seconds", "0.01", "--json", str(file)]) == 0
    parts = json.loads(file.read_text())
    names = [figure["name"] for figures in parts.values() for figure in figures]
    for expected in ("numba", "plain C", "LSODA", "step", "16 on 1 core", "robot", "MuJoCo"):
        assert any(expected in name for name in names)
    _assert_measured(parts)
    shown = capsys.readouterr().out
    assert all(title in shown for title in parts)


def test_the_controllers_are_measured_beside_others(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "bench.json"
    assert main(["bench", "control", "--seconds", "0.01", "--json", str(file)]) == 0
    shown = capsys.readouterr().out
    for name in ("force_loop", "cascade", "pfc", "pfc_tip", "lqg", "OSQP", "do-mpc"):
        assert name in shown
    for figure in (
        figure for figures in json.loads(file.read_text()).values() for figure in figures
    ):
        assert figure["note"] if figure["value"] is None else figure["value"] > 0.0


def test_what_is_missing_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for module in ("osqp", "do_mpc"):
        monkeypatch.setitem(sys.modules, module, None)
    assert main(["bench", "control", "--seconds", "0.01"]) == 0
    assert "osqp is not installed: pip install 'emir_ros[bench]'" in capsys.readouterr().out


def test_both_solvers_give_the_same_command() -> None:
    """They are given the same problem; one of them condensed by us, the other one not."""
    pytest.importorskip("osqp")
    pytest.importorskip("do_mpc")
    problem = Problem.of(pfc_file.load(pfc_file.default_file(STROKE), STROKE))
    condensed, sparse = by_osqp(problem), by_do_mpc(problem)
    state, ramp = np.zeros(len(problem.A)), np.arange(1.0, problem.horizon + 1.0)
    for last, slope in ((0.0, 1e-4), (0.02, -1e-4), (0.0, 1e-2), (-0.05, -1e-2)):
        query = Query(state, last, slope * ramp)
        command = condensed(query)
        assert command == pytest.approx(sparse(query), abs=1e-6)
        assert abs(command) <= problem.speed + 1e-6
        assert abs(command - last) <= problem.change + 1e-6


def test_seconds_have_to_be_positive(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "plant", "--seconds", "0"]) == 1
    assert "--seconds 0: has to be positive" in capsys.readouterr().err

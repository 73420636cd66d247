"""The benchmarks run and say what they compare; how fast anything is, no test decides."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from emir_analysis.bench.joint import SAMPLE, Task, plain_c
from emir_analysis.cli import main
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
    for figure in (figure for figures in parts.values() for figure in figures):
        assert figure["note"] if figure["value"] is None else figure["value"] > 0.0
    shown = capsys.readouterr().out
    assert all(title in shown for title in parts)


def test_seconds_have_to_be_positive(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "plant", "--seconds", "0"]) == 1
    assert "--seconds 0: has to be positive" in capsys.readouterr().err

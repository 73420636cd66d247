"""Recordings of the simulated runs beside the measured ones."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from emir_analysis.diagnosis.experiment import Experiment
from emir_analysis.diagnosis.predictions import STAGES, write_predictions


def test_two_judge_recordings_of_one_name_are_both_written(tmp_path: Path) -> None:
    outputs = np.zeros((3, 4))
    experiments = [
        Experiment(f"{day}/run.mcap", 0.01, np.zeros(20), np.zeros(3), outputs, 1)
        for day in ("monday", "tuesday")
    ]
    judged = SimpleNamespace(
        evidence=SimpleNamespace(experiments=experiments),
        runs={stage: [outputs, outputs] for stage in STAGES},
    )
    write_predictions(tmp_path / "runs", cast("Any", judged))
    assert len(list((tmp_path / "runs").glob("*.mcap"))) == 2 * len(STAGES)

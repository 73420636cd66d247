"""The graph's benchmark measures what it says; how fast anything is, no test decides."""

import gc
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from emir_ros import bench


def test_latency_is_measured_between_processes() -> None:
    title, figures = bench._latency(100.0, 0.5)
    values = {figure.name: figure.value for figure in figures}
    assert "100 Hz" in title
    assert 0.0 < values["median"] <= values["p99"] <= values["largest"]
    assert 0.0 <= values["lost"] < 100.0


def test_what_a_slow_sender_sends_is_recorded_to_the_last_message(tmp_path: Path) -> None:
    gc.collect()  # else a node of an earlier test may listen in this domain before the recorder
    _, figures = bench._recorder(tmp_path / "bag", 0.5, rate=200.0)
    values = {figure.name: figure.value for figure in figures}
    assert values["lost"] == 0
    assert values["recorded"] > 0


def test_durations_have_to_be_positive(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        bench.main(["--jitter", "0"])
    assert "argument --jitter: 0: has to be positive" in capsys.readouterr().err

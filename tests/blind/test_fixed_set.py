"""The small fixed set: made, recorded, diagnosed by the command and answered for."""

import json
from pathlib import Path

import pytest

from emir_analysis.cli import main


def test_a_load_is_found_that_nobody_told_of(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "log.jsonl"
    words = ["--machines", "1", "--seed", "3", "--duration", "20", "--only", "payload"]
    assert main(["blind", *words, "--jobs", "1", "--log", str(log)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "payload 1 payload" in said
    assert "one effect, named 1 of 1" in said
    _, one = (json.loads(line) for line in log.read_text().splitlines())
    assert max(one["errors"]["with_effect"].values()) < 1.2
    assert max(one["errors"]["refitted"].values()) > 5.0

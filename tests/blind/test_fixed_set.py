"""The small fixed set: machines made, recorded, diagnosed by the command and answered for."""

import json
from pathlib import Path

import pytest

from emir_analysis.cli import main


def test_a_load_is_found_and_a_healthy_machine_left_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "log.jsonl"
    words = ["--machines", "2", "--seed", "3", "--duration", "20", "--only", "payload"]
    assert main(["blind", *words, "--jobs", "1", "--log", str(log)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "payload 1 payload" in said
    assert "nothing 1 nothing_missing" in said
    assert "one effect, named 1 of 1" in said
    assert "healthy machine, false alarm 0 of 1" in said
    one, none = (json.loads(line) for line in log.read_text().splitlines()[1:])
    assert max(one["errors"]["with_effect"].values()) < 0.2 * max(one["errors"]["nominal"].values())
    assert max(none["errors"]["refitted"].values()) < 1.2

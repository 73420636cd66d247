"""A graph that does not start: one clear line, and nothing written."""

from pathlib import Path

import pytest

from emir_ros.run import main as run_graph


def refusal(
    words: list[str], parameters: str, folder: Path, capfd: pytest.CaptureFixture[str]
) -> str:
    """Return the one line that `emir run` says of these words and this parameter file's text."""
    bag = folder / "run"
    if parameters:
        file = folder / "params.yaml"
        file.write_text(parameters)
        words = [*words, "--params", str(file)]
    assert run_graph([*words, "--bag", str(bag)]) == 1
    error = capfd.readouterr().err.strip()
    assert len(error.splitlines()) == 1
    assert not bag.exists()
    return error

"""`emir urdf` writes a file that another library's parser reads."""

from pathlib import Path

import pytest

pin = pytest.importorskip("pinocchio", reason="Pinocchio is missing: pip install 'emir_ros[robot]'")

from emir_analysis.cli import main  # noqa: E402 (only with Pinocchio)


def test_file_holds_the_whole_robot(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "emir.urdf"
    assert main(["urdf", str(file)]) == 0
    model = pin.buildModelFromUrdf(str(file))
    assert model.nv == 114
    assert model.existFrame("tcp")
    assert "114 joints" in capsys.readouterr().out


def test_bad_input_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["urdf", str(tmp_path / "no" / "emir.urdf")]) == 1
    assert main(["urdf", str(tmp_path / "a"), "--robot", str(tmp_path / "none.yaml")]) == 1
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 2
    assert "no such folder" in lines[0]
    assert "none.yaml" in lines[1]

"""Outputs that cannot be written are told before the work."""

from collections.abc import Callable
from pathlib import Path

import pytest

from emir_analysis.cli import main
from emir_analysis.errors import InputError
from emir_analysis.outputs import check_outputs, check_picture, write_all
from emir_common.quantity import ParameterError


def test_what_can_be_written_passes(tmp_path: Path) -> None:
    (tmp_path / "old.json").touch()
    check_outputs([tmp_path / "old.json", None], tmp_path / "runs", [tmp_path / "sheet.yaml"])


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (lambda t: ([t / "no" / "a.json"], None), "no such folder"),
        (lambda t: ([t], None), "not a file"),
        (lambda _: ([Path("/dev/full")], None), "not a file"),
        (lambda t: ([t / "a.json", t / "a.json"], None), "another output"),
        (lambda t: ([t / "." / "sheet.yaml"], None), "an input"),
        (lambda t: ([], t), "exists already"),
        (lambda t: ([t / "bag" / "bag_0.mcap"], None), "which is read"),
        (lambda t: ([t / "bag" / "new.json"], None), "which is read"),
        (lambda t: ([], t / "bag" / "runs"), "which is read"),
        (lambda t: ([], t / "sheet.yaml" / "runs"), "which is read"),
        (lambda t: ([], t / "other.yaml" / "runs"), "is not a folder"),
        (lambda t: ([t / "runs"], t / "runs"), "another output"),
        (lambda _: ([Path("/sys/a.json")], None), "may not be written"),
        (lambda _: ([], Path("/sys/runs")), "may not be written"),
    ],
)
def test_what_cannot_be_written_is_told(
    asked: Callable[[Path], tuple[list[Path], Path | None]], said: str, tmp_path: Path
) -> None:
    (tmp_path / "sheet.yaml").touch()
    (tmp_path / "other.yaml").touch()
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "bag_0.mcap").touch()
    files, folder = asked(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(InputError, match=said):
        check_outputs(files, folder, [tmp_path / "sheet.yaml", tmp_path / "bag"])
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("name", ["curve.bla", "curve", "curve.", "curve.yaml"])
def test_a_picture_of_no_kind_is_told(name: str) -> None:
    with pytest.raises(InputError, match=rf"^{name}: no kind of picture; there are .*, \.png, "):
        check_picture(Path(name))


@pytest.mark.parametrize("name", ["curve.png", "curve.SVG", "my.curve.pdf", None])
def test_a_picture_that_can_be_drawn_passes(name: str | None) -> None:
    check_picture(None if name is None else Path(name))


@pytest.mark.parametrize(
    "words",
    [
        ["limit", "--picture"],
        ["yardstick", "--picture"],
        ["yardstick", "--json"],
        ["disturb", "--picture"],
        ["compare", "--picture"],
        ["design", "--out"],
        ["design", "--out", "pfc.yaml", "--picture"],
        ["urdf"],
        ["bench", "plant", "--json"],
    ],
)
def test_commands_tell_it_before_the_work(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nothing was done: there is no word of progress, and no result."""
    file = tmp_path / "no" / "out.png"
    assert main([*words, str(file)]) == 1
    captured = capsys.readouterr()
    assert captured.err == f"emir {words[0]}: {file}: no such folder {file.parent}\n"
    assert captured.out == ""


def test_a_design_does_not_take_its_machines_place(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sheet = tmp_path / "machine.yaml"
    sheet.write_text("valve: {dead_zone: 0.1}")
    assert main(["design", "--from", str(sheet), "--out", str(sheet)]) == 1
    assert "an input or another output is of that name" in capsys.readouterr().err
    assert sheet.read_text() == "valve: {dead_zone: 0.1}"


def test_one_output_that_fails_costs_no_other(tmp_path: Path) -> None:
    def full(file: Path) -> None:
        raise InputError(f"{file}: No space left on device")

    def out_of_range(file: Path) -> None:
        raise ParameterError(f"{file}: mass = -1 kg")

    a, b, c = (tmp_path / name for name in "abc")
    failed = write_all([(a, full), (None, full), (b, out_of_range), (c, Path.touch)])
    assert [str(error) for error in failed] == [
        f"{a}: No space left on device",
        f"{b}: mass = -1 kg",
    ]
    assert c.exists()

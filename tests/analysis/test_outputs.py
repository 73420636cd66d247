"""Outputs that cannot be written are told before the work."""

from collections.abc import Callable
from pathlib import Path

import pytest

from emir_analysis.errors import InputError
from emir_analysis.outputs import check_outputs


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
    ],
)
def test_what_cannot_be_written_is_told(
    asked: Callable[[Path], tuple[list[Path], Path | None]], said: str, tmp_path: Path
) -> None:
    (tmp_path / "sheet.yaml").touch()
    files, folder = asked(tmp_path)
    with pytest.raises(InputError, match=said):
        check_outputs(files, folder, [tmp_path / "sheet.yaml"])

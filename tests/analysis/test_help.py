"""`emir COMMAND --help`: it says what a command does, explains all options, names what there is."""

import re

import pytest

from emir_analysis import compare, compare_grid, yardstick
from emir_analysis.cli import main
from emir_plant.sheet import joint1

COMMANDS = (
    ["import"], ["info"], ["bag"], ["bag", "recover"], ["replay"], ["view"], ["analyze"],
    ["compare"], ["limit"], ["yardstick"], ["disturb"], ["design"], ["linearize"], ["figures"],
    ["diagnose"], ["urdf"], ["blind"], ["bench"], ["bench", "diagnosis"],
)  # fmt: skip


def _help(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    with pytest.raises(SystemExit) as ended:
        main([*words, "--help"])
    assert ended.value.code == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_every_command_says_what_it_does_and_explains_its_options(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    usage, about, *groups = _help(capsys, *words).split("\n\n")
    assert usage.startswith(f"usage: emir {' '.join(words)} ")
    assert groups, "no description"
    assert not about.startswith(("`emir", "options:", "positional"))
    for group in groups:
        _, *lines = group.splitlines()
        entries = re.split(r"\n(?=  \S)", "\n".join(lines))  # an entry goes on further in
        for entry in entries:
            named, *explained = re.split(r"\s{2,}", entry.strip(), maxsplit=1)
            assert explained, f"{named}: no help"


@pytest.mark.parametrize("command", ["yardstick", "disturb"])
def test_the_help_names_every_controller(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    said = _words(_help(capsys, command))
    assert yardstick.controllers(joint1()).keys() <= said


def test_the_help_of_compare_names_every_controller_and_model_error(
    capsys: pytest.CaptureFixture[str],
) -> None:
    text = _help(capsys, "compare")
    others = yardstick.controllers(joint1())
    for name in (*compare.controllers(), *others):
        assert set(name.split(", ")) <= _words(text)
    for error in compare_grid.ERRORS:
        assert error in " ".join(text.split())


def _words(text: str) -> set[str]:
    return set(re.findall(r"\w+", text))

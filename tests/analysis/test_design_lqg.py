"""`emir design --controller lqg`: the file that the node loads, and what cannot be."""

from pathlib import Path

import pytest
import yaml

import emir_plant
from emir_analysis import design_lqg
from emir_analysis.cli import main
from emir_control.softness import CASES, Robustness


def test_it_writes_the_nodes_parameters_and_shows_the_map(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """By one case in place of twelve, and a map of one place. A late valve is told to the node."""
    monkeypatch.setattr(design_lqg, "Robustness", lambda p, cases=CASES[:1]: Robustness(p, cases))
    monkeypatch.setattr(design_lqg, "ANGLES", design_lqg.ANGLES[1:2])
    monkeypatch.setattr(design_lqg, "PAYLOADS", design_lqg.PAYLOADS[:1])
    sheet, file = tmp_path / "late.yaml", tmp_path / "lqg.yaml"
    whole = Path(emir_plant.__file__).parent / "data" / "joint1.yaml"
    sheet.write_text(f"based_on: {whole}\neffects: {{command_delay: {{delay: 0.032}}}}\n")
    words = ["design", "--from", str(sheet), "--controller", "lqg", "--out", str(file)]
    assert main([*words, "--oil-tolerance", "0.2"]) == 0
    told = yaml.safe_load(file.read_text())["lqg_node"]["ros__parameters"]
    assert 0.8 < told["softness"] < 1.0
    assert told["regulator.delay"] == 0.032
    shown = capsys.readouterr().out
    assert f"softness {told['softness']:g}" in shown
    assert "oil 120% of the stated" in shown


def test_what_cannot_be_is_one_clear_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = tmp_path / "bag"
    bag.mkdir()
    words = ["design", "--controller", "mpc", "--out", str(tmp_path / "mpc.yaml")]
    for more, said in (
        (["--oil-tolerance", "0"], "oil_tolerance = 0: over 0 and up to 0.5"),
        (["--oil-tolerance", "nan"], "oil_tolerance = nan"),
        (["--order", "3"], "--order: of pfc and pfc_tip, not of mpc"),
        (["--schedule", "--angle", "30"], "--angle, --schedule: of pfc and pfc_tip"),
        (["--from", str(bag)], "--controller mpc: a machine's YAML is needed"),
    ):
        assert main([*words, *more]) == 1
        assert said in capsys.readouterr().err

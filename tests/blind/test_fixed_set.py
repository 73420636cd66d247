"""The small fixed set: made, recorded, diagnosed by the command and answered for."""

import json
from pathlib import Path

import numpy as np
import pytest

from emir_analysis.blind.plan import Plan
from emir_analysis.blind.trial import trial
from emir_analysis.blind.turns import KINDS
from emir_analysis.cli import main

HERE = Path(__file__).parent
FOREIGN, THIRD, STATED = [
    (HERE / name).read_text() for name in ("foreign.py", "foreign_third.py", "foreign_stated.py")
]


def test_edges_that_close_along_the_stroke_have_no_name_but_a_curve(tmp_path: Path) -> None:
    """A cushion at the upper end, which the second model makes and no effect of the registry."""
    plan = Plan(seed=502, duration=30.0, foreign=FOREIGN, only=("end_cushion",))
    outcome = trial(plan, KINDS.index("foreign"), threads=1, keep=tmp_path)
    assert outcome.hidden == ["end_cushion"]
    assert (outcome.verdict, outcome.named) == ("unexplained", []), outcome.failure
    assert max(outcome.errors["refitted"].values()) > 10.0
    assert max(outcome.errors["with_effect"].values()) < 2.0
    (answer,) = tmp_path.glob("*/answer.json")
    curve = json.loads(answer.read_text())["curve"]
    assert (curve["name"], curve["over"]) == ("unnamed_opening", "piston_stroke")
    s = outcome.sizes
    inside = np.clip((np.array(curve["signal"]) - s["cushion_from"]) / 0.1, 0.0, 1.0)
    law = -s["cushion"] * inside * inside * (3.0 - 2.0 * inside)
    assert curve["parts"]["change"] == pytest.approx(law, abs=0.1 * s["cushion"])


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


def test_a_pump_that_hunts_has_no_name_but_a_period(tmp_path: Path) -> None:
    plan = Plan(seed=601, duration=30.0, foreign=THIRD, only=("hunting_pump",))
    outcome = trial(plan, KINDS.index("foreign"), threads=1, keep=tmp_path)
    assert outcome.hidden == ["hunting_pump"]
    assert (outcome.verdict, outcome.named) == ("unexplained", []), outcome.failure
    (answer,) = tmp_path.glob("*/answer.json")
    swing = json.loads(answer.read_text())["swing"]
    assert swing["predictor"] == "valve_command"
    assert swing["period"] == pytest.approx(1.0 / outcome.sizes["swings_at"], rel=0.02)
    assert f"swings with a period of {swing['period']:.3g} s" in outcome.statement
    amplitude = {command: row for command, _, row in swing["table"]}
    assert amplitude[max(amplitude)] > 10.0 * amplitude[min(amplitude)]  # the pump lifts


def test_a_value_that_the_data_sheet_states_wrongly_is_told(tmp_path: Path) -> None:
    """Other return edges of the spool, in the second model."""
    plan = Plan(seed=61, duration=25.0, foreign=STATED, only=("other_throttle",))
    outcome = trial(plan, KINDS.index("foreign"), threads=1, keep=tmp_path)
    assert outcome.hidden == ["other_throttle"]
    assert (outcome.verdict, outcome.named) == ("unexplained", []), outcome.failure
    assert max(outcome.errors["refitted"].values()) > 5.0
    assert max(outcome.errors["with_effect"].values()) < 1.1
    (answer,) = tmp_path.glob("*/answer.json")
    best, *_ = json.loads(answer.read_text())["misstated"]
    assert best["name"] == "resistances.k_meter_out_lifting"
    assert best["wanted"]["value"] / best["stated"] == pytest.approx(outcome.sizes["factor"], 0.01)

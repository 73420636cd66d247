"""A search whose time is over ends with the best that it has found."""

from dataclasses import replace

import pytest
from operated import moved

from emir_analysis.diagnosis import time_limit
from emir_analysis.diagnosis.diagnose import Findings, diagnose
from emir_analysis.diagnosis.judged import judged
from emir_analysis.diagnosis.statement import statement
from emir_analysis.diagnosis.time_limit import TimeLimit
from emir_common.parameter_tree import with_values
from emir_plant.sheet import Sheet, joint1

TOLERANCES = {"cylinder.beta": 0.15, "valve.flow_nominal": 0.03}
FRICTION = {"effects.viscous_friction.coefficient": 1e5}  # N s/m
LONG = 1e3  # s


def _diagnosed(
    monkeypatch: pytest.MonkeyPatch, missing: dict[str, float], until: str
) -> tuple[Findings, str]:
    """Return findings and statement of a search whose time is over once it says something."""
    now = 0.0

    def said(line: str) -> None:
        nonlocal now
        if until in line:
            now = 2.0 * LONG

    monkeypatch.setattr(time_limit, "monotonic", lambda: now)
    run = replace(moved(with_values(joint1(), missing)), name="run")
    findings = diagnose([run], Sheet(joint1(), TOLERANCES, {}, ()), said, LONG)
    return findings, statement(findings, judged(findings, [run]))


def test_what_was_found_in_time_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    findings, said = _diagnosed(monkeypatch, FRICTION, "fitting to the whole recording")
    assert (findings.verdict, findings.chosen.effects) == ("found", ("viscous_friction",))
    friction = findings.chosen.machine.effects.viscous_friction.coefficient
    assert friction == pytest.approx(1e5, rel=0.02)
    assert "the search was stopped after 1000 s" in said


def test_what_was_not_found_in_time_is_unexplained(monkeypatch: pytest.MonkeyPatch) -> None:
    findings, said = _diagnosed(monkeypatch, FRICTION, "all effects beside")
    assert findings.verdict == "unexplained"
    assert findings.chosen.effects == ()
    assert "the search was stopped after 1000 s" in said


def test_a_machine_that_lacks_nothing_needs_no_search(monkeypatch: pytest.MonkeyPatch) -> None:
    findings, said = _diagnosed(monkeypatch, {}, "parameters only")
    assert findings.verdict == "nothing_missing"
    assert "stopped" not in said


def test_a_search_in_time_is_not_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    findings, said = _diagnosed(monkeypatch, FRICTION, "judging")
    assert findings.chosen.effects == ("viscous_friction",)
    assert findings.stopped is None
    assert "stopped" not in said


def test_only_work_within_a_limit_ends_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr(time_limit, "monotonic", lambda: now[0])
    limit = TimeLimit(1.0)

    def work() -> str:
        now[0] += 0.75
        limit.check()
        return "work"

    assert limit.within(work, lambda: "otherwise") == "work"
    assert limit.within(work, lambda: "otherwise") == "otherwise"
    assert limit.is_over
    assert work() == "work"
    assert limit.within(work, lambda: "otherwise") == "otherwise"


def test_what_follows_a_search_that_was_stopped_has_a_share_of_its_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = [0.0]
    monkeypatch.setattr(time_limit, "monotonic", lambda: now[0])
    limit = TimeLimit(1.0)

    def takes(seconds: float) -> str:
        now[0] += seconds
        limit.check()
        return "work"

    assert limit.afterwards(lambda: takes(9.0), lambda: "left out") == "work"
    assert limit.within(lambda: takes(9.0), lambda: "stopped") == "stopped"
    assert limit.afterwards(lambda: takes(0.2), lambda: "left out") == "work"
    assert limit.afterwards(lambda: takes(0.3), lambda: "left out") == "left out"
    assert takes(9.0) == "work"

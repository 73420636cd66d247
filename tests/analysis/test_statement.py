"""What a diagnosis says of balances that speak, of what comes closest, and of other recordings."""

from types import SimpleNamespace

import numpy as np
import pytest

from emir_analysis.diagnosis import judgement, statement
from emir_analysis.diagnosis.balances import BALANCES
from emir_analysis.diagnosis.curves import Curve
from emir_analysis.diagnosis.judged import carries
from emir_analysis.diagnosis.judgement import _beyond, _foreseen, _furthest
from emir_analysis.diagnosis.remainder import _beside, remainder
from emir_analysis.diagnosis.statement import _rejected
from emir_analysis.diagnosis.where import Where

QUIET = {"force": 1.0, "lifting_chamber": 1.0, "lowering_chamber": 1.0, "bending": 1.0}


def test_a_sensor_that_only_those_read_that_speak_is_told() -> None:
    loudness = QUIET | {"lifting_chamber": 13.9, "force": 12.2, "bending": 17.9}
    said = _beside("lifting_chamber", ["force", "bending"], loudness)
    assert "force 12.2, bending 17.9; they all read pressure_lifting," in said


def test_without_such_a_sensor_the_others_are_told_alone() -> None:
    chambers = QUIET | {"lifting_chamber": 3.5, "lowering_chamber": 3.2}
    assert _beside("lifting_chamber", ["lowering_chamber"], chambers) == (
        "; beside it lowering_chamber 3.2"
    )
    loaded = QUIET | {"force": 141.0, "bending": 46.5}
    assert _beside("force", ["bending"], loaded) == "; beside it bending 46.5"
    assert _beside("force", [], QUIET | {"force": 141.0}) == ""


def _recorded(name: str, lifting: list[float], lowering: list[float]) -> SimpleNamespace:
    """A recording's evidence, as far as it is looked at here: pressures in bar."""
    outputs = np.column_stack([np.zeros(len(lifting)), lifting, lowering]) * 1e5
    return SimpleNamespace(name=name, experiments=[SimpleNamespace(outputs=outputs)])


def test_a_leak_is_measured_no_further_than_its_own_chamber_was() -> None:
    """The other one's pressure was lower: what a leak does there is not known."""
    learned = SimpleNamespace(evidence=_recorded("a", [70.0, 200.0], [8.0, 60.0]))
    other = SimpleNamespace(evidence=_recorded("b", [30.0, 40.0, 90.0, 150.0], [10.0] * 4))
    places = tuple(np.linspace(8e5, 200e5, 3))
    leak = Curve("unnamed_leakage", "own_pressure", "Pa", places, "m^3/s", {"lifting": (0, 0, 1)})
    assert "50 % lie beyond" in _beyond(leak, learned, other)
    lowering = Curve(*list(vars(leak).values())[:-1], {"lowering": (0, 0, 1)})
    assert _beyond(lowering, learned, other) == ""


def test_a_leak_from_the_pump_is_told_as_oil_that_comes_in() -> None:
    """At a pressure that the chamber had."""
    places = tuple(np.linspace(9e5, 190e5, 4))
    parts = {"lifting": (np.nan, -3e-6, -6.6e-6, 1e-7), "lowering": (1e-6, 0.0, np.nan, np.nan)}
    leak = Curve("unnamed_leakage", "own_pressure", "Pa", places, "m^3/s", parts)
    said = _furthest(leak, "lifting")
    assert said == (
        "as far as -6.6e-06 m^3/s of the lifting chamber, into which oil comes, at 1.3e+07 Pa"
    )
    assert _furthest(leak, "lowering") == (
        "as far as 1e-06 m^3/s of the lowering chamber at 9e+05 Pa"
    )


@pytest.mark.parametrize(
    ("off", "reconciled", "asked"),
    [(3948.7, False, True), (3948.7, True, False), (29.6, False, False)],
)
def test_a_recording_far_off_may_be_another_machine_s(
    off: float, *, reconciled: bool, asked: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    learned = _recorded("a", [70.0, 200.0], [8.0, 60.0])
    findings = SimpleNamespace(
        verdict="nothing_missing", curve=None, misstated=(), evidence=learned,
        chosen=SimpleNamespace(effects=(), machine=None), rivals=(),
    )  # fmt: skip
    judged = SimpleNamespace(
        surprising=True, reconciled=reconciled, off=lambda _: off,
        evidence=_recorded("b", [70.0, 200.0], [8.0, 60.0]),
    )  # fmt: skip
    monkeypatch.setattr(judgement, "loudest_signal", lambda *_: ("piston_stroke", off))
    said = judgement.judgement(findings, judged)
    assert ("see whether it is of the same machine" in said) == asked
    assert said.endswith("diagnose from that too")


@pytest.mark.parametrize(
    ("off", "alone", "carried"),
    [(9.0, 9.5, False), (9.0, 20.0, True), (4.0, 4.0, True), (9.0, np.nan, True)],
)
def test_an_effect_carries_to_a_recording_where_it_helps(
    off: float, alone: float, *, carried: bool
) -> None:
    """Or leaves little; and one without which the machine cannot even rest there helps."""
    findings = SimpleNamespace(chosen=SimpleNamespace(effects=("payload",)), rivals=())
    judged = SimpleNamespace(
        reconciled=False, rivals=(), off={"with_effect": off, "refitted": alone}.__getitem__
    )
    assert carries(findings, judged) == carried


@pytest.mark.parametrize(("of_rival", "verdict"), [(8.0, "unexplained"), (2.0, "ambiguous")])
def test_rivals_are_named_where_one_of_them_carries_to_the_other_recording(
    of_rival: float, verdict: str
) -> None:
    """A cracked boom: either of two sets did where it was learned, and none where it was judged."""
    findings = SimpleNamespace(
        verdict="ambiguous", chosen=SimpleNamespace(effects=("sensor_bias",)),
        rivals=(SimpleNamespace(effects=("linkage_error",)),),
    )  # fmt: skip
    judged = SimpleNamespace(
        surprising=True, reconciled=False, rivals=(of_rival,),
        off={"with_effect": 9.0, "refitted": 8.5}.__getitem__,
    )  # fmt: skip
    assert statement.verdict(findings, judged) == verdict


@pytest.mark.parametrize(
    ("begin", "end", "predictor", "load"),
    [
        (0.0, 90.0, "tip_deflection_angle", True),
        (0.0, 90.0, "piston_velocity", False),
        (22.0, 52.0, "valve_command", True),
        (22.0, 52.0, "piston_velocity", False),
        (22.0, 85.0, "valve_command", False),
    ],
)
def test_a_force_that_bends_the_boom_or_passes_may_be_a_load(
    begin: float, end: float, predictor: str, *, load: bool
) -> None:
    """As any force at the TCP bends it; friction acts whenever the piston moves."""
    column = list(BALANCES).index("force")
    findings = SimpleNamespace(
        speaking="force", verdict="unexplained", swing=None, curve=None, misstated=(), drift=None,
        residuals={"refitted": np.eye(5)[column] * np.ones((40, 1)) * 9.0},
        floor=np.ones(5), limit=np.full(5, 2.0),
        where=Where(begin, end),
        shape=SimpleNamespace(predictor=predictor, share=0.8, by_direction=False),
        evidence=SimpleNamespace(
            duration=lambda _: 90.0, place=lambda t: ("a", t), experiments=["a"]
        ),
    )  # fmt: skip
    assert ("it may be a load from outside" in remainder(findings)) == load


@pytest.mark.parametrize(("left", "said"), [(9.0, True), (18.5, False)])
def test_what_hardly_helps_does_not_come_closest(
    left: float, *, said: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    late = SimpleNamespace(effects=("command_delay",), machine=None)
    findings = SimpleNamespace(
        evidence=SimpleNamespace(residuals=lambda _: [np.ones((4, 5))]),
        refitted=None,
        floor=np.ones(5),
        limit=np.full(5, 2.0),
    )
    monkeypatch.setattr(statement, "mean_square", lambda t, _: left**2 if t is late else 18.7**2)
    monkeypatch.setattr(statement, "closest", lambda _: "command_delay comes closest")
    assert bool(_rejected(late, findings)) == said


def test_parameters_that_do_worse_than_the_stated_ones_are_told() -> None:
    learned = SimpleNamespace(evidence=SimpleNamespace(name="a"))

    def off(stated: float, refitted: float) -> SimpleNamespace:
        errors = {"nominal": stated, "refitted": refitted}
        return SimpleNamespace(evidence=SimpleNamespace(name="b"), off=errors.get)

    alone = "; all signals of b together are 41.0 times the noise off"
    worse = f"{alone}, more than by the data sheet as it came (22.0)"
    assert _foreseen(learned, off(22.0, 41.0)) == worse
    assert _foreseen(learned, off(50.0, 41.0)) == alone
    assert _foreseen(learned, off(50.0, 1.1)) == ""
    same = off(50.0, 41.0)
    same.evidence.name = "a"
    assert _foreseen(learned, same) == ""

"""Which balances speak beside the one that is told first, and which sensor they share."""

from emir_analysis.diagnosis.statement import _beside

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

"""The benchmark against general identification tools, where these are installed."""

import json
from importlib.util import find_spec
from pathlib import Path

import actuator_recorded as recorded
import numpy as np
import pytest

from emir_analysis.bench.identification import ACTUATOR_PHYSICS, Data, command, rows
from emir_analysis.errors import InputError

MISSING = find_spec("pysindy") is None or find_spec("sysidentpy") is None


def _data(seed: int) -> Data:
    opening = recorded.moves(400, seed)
    oil = recorded.pressure(opening, lambda spool, _: recorded.GAIN * spool)
    return Data(oil[:, None], opening, 1.0)


@pytest.mark.skipif(MISSING, reason="pysindy or sysidentpy missing: extra `identification`")
def test_a_linear_machine_is_no_riddle_for_a_difference_equation() -> None:
    seen, unseen = _data(1), _data(2)
    found = {row.method: row.errors[0] for row in rows(seen, unseen, [1.0], ACTUATOR_PHYSICS)}
    narx = found["SysIdentPy NARX"]
    assert narx is not None
    assert narx < 0.05 * float(np.std(unseen.outputs))


@pytest.mark.skipif(not MISSING, reason="pysindy and sysidentpy are installed")
def test_what_is_missing_is_told_in_one_line() -> None:
    with pytest.raises(InputError, match="identification") as told:
        rows(_data(1), _data(2), [1.0], ACTUATOR_PHYSICS)
    assert "\n" not in str(told.value)


def test_a_diagnosis_that_is_not_there_is_told(tmp_path: Path) -> None:
    (tmp_path / "signals.yaml").write_text(recorded.SIGNALS)
    for part in ("a", "b"):
        recorded.write(tmp_path / f"rig_{part}", _data(1).command, _data(1).outputs[:, 0])
    (tmp_path / "other.json").write_text(json.dumps({}))
    words = [str(tmp_path), "--machines", "rig", "--diagnoses", str(tmp_path)]
    with pytest.raises(InputError, match=r"rig\.json"):
        command(words, lambda _: None)

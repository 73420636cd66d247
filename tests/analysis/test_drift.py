"""What changes along a recording, told by the balances."""

from dataclasses import replace

import numpy as np
import pytest
import recorded
from operated import moved, operated

from emir_analysis.diagnosis.diagnose import diagnose
from emir_analysis.diagnosis.drift import Drift, drift
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.experiment import Experiment
from emir_analysis.diagnosis.fitting import fit_balances
from emir_analysis.diagnosis.trial import trial
from emir_common.parameter_tree import with_values
from emir_plant.sheet import Sheet, joint1

H = 1  # column of p_H in the outputs


TOLERANCES = {"cylinder.beta": 0.1, "valve.flow_nominal": 0.03}


def asked(experiment: Experiment, tolerances: dict[str, float] = TOLERANCES) -> Drift | None:
    sheet = Sheet(joint1(), tolerances, {}, ())
    evidence = Evidence([experiment], sheet.machine)
    floor = evidence.floor(sheet.machine)
    return drift(fit_balances(trial(sheet, ()), evidence, floor), evidence, floor)


@pytest.mark.parametrize("tolerances", [TOLERANCES, {}], ids=["tolerances", "exact"])
def test_a_gauge_that_drifts_is_told_with_both_ends(tolerances: dict[str, float]) -> None:
    run = moved(joint1(), 30.0, seed=6)
    outputs = run.outputs.copy()
    outputs[:, H] += np.linspace(-1e5, 5e5, len(outputs))
    found = asked(replace(run, outputs=outputs), tolerances)
    assert found is not None
    assert found.path == "effects.sensor_bias.pressure_lifting"
    assert (found.begin, found.end) == pytest.approx((-1e5, 5e5), abs=0.3e5)


def test_a_valve_whose_null_moves_is_told() -> None:
    """The command that the valve follows is another than the one that was recorded."""
    commands = recorded.moves(30.0, 6)
    run = operated(joint1(), commands + np.linspace(0.0, 0.03, commands.size))
    found = asked(replace(run, commands=operated(joint1(), commands).commands))
    assert found is not None
    assert found.path == "effects.valve_null_offset.offset"
    assert (found.begin, found.end) == pytest.approx((0.0, 0.03), abs=0.005)


@pytest.mark.parametrize(
    "values",
    [
        {"effects.sensor_bias.pressure_lifting": 3e5},
        {"effects.internal_leakage.coefficient": 5e-12},
        {"geometry.modal_damping": 0.06},
        {"effects.external_load.mean": 300.0, "effects.external_load.start": 12.0},
    ],
    ids=str,
)
def test_what_is_steady_does_not_drift(values: dict[str, float]) -> None:
    assert asked(moved(with_values(joint1(), values), 30.0, seed=6)) is None


@pytest.mark.parametrize(("length", "bias"), [(45.0, 1.5e5), (60.0, 3e5)])
def test_a_drifting_gauge_is_no_load(length: float, bias: float) -> None:
    """Though one that comes slowly is nearly at the noise; and no pairs are tried in its place."""
    run, said = moved(joint1(), length, seed=6), []
    outputs = run.outputs.copy()
    outputs[:, H] += bias * (1.0 - np.exp(-run.time / 35.0))
    sheet = Sheet(joint1(), TOLERANCES, {}, ())
    found = diagnose([replace(run, outputs=outputs)], sheet, said.append)
    assert found.verdict == "unexplained"
    assert found.drift is not None
    assert found.drift.path == "effects.sensor_bias.pressure_lifting"
    assert not any(line.startswith("pairs") for line in said)


def test_a_steady_fault_beside_a_drifting_one_is_no_drift() -> None:
    """As the boom sinks, p_H rises, and a gain of the gauge that falls is nearly a bias."""
    sinking = np.zeros(1000)
    sinking[30:990] = np.tile(np.r_[np.full(60, -0.22), np.zeros(20)], 12)
    hidden = {
        "effects.sensor_bias.pressure_lifting": 15e5,
        "effects.flow_gain_drift.change": 0.1,
    }
    run = operated(with_values(joint1(), hidden), sinking, angle=1.3)
    assert run.outputs[-1, H] > 2.0 * run.outputs[0, H]
    assert asked(run) is None

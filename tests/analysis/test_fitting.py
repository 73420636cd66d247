"""What slopes at the optimum tell, held against runs of the changed machine."""

import numpy as np
import pytest
from operated import moved

from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.fitting import refine_free_run, with_spread
from emir_analysis.diagnosis.run_errors import free_run_errors, mean_square
from emir_analysis.diagnosis.trial import Trial, trial
from emir_common.parameter_tree import with_values
from emir_plant.sheet import Sheet, joint1


def _alone(effect: str, values: dict[str, float], free: str) -> tuple[Trial, Evidence]:
    """Return a trial of which one field is to be fitted, at the truth, and its recording."""
    paths = {f"effects.{effect}.{name}": value for name, value in values.items()}
    evidence = Evidence([moved(with_values(joint1(), paths))], joint1())
    known = trial(Sheet(joint1(), {}, {}, ()), (effect,))
    for path, value in paths.items():
        if path != f"effects.{effect}.{free}":
            known = known.fixed(path, value)
    (member,) = known.unknowns.members
    return with_spread(known.at(np.array([member.at(values[free])])), evidence), evidence


def _apart(known: Trial, x: float, evidence: Evidence) -> float:
    """Return the squares by which runs with another value differ, in units of the noise."""
    here, there = (
        np.concatenate(free_run_errors(t.machine, evidence))
        for t in (known, known.at(np.array([x])))
    )
    return float(np.sum(np.square(there - here)))


@pytest.mark.parametrize("coefficient", [300.0, 1000.0])
def test_what_leaving_an_effect_out_costs(coefficient: float) -> None:
    """Viscous friction so small that the boom moves nearly as without it."""
    known, evidence = _alone("viscous_friction", {"coefficient": coefficient}, "coefficient")
    known = refine_free_run(known, evidence)
    (member,) = known.unknowns.members
    wanted = _apart(known, member.at(0.0), evidence)
    assert known.cost_without("viscous_friction") == pytest.approx(wanted, rel=0.05)


LOAD = {"force": -1200.0, "mean": 0.0, "frequency": 0.0, "phase": 0.0, "duration": 1e6}
AT_ONCE = {"rise": 1e-5, "decay": 0.0, "piston_share": 0, "joint_share": 0, "vertical_share": 0}


@pytest.mark.parametrize("start", [4.0, 4.0003, 6.0512])
def test_when_a_load_sets_in_at_once_is_told_wherever_in_a_step(start: float) -> None:
    """As well as runs of loads that set in 20 ms earlier and later differ."""
    known, evidence = _alone("external_load", LOAD | AT_ONCE | {"start": start}, "start")
    (member,) = known.unknowns.members
    off = [_apart(known, member.at(start + later), evidence) for later in (-0.02, 0.02)]
    spread = 0.02 / np.sqrt(np.mean(off))
    assert member.scale * known.spread[0] == pytest.approx(spread, rel=0.05)


@pytest.mark.parametrize("off", [80e5, 88e5, 103e5])
def test_a_fit_from_the_truth_leads_nowhere_worse(off: float) -> None:
    """Where the logic block switches, with the boom at rest near the end of a resolver's step."""
    stated, threshold = joint1(), "effects.logic_block_fault.threshold"
    evidence = Evidence([moved(with_values(stated, {threshold: off}))], stated)
    tolerances = {"cylinder.beta": 0.15, "valve.flow_nominal": 0.03, "resistances.k_block_in": 0.1}
    known = trial(Sheet(stated, tolerances, {}, ()), ("logic_block_fault",))
    members = known.unknowns.members
    x = [member.at(off) if member.path == threshold else 0.0 for member in members]
    truth = known.at(np.array(x))
    assert mean_square(refine_free_run(truth, evidence), evidence) <= mean_square(truth, evidence)

"""How far a free run can be held against a model."""

import numpy as np
import recorded
from operated import operated
from test_diagnosis_search import TOLERANCES

from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.foresight import explained, parting
from emir_analysis.diagnosis.select import AT_NOISE, EXPLAINED, beyond, excess
from emir_analysis.diagnosis.trial import Trial, trial
from emir_common.parameter_tree import with_values
from emir_plant.sheet import Sheet, joint1

STICKS = {
    "effects.stribeck_friction.force": 2.4e4,
    "effects.stribeck_friction.breakaway": 1.87,
    "effects.stribeck_friction.stribeck_speed": 3.6e-3,
    "effects.stribeck_friction.smoothing_speed": 5e-4,
}


def recording(machine: dict[str, float], seed: int) -> Evidence:
    experiment = operated(with_values(joint1(), machine), recorded.moves(40.0, seed=seed))
    return Evidence([experiment], joint1())


def model(machine: dict[str, float]) -> Trial:
    """Return a machine as a trial of its own effect."""
    effects = tuple(dict.fromkeys(path.split(".")[1] for path in machine))
    start = trial(Sheet(joint1(), TOLERANCES, {}, ()), effects)
    members = start.unknowns.members
    return start.at(np.array([u.at(machine[u.path]) if u.path in machine else 0 for u in members]))


def test_a_machine_that_sticks_hard_is_not_blamed_on_its_own_model() -> None:
    """The model that made the recordings: some it cannot follow, begun where the sensors say."""
    truth = model(STICKS)
    recordings = [recording(STICKS, seed) for seed in (5, 6, 7, 8)]
    assert any(1.0 + excess(truth, e) > EXPLAINED**2 for e in recordings)
    assert all(explained(truth, e) for e in recordings)


def test_what_sticks_is_blamed_on_other_friction() -> None:
    """A quarter less of it: far more than two runs of either are apart."""
    less = model({**STICKS, "effects.stribeck_friction.force": 1.8e4})
    assert not explained(less, recording(STICKS, 8))


def test_runs_of_a_machine_that_does_not_stick_stay_together() -> None:
    """Half a step of the resolver shifts the stroke all the time and no more."""
    viscous = {"effects.viscous_friction.coefficient": 1e5}
    assert parting(model(viscous).machine, recording(viscous, 8)) < 0.05


def test_a_free_run_that_leaves_more_than_its_bound_is_no_explanation() -> None:
    viscous = {"effects.viscous_friction.coefficient": 1e5}
    seen, other = recording(viscous, 8), model({"effects.viscous_friction.coefficient": 1.5e5})
    assert 1.0 + excess(other, seen) > EXPLAINED**2
    assert not explained(other, seen)


def test_a_series_explains_nothing_short_of_the_noise() -> None:
    """Its terms come close to what a payload does, say; friction may be of a law like the truth."""
    for path, value, off, is_enough in (
        ("effects.linkage_error.scale", 0.01, 0.0107, False),
        ("effects.viscous_friction.coefficient", 1e5, 1.15e5, True),
    ):
        seen, near = recording({path: value}, 8), model({path: off})
        assert beyond(AT_NOISE) < excess(near, seen) < beyond(EXPLAINED)
        assert explained(near, seen) == is_enough
        assert explained(model({path: value}), seen)

"""How much a named effect may leave of what is missing."""

import math

import numpy as np
import pytest
from operated import moved
from scipy.optimize import brentq

from emir_analysis.diagnosis.diagnose import _verdict
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.run_errors import mean_square
from emir_analysis.diagnosis.trial import Trial, trial
from emir_common.parameter_tree import with_values
from emir_plant.sheet import Sheet, joint1

MASS = 100.0  # kg
PAYLOAD = ("payload",)
FRICTION = ("payload", "coulomb_friction")


@pytest.mark.parametrize(
    ("left", "effects", "verdict"),
    [
        (1.3, PAYLOAD, "found"),
        (1.7, PAYLOAD, "unexplained"),
        (1.7, FRICTION, "found"),
        (2.3, FRICTION, "unexplained"),
    ],
)
def test_more_than_half_above_the_noise_is_only_like_an_effect(
    left: float, effects: tuple[str, ...], verdict: str
) -> None:
    """A payload that is off until the free run is so many times the noise off; what sticks may."""
    hidden = {"effects.payload.mass": MASS}
    if effects is FRICTION:
        hidden["effects.coulomb_friction.force"] = 2000.0
    machine = with_values(joint1(), hidden)
    evidence = Evidence([moved(machine, 20.0, seed=3)], joint1())
    known = trial(Sheet(machine, {}, {}, ()), effects)

    def off_by(mass: float) -> Trial:
        return known.fixed("effects.payload.mass", mass)

    def left_by(mass: float) -> float:
        return math.sqrt(mean_square(off_by(mass), evidence))

    mass = brentq(lambda mass: left_by(mass) - left, MASS, 1.2 * MASS, xtol=1e-3)
    after = np.zeros((10, 5))
    assert _verdict(off_by(mass), after, evidence, rivals=0) == verdict

"""Parameters of the longest beginning that they explain, where no balance is told."""

import numpy as np
import pytest
from operated import operated, without

from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.fitting import following
from emir_analysis.diagnosis.trial import trial
from emir_common.parameter_tree import with_values
from emir_plant.sheet import Sheet, joint1

PERIOD = 0.032  # s, of the command
FLOW, HIDDEN = "valve.flow_nominal", "effects.valve_gain_asymmetry.lowering"


def _pieces(*moves: tuple[float, float]) -> np.ndarray:
    return np.concatenate([np.full(round(length / PERIOD), opening) for opening, length in moves])


@pytest.mark.parametrize("gain", [0.0, -0.2])
def test_what_acts_later_does_not_lead_parameters_astray(gain: float) -> None:
    """Lifting for 15 s tells the valve's flow; lowering from then on, a fifth slower, does not."""
    stated = joint1()
    lifting = [(0.0, 1.0), (0.4, 2.0), (0.0, 2.0), (0.3, 4.0), (0.0, 2.0), (0.4, 2.0), (0.0, 2.0)]
    lowering = [(-0.4, 3.0), (0.0, 2.0), (-0.6, 3.0), (0.0, 2.0)]
    made = with_values(stated, {FLOW: 1.03 * stated.valve.flow_nominal, HIDDEN: gain})
    run = operated(made, _pieces(*lifting, *lowering))
    for name in ("pressure_lifting", "pressure_lowering"):
        run = without(run, name)
    evidence = Evidence([run], stated)
    assert not np.any(evidence.fitted)
    sheet = Sheet(stated, {FLOW: 0.05, "valve.natural_frequency": 0.2}, {}, ())
    found = following(trial(sheet, ()), evidence)
    assert found.machine.valve.flow_nominal == pytest.approx(made.valve.flow_nominal, rel=3e-3)

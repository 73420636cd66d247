"""What wrong oil does, by linear closed loops: against the nonlinear machine, and the choice."""

import math
from dataclasses import replace

import numpy as np
import pytest

from emir_analysis.limit import PAPER_MOVE
from emir_analysis.machine_model import lqg_parameters
from emir_analysis.node_controls import LqgControl
from emir_analysis.yardstick import Draw, score, smallest
from emir_common.parameter_tree import with_values
from emir_control.lqg import Lqg
from emir_control.softness import CASES, Case, Robustness
from emir_plant.sheet import joint1

PARAMETERS = lqg_parameters(joint1())


@pytest.mark.parametrize("stiffness", [0.8, 1.0, 1.2])
def test_bending_with_wrong_oil_is_the_machines(stiffness: float) -> None:
    """Of a law that takes the oil as stated; the machine is what it knows but for the oil."""
    case = Case(math.radians(40.0), 500.0, PAPER_MOVE.distance)
    told = Robustness(PARAMETERS, (case,)).ratios(1.0, [stiffness])[0, 0]
    values = {
        "geometry.payload": case.payload,
        "cylinder.beta": stiffness * joint1().cylinder.beta,
        "sensors.resolver_bits": 20,
    }
    draw = Draw(with_values(joint1(), values), case.angle, case.distance)
    law = LqgControl(Lqg(replace(PARAMETERS, softness=1.0)))
    assert score(draw, law, smallest(draw)).ratio == pytest.approx(told, rel=0.06)


@pytest.mark.parametrize("delay", [0.0, 0.032])
def test_softness_bends_the_boom_least_at_the_worse_end_of_the_tolerance(delay: float) -> None:
    """The default, of oil known within 20 %: much less and much more are worse."""
    late = replace(PARAMETERS, regulator=replace(PARAMETERS.regulator, delay=delay))
    law, chosen = Robustness(late, CASES[2::6]), PARAMETERS.softness
    worst = [float(law.ratios(chosen + more, (0.8, 1.2)).max()) for more in (-0.12, 0.0, 0.12)]
    assert worst[1] < min(worst[0], worst[2])


def test_limit_of_the_cases_is_the_machines() -> None:
    machine = with_values(joint1(), {"geometry.payload": 700.0})
    known = Robustness(PARAMETERS, (Case(math.radians(60.0), 700.0, PAPER_MOVE.distance),))
    draw = Draw(machine, math.radians(60.0), PAPER_MOVE.distance)
    assert known.limits == pytest.approx(np.array([smallest(draw)]), rel=0.01)

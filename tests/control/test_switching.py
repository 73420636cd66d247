"""From one outer loop to another on the nonlinear machine while it moves."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from emir_analysis.closed_loop import ClosedLoop
from emir_analysis.outer_loop import Situation
from emir_control import pfc_file
from emir_control.cascade import Cascade, CascadeInputs, CascadeParameters
from emir_control.pfc import Pfc, PfcInputs
from emir_control.trajectory import TrajectoryParameters, named
from emir_plant.plant import Plant
from emir_plant.sheet import joint1

SWITCH = 78  # control periods: 2.5 s, in the middle of the plateau
LAW = Pfc(pfc_file.load(pfc_file.default_file("stroke"), "stroke"))
CASCADE = Cascade(CascadeParameters())


@dataclass(frozen=True)
class Switched:
    """The cascade, then the predictive law; `how` it was prepared: followed, initialized, cold."""

    how: str

    def step(self, state: Any, now: Situation, dt: float) -> tuple[Any, dict[str, float]]:
        """Return state and command; see `OuterLoop`."""
        wanted, reading = now.reference, now.reading
        for_cascade = CascadeInputs(wanted, reading.stroke)
        for_law = PfcInputs(wanted.stroke, wanted.velocity, now.preview, reading.stroke)
        if state is None:
            state = (0, CASCADE.initial(for_cascade), LAW.initial(for_law), 0.0)
        k, cascading, predicting, command = state
        if k < SWITCH:
            cascading, out = CASCADE.step(cascading, for_cascade, dt)
            command = out.velocity_command
            predicting = LAW.follow(predicting, for_law, command)
        else:
            if k == SWITCH and self.how == "initialized":
                predicting = LAW.initial(for_law, command)
            elif k == SWITCH and self.how == "followed":
                predicting = LAW.take_over(predicting, for_law)
            elif k == SWITCH:
                predicting = LAW.initial(for_law)
            predicting, law_out = LAW.step(predicting, for_law, dt)
            command = law_out.velocity_command
        return (k + 1, cascading, predicting, command), {"velocity_command": command}


def _run(how: str) -> dict[str, np.ndarray]:
    trajectory = named("lift-lower", TrajectoryParameters())
    return ClosedLoop(Plant(joint1()), trajectory, Switched(how)).run(math.pi / 4, 2e6, 9.0)


@pytest.mark.parametrize("how", ["followed", "initialized"])
def test_switching_while_moving_is_bumpless(how: str) -> None:
    """The command goes on without a jump; a controller that starts cold lets it fall to nothing."""
    ready, cold = _run(how)["velocity_command"], _run("cold")["velocity_command"]
    before = ready[SWITCH - 1]
    assert before > 0.015  # it moves
    assert ready[SWITCH] == pytest.approx(before, abs=1e-9)
    assert np.abs(np.diff(ready[SWITCH - 1 : SWITCH + 10])).max() < 0.003
    assert np.abs(np.diff(cold[SWITCH - 1 : SWITCH + 10])).max() > 0.015


@pytest.mark.parametrize("how", ["followed", "initialized"])
def test_after_switching_the_move_ends_where_it_should(how: str) -> None:
    run = _run(how)
    assert run["true_stroke"][-1] == pytest.approx(run["reference_stroke"][-1], abs=2e-3)

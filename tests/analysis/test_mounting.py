"""Play between piston and joint is told from a mount that is a spring."""

import pytest
import recorded
from operated import moved, operated
from test_diagnosis_search import TOLERANCES

from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.mounting import spring_in_series
from emir_analysis.diagnosis.trial import Trial, trial
from emir_common.parameter_tree import with_values
from emir_plant.sheet import Sheet, joint1

STIFFNESS = 5e8  # N/m
STEEP = 1.3  # rad: a boom whose weight hardly turns it, so that its swings turn the force round


def with_backlash(values: dict[str, float]) -> tuple[Trial, Evidence]:
    """Return a trial of a machine with such play, and a recording of that machine."""
    play = {f"effects.backlash.{name}": value for name, value in values.items()}
    known = trial(Sheet(joint1(), TOLERANCES, {}, ()), ("backlash",))
    for path, value in play.items():
        known = known.fixed(path, value)
    machine = with_values(joint1(), play)
    return known, Evidence([operated(machine, recorded.moves(16.0, seed=5), angle=STEEP)], joint1())


def test_a_mount_that_yields_in_proportion_is_a_spring() -> None:
    """Half a gap of 0.04 mm at 1e4 N, next to nothing of it at the flanks."""
    gap = 2.0 * 1e4 / STIFFNESS
    found = spring_in_series(*with_backlash({"gap": gap, "pin_force": 1e4, "seating_force": 1e6}))
    assert found == pytest.approx(STIFFNESS, rel=0.02)


@pytest.mark.parametrize("pin_force", [1e12, 5e6])
def test_play_is_none(pin_force: float) -> None:
    """Nor where the pin bends besides: the piston goes from flank to flank within 20 kN."""
    known, evidence = with_backlash({"gap": 2e-3, "pin_force": pin_force})
    assert spring_in_series(known, evidence) is None


def test_a_machine_without_play_has_none() -> None:
    evidence = Evidence([moved(joint1())], joint1())
    known = trial(Sheet(joint1(), TOLERANCES, {}, ()), ("payload",))
    assert spring_in_series(known, evidence) is None

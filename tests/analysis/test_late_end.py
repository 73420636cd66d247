"""When a load ends that was still there where the fits end."""

import pytest
from operated import moved

from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.late_end import with_a_late_end
from emir_analysis.diagnosis.loads import FOR_EVER
from emir_analysis.diagnosis.select import SEEN
from emir_analysis.diagnosis.trial import Trial, trial
from emir_common.parameter_tree import with_values
from emir_plant.sheet import Sheet, joint1

LENGTH = 18.0  # s; the fits end at 12
LOAD = {"force": 2e3, "start": 6.0, "duration": FOR_EVER, "frequency": 0.0, "phase": 0.0}


def _fitted(load: dict[str, float]) -> Trial:
    """Return a trial with a load as a fit to the beginning knows it."""
    start = trial(Sheet(joint1(), {}, {}, ()), ("external_load",))
    values = {f"effects.external_load.{name}": value for name, value in load.items()}
    x = start.x.copy()
    for k, unknown in enumerate(start.unknowns.members):
        x[k] = unknown.at(values.get(unknown.path, 0.0)) if not unknown.is_share else 0.0
    return start.at(x)


@pytest.mark.parametrize("lasts", [8.0, 10.5, FOR_EVER])
def test_the_end_is_found_to_half_a_second(lasts: float) -> None:
    effect = {f"effects.external_load.{name}": value for name, value in LOAD.items()}
    machine = with_values(joint1(), effect | {"effects.external_load.duration": lasts})
    evidence = Evidence([moved(machine, LENGTH)], joint1())
    found = with_a_late_end(_fitted(LOAD), evidence, SEEN)
    load = found.machine.effects.external_load
    assert min(load.duration, LENGTH) == pytest.approx(min(lasts, LENGTH), abs=0.5)

"""Sensors that are all equally late are the same as a late command, which is one number."""

import numpy as np
import pytest
from operated import moved

from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.fitting import fit_balances, fit_free_run
from emir_analysis.diagnosis.late_command import late_command
from emir_analysis.diagnosis.trial import trial
from emir_analysis.diagnosis.whole import Whole
from emir_common.parameter_tree import with_values
from emir_plant.sheet import Sheet, joint1

DELAY = 0.03  # s
MACHINE = joint1()
SHEET = Sheet(MACHINE, {}, {}, ())


@pytest.mark.parametrize("lag_share", [0.0, 1.0])
def test_a_late_command_is_told_though_late_sensors_were_chosen(lag_share: float) -> None:
    hidden = {"delay": DELAY, "lag_share": lag_share}
    late = with_values(MACHINE, {f"effects.command_delay.{name}": hidden[name] for name in hidden})
    evidence = Evidence([moved(late, 20.0, seed=6)], MACHINE)
    floor = evidence.floor(MACHINE)
    sensors = fit_free_run(fit_balances(trial(SHEET, ("sensor_delay",)), evidence, floor), evidence)
    assert sensors.machine.effects.sensor_delay.angle == pytest.approx(DELAY, rel=0.1)
    plain = Whole(evidence, SHEET, floor, lambda _: None).plainer(sensors)
    assert plain.effects == ("command_delay",)
    assert plain.machine.effects.command_delay.delay == pytest.approx(DELAY, rel=0.02)
    assert plain.machine.effects.command_delay.lag_share == pytest.approx(lag_share, abs=0.05)


@pytest.mark.parametrize("apart", [0.5, 0.0])
def test_sensors_that_are_late_by_times_of_their_own_stay(apart: float) -> None:
    known = trial(SHEET, ("sensor_delay", "payload"))
    slow = known.x.copy()
    slow[0] *= 1.0 + apart
    begun = late_command(known.at(slow), SHEET)
    assert (begun is None) == bool(apart)
    if begun is not None:
        assert begun.effects == ("payload", "command_delay")
        assert begun.machine.effects.command_delay.delay == pytest.approx(0.02)
        dead_share = known.machine.effects.sensor_delay.dead_share
        lag_share = begun.machine.effects.command_delay.lag_share
        assert lag_share == pytest.approx(1.0 - dead_share)


@pytest.mark.parametrize(("late_by", "at_most"), [(0.6, 0.2), (0.15, 0.15)])
def test_a_command_is_begun_no_later_than_it_can_be(late_by: float, at_most: float) -> None:
    """A filter of a sensor may take longer; a command later than that is no machine."""
    known = trial(SHEET, ("sensor_delay",))
    late = [unknown.at(late_by) for unknown in known.unknowns.members[:4]]
    begun = late_command(known.at(np.append(late, known.x[4:])), SHEET)
    assert begun is not None
    assert begun.machine.effects.command_delay.delay == pytest.approx(at_most)

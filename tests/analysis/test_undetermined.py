"""What a recording does not determine is said to be so, in place of an interval."""

import math

import numpy as np
import pytest
from operated import moved, operated

from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.fitting import with_spread
from emir_analysis.diagnosis.result import OPEN, effect_results, parameter_line
from emir_analysis.diagnosis.telling import between_steps, open_shares
from emir_analysis.diagnosis.trial import Trial, trial
from emir_common.parameter_tree import with_values
from emir_plant.sheet import Sheet, joint1

LOAD = "effects.external_load."
PUSH = {"force": -1200.0, "start": 2.0, "duration": 20.0, "piston_share": 1.0}


def pushed() -> tuple[Trial, Evidence]:
    """Return a load on the piston's rod with its shares set, and a recording of it."""
    stated = joint1()
    hidden = {LOAD + name: value for name, value in PUSH.items()}
    evidence = Evidence([moved(with_values(stated, hidden))], stated)
    begun = trial(Sheet(stated, {}, {}, ()), ("external_load",))
    x = [
        u.at(hidden.get(u.path, 0.0)) if not u.logarithmic else 0.0 for u in begun.unknowns.members
    ]
    known = begun.at(np.array(x))
    for name, value in (("piston_share", 1.0), ("joint_share", 0.0), ("vertical_share", 0.0)):
        known = known.fixed(LOAD + name, value)
    return known, evidence


def test_a_share_that_nothing_depends_on_is_not_determined() -> None:
    """On the rod no force is vertical nor about the joint, but that it is on the rod is told."""
    known, evidence = pushed()
    found = open_shares(known, evidence)
    assert set(found) == {LOAD + "vertical_share", LOAD + "joint_share"}
    (effect,) = effect_results(known, {}, found)
    shown = {name: (p.low, p.high, p.note) for name, p in effect.parameters.items()}
    assert shown["vertical_share"] == (0.0, 1.0, OPEN)
    assert shown["piston_share"] == (1.0, 1.0, "0 explains it worse")
    assert OPEN in parameter_line("vertical_share", effect.parameters["vertical_share"], "1")


def test_of_two_that_do_the_same_each_is_as_uncertain_as_the_maker_leaves_the_other() -> None:
    """A hose of C and a dead volume V: no movement tells more than C + V / beta."""
    stated, tolerance = joint1(), 0.1
    hose, volume = "effects.vessel_compliance.lifting", "cylinder.volume_lifting_0"
    evidence = Evidence([moved(with_values(stated, {hose: 5e-11}))], stated)
    sheet = Sheet(stated, {volume: tolerance}, {}, ())
    begun = trial(sheet, ("vessel_compliance",)).with_one_size("vessel_compliance", "lifting")
    begun = begun.fixed("effects.vessel_compliance.wall_share", 0.0)
    paths = [unknown.path for unknown in begun.unknowns.members]
    at, x = paths.index(hose), begun.x.copy()
    x[at] = begun.unknowns.members[at].at(5e-11)
    known = with_spread(begun.at(x), evidence)
    low, high = known.unknowns.members[at].deviation(float(x[at]), float(known.spread[at]))
    of_volume = tolerance / math.sqrt(3.0) * stated.cylinder.volume_lifting_0
    assert 0.5 * (high - low) == pytest.approx(of_volume / stated.cylinder.beta, rel=0.05)


PLAY = "effects.valve_hysteresis."
RAMP = 0.5 * np.concatenate([np.linspace(0.0, 1.0, 30), np.ones(30), np.linspace(1.0, 0.0, 30)])
JUMP = np.repeat([0.5, 0.0, 0.2, 0.0], 30)  # of two sizes: of one, play of another width may do


@pytest.mark.parametrize(("course", "open_"), [(RAMP, True), (JUMP, False)])
def test_on_which_side_of_the_spool_play_is_jumps_alone_tell(
    course: np.ndarray, *, open_: bool
) -> None:
    """A spool that overshoots leaves edges behind it where it came to; on a ramp it does not."""
    rest = np.zeros(40)
    command = np.concatenate([rest, course, rest, -course, rest])
    stated = joint1()
    hidden = {PLAY + "width": 0.03, PLAY + "command_share": 0.0}
    evidence = Evidence([operated(with_values(stated, hidden), command)], stated)
    begun = trial(Sheet(stated, {}, {}, ()), ("valve_hysteresis",)).fixed(PLAY + "command_share", 0)
    (width,) = begun.unknowns.members
    found = open_shares(begun.at(np.array([width.at(0.03)])), evidence)
    assert (PLAY + "command_share" in found) == open_


@pytest.mark.parametrize(("pressure", "told"), [(60e5, True), (-60e5, False)])
def test_a_threshold_is_told_where_it_is_crossed(pressure: float, *, told: bool) -> None:
    """By which moves the logic block closes and by which it does not: slopes say nothing."""
    path = "effects.logic_block_fault.threshold"
    stated = joint1()
    evidence = Evidence([moved(with_values(stated, {path: pressure}))], stated)
    begun = trial(Sheet(stated, {}, {}, ()), ("logic_block_fault",))
    known = begun.with_one_size("logic_block_fault", "threshold")
    (threshold,) = known.unknowns.members
    x = np.array([threshold.at(pressure)])
    low, high = between_steps(known.at(x), 0, evidence)
    assert low <= pressure <= high
    assert (low > threshold.value(threshold.low)) == told
    assert high < threshold.value(threshold.high)


DROOP = "effects.supply_pressure_droop."


def drooping(openings: tuple[float, ...], resistance: float) -> tuple[Trial, Evidence]:
    """Return a pump that droops with the square of the flow, to be fitted, and its recording."""
    stated, rest = joint1(), np.zeros(60)
    moves = [np.concatenate([rest, np.full(60, y), rest, np.full(45, -y)]) for y in openings]
    command = np.concatenate([*moves, rest, *moves, rest])
    hidden = {DROOP + "resistance": resistance, DROOP + "turbulent_share": 1.0}
    evidence = Evidence([operated(with_values(stated, hidden), command)], stated)
    return trial(Sheet(stated, {}, {}, ()), ("supply_pressure_droop",)), evidence


@pytest.mark.parametrize(
    ("openings", "resistance", "open_"), [((0.55,), 8e9, True), ((0.45, 0.8), 1.1e10, False)]
)
def test_by_which_law_a_pump_droops_other_flows_alone_tell(
    openings: tuple[float, ...], resistance: float, *, open_: bool
) -> None:
    """At one flow its square is that flow times another number, half of it here."""
    begun, evidence = drooping(openings, resistance)
    by_square = begun.fixed(DROOP + "turbulent_share", 1.0)
    size, settling = by_square.unknowns.members
    found = open_shares(by_square.at(np.array([size.at(resistance), settling.at(0.2)])), evidence)
    assert (DROOP + "turbulent_share" in found) == open_

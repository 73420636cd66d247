"""The friction of a machine that sticks and slips, from a beginning that grows."""

import math
from collections.abc import Callable

import numpy as np
import pytest
import recorded
from operated import operated
from test_diagnosis_search import TOLERANCES, search

from emir_analysis.diagnosis import friction_beginning, friction_told, stick_slip
from emir_analysis.diagnosis import whole as whole_module
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.fit import Solution, descended
from emir_analysis.diagnosis.fitting import fit_balances, fit_free_run
from emir_analysis.diagnosis.friction_beginning import (
    FIRST,
    STARTS,
    Begun,
    Law,
    begun,
    with_less_friction,
)
from emir_analysis.diagnosis.friction_laws import (
    along_the_way,
    elastic,
    fullest,
    gradual,
    is_along_the_way,
    is_gradual,
    is_uneven,
    nested,
    uneven,
)
from emir_analysis.diagnosis.friction_starts import SHAPES, friction_starts
from emir_analysis.diagnosis.run_errors import free_run_errors, mean_square
from emir_analysis.diagnosis.select import AT_NOISE, LEFT, at_noise
from emir_analysis.diagnosis.stick_slip import Grown, Growths, Led
from emir_analysis.diagnosis.trial import Trial, trial
from emir_analysis.diagnosis.tried import Tried
from emir_analysis.signals import Array
from emir_common.parameter_tree import with_values
from emir_plant.sheet import Sheet, joint1

HIDDEN = {
    "effects.stribeck_friction.force": 2e4,
    "effects.stribeck_friction.breakaway": 1.6,
    "effects.stribeck_friction.stribeck_speed": 5e-3,
    "effects.stribeck_friction.smoothing_speed": 3e-4,
    "effects.viscous_friction.coefficient": 8e4,
}
SLIDING = {
    "effects.coulomb_friction.force": 2e4,
    "effects.coulomb_friction.smoothing_speed": 1e-3,
}


def test_break_away_and_viscous_friction_are_found_from_coulomb_s() -> None:
    """Begun without any knowledge of the break-away, the fit ends at what was hidden."""
    searched, sheet, evidence = search(HIDDEN)
    known = fit_balances(trial(sheet, ("coulomb_friction",)), evidence, searched.floor)
    law = begun(fullest(known, sheet), evidence, searched.floor)
    assert with_less_friction(law, evidence, sheet, searched.floor) == [law]
    found, left, *_ = Growths(evidence).grown(law)
    assert left < 1.03
    errors = np.concatenate(free_run_errors(found.machine, evidence))
    assert np.sqrt(np.mean(errors**2)) < 1.05
    stribeck = found.machine.effects.stribeck_friction
    assert stribeck.force == pytest.approx(2e4, rel=0.03)
    assert stribeck.breakaway == pytest.approx(1.6, rel=0.05)
    assert found.machine.effects.viscous_friction.coefficient == pytest.approx(8e4, rel=0.05)


def test_what_sticks_otherwise_from_the_middle_of_the_resolver_step_is_fitted_once_more() -> None:
    """A state at rest that was fitted along is no part of the machine: 2 % off without it."""
    _, sheet, evidence = search(HIDDEN)
    law = fullest(trial(sheet, ()), sheet)
    values = law.unknowns.values(law.x) | HIDDEN
    right = law.at(np.array([u.at(values[u.path]) for u in law.unknowns.members]))
    values["effects.stribeck_friction.force"] *= 1.02
    off = law.at(np.array([u.at(values[u.path]) for u in law.unknowns.members]))
    growths = Growths(evidence)
    assert growths._from_the_middle(right, 1.1) is right
    errors = [mean_square(t, evidence) for t in (off, growths._from_the_middle(off, 1.0))]
    assert errors[0] > 1.1**2
    assert errors[1] < 1.05**2


def test_the_balances_say_how_much_friction_there_is_beside_its_shape() -> None:
    """Begun at 3 kN without knowing any; the shapes on either side of the hidden one lead."""
    searched, sheet, evidence = search(HIDDEN)
    start = fullest(trial(sheet, ()), sheet)
    found = friction_starts(start, evidence, searched.floor, FIRST)
    leading = [t.machine.effects.stribeck_friction for t in found[:STARTS]]
    for friction in leading:
        assert friction.force == pytest.approx(2e4, rel=0.15)
    shapes = {(f.breakaway, round(f.stribeck_speed, 5)) for f in leading}
    assert {(1.4, 5e-3), (1.7, 5e-3)} <= shapes


def test_friction_is_begun_beside_an_effect_at_the_edge_of_its_range() -> None:
    searched, sheet, evidence = search({})
    air = trial(sheet, ("entrained_air",))
    _, high = air.unknowns.bounds
    edge = fullest(air.at(np.where(air.unknowns.toleranced, 0.0, high)), sheet)
    found = friction_starts(edge, evidence, searched.floor, FIRST)
    fitted = [unknown.path for unknown in edge.unknowns.members]
    assert len(found) == math.prod(len(tried) for path, tried in SHAPES.items() if path in fitted)


def test_seals_that_give_before_they_slide_are_found() -> None:
    """Bristles of 60 um, damped: a law by the velocity leaves more than the noise in 10 s."""
    hidden = HIDDEN | {
        "effects.stribeck_friction.presliding": 6e-5,
        "effects.stribeck_friction.presliding_time": 1.5e-3,
        "effects.viscous_friction.coefficient": 0.0,
    }
    searched, sheet, evidence = search(hidden)
    law = begun(fullest(trial(sheet, ()), sheet), evidence, searched.floor)
    assert is_along_the_way(law)
    law, *_ = with_less_friction(law, evidence, sheet, searched.floor)
    fitted, left, *_ = Growths(evidence).grown(law)
    assert left < 1.03
    assert fitted.effects == ("stribeck_friction",)
    stribeck = fitted.machine.effects.stribeck_friction
    assert stribeck.force == pytest.approx(2e4, rel=0.03)
    assert stribeck.breakaway == pytest.approx(1.6, rel=0.03)
    assert stribeck.presliding == pytest.approx(6e-5, rel=0.1)
    assert stribeck.presliding_time == pytest.approx(1.5e-3, rel=0.3)


@pytest.mark.parametrize("share", [0.0, 0.8], ids=["creep", "elastic"])
def test_friction_under_load_of_seals_that_give_is_found(share: float) -> None:
    """By the velocity it leaves more than the noise, which no beginning of other friction tells."""
    by_load = "effects.pressure_dependent_friction."
    hidden = {
        by_load + "coefficient": 0.03,
        by_load + "presliding": 1.5e-4,
        by_load + "elastic_share": share,
    }
    searched, sheet, evidence = search(hidden)
    start = fit_balances(trial(sheet, ("pressure_dependent_friction",)), evidence, searched.floor)
    found = searched.whole.fitted(start)
    friction = found.machine.effects.pressure_dependent_friction
    assert friction.coefficient == pytest.approx(0.03, rel=0.03)
    assert friction.presliding == pytest.approx(1.5e-4, rel=0.05)
    assert friction.elastic_share == pytest.approx(share, abs=0.05)
    errors = np.concatenate(free_run_errors(found.machine, evidence))
    assert np.sqrt(np.mean(errors**2)) < 1.03


def test_a_law_of_seals_has_each_of_its_numbers_once() -> None:
    """Also where another dry friction is added, or it is asked for again."""
    _, sheet, _ = search({})
    coulomb = elastic(along_the_way(trial(sheet, ("coulomb_friction",))))
    both = trial(sheet, ("coulomb_friction", "pressure_dependent_friction"), coulomb)
    for again in (both, elastic(along_the_way(both))):
        law = elastic(along_the_way(again))
        paths = [unknown.path for unknown in law.unknowns.members]
        assert len(paths) == len(set(paths))
        for name in both.effects:
            assert {f"effects.{name}.presliding", f"effects.{name}.elastic_share"} <= set(paths)


def test_seals_that_give_already_are_not_led_again(monkeypatch: pytest.MonkeyPatch) -> None:
    searched, sheet, _ = search({"effects.pressure_dependent_friction.coefficient": 0.03})
    law = elastic(along_the_way(trial(sheet, ("pressure_dependent_friction",))))
    monkeypatch.setattr(whole_module, "following", None)
    assert searched.whole._with_seals_that_give(law) is law


@pytest.mark.parametrize("asked", [lambda law: law, uneven], ids=["even", "uneven"])
def test_no_more_friction_stays_than_there_is(asked: Callable[[Trial], Trial]) -> None:
    """A machine with Coulomb friction alone."""
    searched, sheet, evidence = search(SLIDING)
    law = begun(asked(fullest(trial(sheet, ()), sheet)), evidence, searched.floor)
    assert is_uneven(law) == (asked is uneven)
    law, *_ = with_less_friction(law, evidence, sheet, searched.floor)
    fitted = Growths(evidence).grown(law).trial
    assert fitted.effects == ("coulomb_friction",)
    assert not is_uneven(fitted)
    errors = np.concatenate(free_run_errors(fitted.machine, evidence))
    assert np.sqrt(np.mean(errors**2)) < 1.05
    assert fitted.machine.effects.coulomb_friction.force == pytest.approx(2e4, rel=0.03)


def test_viscous_friction_that_is_not_heard_takes_no_break_away_with_it() -> None:
    searched, sheet, evidence = search(HIDDEN | {"effects.viscous_friction.coefficient": 0.0})
    law = begun(fullest(trial(sheet, ()), sheet), evidence, searched.floor)
    least, *_ = with_less_friction(law, evidence, sheet, searched.floor)
    assert least.effects == ("stribeck_friction",)


def at(law: Trial, left: float) -> Solution:
    """Return a fit that ended where the law is, and what it left."""
    return Solution(law.x, np.eye(law.x.size), left, np.eye(law.x.size))


@pytest.mark.parametrize(
    ("by_tanh", "gradually", "share"),
    [(1.06, 0.97, 1.0), (1.06, 1.04, 1.0), (1.0001, 1.0, 0.0), (1.06, 1.07, 0.0)],
)
def test_friction_comes_gradually_where_that_leaves_clearly_less(
    by_tanh: float, gradually: float, share: float
) -> None:
    """By tanh, as most models have it, where a beginning does not tell."""
    _, sheet, evidence = search({})
    start = fullest(trial(sheet, ()), sheet)
    laws = [Law(gradual(start), at(start, gradually)), Law(start, at(start, by_tanh))]
    law, *_ = friction_beginning._as_good(laws, evidence.until(6.75))
    assert law.start.machine.effects.stribeck_friction.gradual_share == share


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_how_friction_comes_is_told_by_the_beginning(share: float) -> None:
    """Of a piston that turns round slowly; begun at other speeds, which mimic each other."""
    hidden = HIDDEN | {
        "effects.stribeck_friction.breakaway": 2.1,
        "effects.stribeck_friction.smoothing_speed": 8e-4,
        "effects.stribeck_friction.gradual_share": share,
    }
    searched, sheet, evidence = search(hidden)
    law = begun(fullest(trial(sheet, ()), sheet), evidence, searched.floor)
    stribeck = law.machine.effects.stribeck_friction
    assert stribeck.gradual_share == share
    assert stribeck.smoothing_speed == pytest.approx(8e-4, rel=0.1)
    assert stribeck.breakaway == pytest.approx(2.1, rel=0.05)


def test_what_noise_leaves_counts_as_one() -> None:
    """Of the machine itself, however long its resolver shows the same reading."""
    _, sheet, evidence = search({})
    known = trial(sheet, ())
    fitted = stick_slip.fitted_to(known, evidence, stick_slip.from_rest(known, evidence), 1e-3)
    assert fitted.misfit == pytest.approx(1.0, abs=0.02)


def test_what_is_far_off_over_the_beginning_is_no_matter_of_friction(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    searched, sheet, evidence = search({})
    start, tried = fullest(trial(sheet, ()), sheet), []

    def fitted(law: Trial, *_: object) -> Begun:
        tried.append((is_along_the_way(law), is_uneven(law)))
        return Begun(Law(law, at(law, 2.3)), [])

    monkeypatch.setattr(friction_beginning, "_begun", fitted)
    assert begun(start, evidence, searched.floor) is None
    assert tried == [(False, False), (True, False), (False, True)]


@pytest.mark.parametrize(("left", "gradually"), [(1.0, True), (1.4, True), (2.3, False)])
def test_friction_is_begun_gradually_unless_far_off(
    monkeypatch: pytest.MonkeyPatch, left: float, *, gradually: bool
) -> None:
    searched, sheet, evidence = search({})
    start = fullest(trial(sheet, ()), sheet)
    monkeypatch.setattr(friction_beginning, "friction_starts", lambda *_: [start])
    monkeypatch.setattr(friction_beginning, "fitted_to", lambda law, *_: at(law, left))
    laws = friction_beginning._over_the_first(start, evidence, searched.floor)
    assert any(is_gradual(law.start) for law in laws) is gradually


@pytest.mark.parametrize(("left", "rival"), [(1.6, []), (1.6, [2.0]), (1.28, [1.3])])
def test_a_law_is_given_up_over_the_first_beginning(
    monkeypatch: pytest.MonkeyPatch, left: float, rival: list[float]
) -> None:
    searched, sheet, evidence = search({})
    law = fullest(trial(sheet, ()), sheet)
    first = [Law(law, at(law, left))]
    monkeypatch.setattr(friction_beginning, "_over_the_first", lambda *_: first)
    monkeypatch.setattr(friction_beginning, "fitted_to", None)  # nothing is led on
    found = friction_beginning._begun(law, evidence, searched.floor, rival)
    assert found.left == [left]
    assert found.law.misfit == np.inf


@pytest.mark.parametrize("rival", [[], [1.4], [1.02]])
def test_a_law_is_led_on_where_no_rival_is_nearly_as_good(
    monkeypatch: pytest.MonkeyPatch, rival: list[float]
) -> None:
    """A rival that is at the noise is none: over so short a beginning both may be right."""
    searched, sheet, evidence = search({})
    law = fullest(trial(sheet, ()), sheet)
    first = [Law(law, at(law, 1.05))]
    monkeypatch.setattr(friction_beginning, "_over_the_first", lambda *_: first)
    monkeypatch.setattr(friction_beginning, "_begin", lambda *_: law.x)
    monkeypatch.setattr(friction_beginning, "fitted_to", lambda *_: at(law, 1.0))
    monkeypatch.setattr(friction_beginning, "led", lambda *_: at(law, 0.99))
    found = friction_beginning._begun(law, evidence, searched.floor, rival)
    assert found.left == [1.05, 1.0, 1.0]
    assert found.law.misfit == 0.99


@pytest.mark.parametrize(
    ("left", "draws"),
    [([1.0], 0), ([1.3, 1.0], 1), ([1.3, 1.2, 1.1], 2), ([1.3, 1.302], 1), ([1.02, 1.021, 1.0], 2)],
)
def test_machines_are_drawn_where_a_fit_does_not_find_back(
    monkeypatch: pytest.MonkeyPatch, left: list[float], draws: int
) -> None:
    """Until one leaves no more than the beginning before, or all are drawn; the best goes on.

    Or until two leave as much that is above the noise.
    """
    _, sheet, evidence = search({})
    law, drawn, ends = fullest(trial(sheet, ()), sheet), [], iter(left)

    def draw(*arguments: object) -> Array:
        drawn.append(arguments)
        return law.x + 1e-3

    monkeypatch.setattr(stick_slip, "drawn", draw)
    monkeypatch.setattr(stick_slip, "fitted_to", lambda *_: at(law, next(ends)))
    found = stick_slip._found_again(law, evidence, at(law, 1.0), descended, 1e-3, 2)
    assert found.misfit == min(left)
    assert len(drawn) == draws


def test_a_law_is_led_to_the_whole_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Again where its beginning is clearly better, and not at all where that is too far off."""
    _, sheet, evidence = search({})
    law, led = fullest(trial(sheet, ()), sheet), []
    whole = max(float(e.time[-1]) for e in evidence.experiments)
    beginnings = iter([1.09, 1.08, 1.05, 1.2])

    def lead(*arguments: object) -> Led:
        led.append(arguments)
        return Led(at(law, 1.3), whole, at(law, 1.0), 12.0)

    monkeypatch.setattr(stick_slip, "fitted_to", lambda *_: at(law, next(beginnings)))
    monkeypatch.setattr(stick_slip, "led_on", lead)
    growths = Growths(evidence)
    first = growths.grown(law)
    assert growths.grown(law) is first
    assert len(led) == 1
    assert growths.grown(law) is not first
    assert len(led) == 2
    assert Growths(evidence).at_noise(law) is None
    assert len(led) == 2


def test_a_law_of_seals_that_spring_back_is_led_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    _, sheet, evidence = search({})
    giving = along_the_way(fullest(trial(sheet, ()), sheet))
    laws, led = [giving, elastic(giving)], []

    def lead(law: Trial, *_: object) -> Led:
        led.append(law)
        return Led(at(law, 1.3), 12.0, at(law, 1.0), 10.0)

    monkeypatch.setattr(stick_slip, "fitted_to", lambda law, *_: at(law, 1.05))
    monkeypatch.setattr(stick_slip, "led_on", lead)
    growths = Growths(evidence)
    found = [growths.followed(law).trial.x.size for law in laws]
    assert led == laws
    assert found == [law.x.size for law in laws]


def test_a_law_that_was_given_up_is_led_on_from_there(monkeypatch: pytest.MonkeyPatch) -> None:
    _, sheet, evidence = search({})
    law, begun = fullest(trial(sheet, ()), sheet), []
    whole, first = max(float(e.time[-1]) for e in evidence.experiments), at(law, 1.05)
    followed, lost = Led(at(law, 1.2), 12.0, first, 10.0), Led(at(law, 1.3), whole, first, 12.0)
    ends = iter([followed, lost])

    def lead(*arguments: object) -> Led:
        begun.append((arguments[2], arguments[3]))
        return next(ends)

    monkeypatch.setattr(stick_slip, "fitted_to", lambda *_: first)
    monkeypatch.setattr(stick_slip, "led_on", lead)
    growths = Growths(evidence)
    found = growths.followed(law)
    assert growths.followed(law) is found
    assert found[1:4] == (1.2, 12.0, True)
    assert growths.grown(law)[1:4] == (1.3, whole, False)
    assert [(fit.misfit, time) for fit, time in begun] == [(1.05, stick_slip.DECIDED), (1.2, 12.0)]


def test_a_law_that_falls_behind_its_rival_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Friction by the load in the machine, Coulomb's is led along; the rival has the truth."""
    load = {
        "effects.pressure_dependent_friction.coefficient": 0.08,
        "effects.pressure_dependent_friction.smoothing_speed": 1e-3,
    }
    searched, sheet, evidence = search(load)
    wrong = fit_balances(trial(sheet, ("coulomb_friction",)), evidence, searched.floor)
    right = fit_balances(trial(sheet, ("pressure_dependent_friction",)), evidence, searched.floor)
    right = fit_free_run(right, evidence)
    assert at_noise(right, evidence)
    whole = max(float(e.time[-1]) for e in evidence.experiments)
    monkeypatch.setattr(stick_slip, "DECIDED", 3.0)
    reached = []
    errors = stick_slip._errors

    def watched(known: Trial, part: Evidence, points: Array) -> Array:
        reached.append(float(part.experiments[0].time[-1]))
        return errors(known, part, points)

    monkeypatch.setattr(stick_slip, "_errors", watched)
    grown = Growths(evidence).grown(wrong, right)
    assert grown.given_up
    assert grown.left > 1.1
    assert max(reached) < whole


def test_a_break_away_is_found_that_the_beginning_hardly_shows() -> None:
    """Ten seconds of one slow move, then moves to and fro, each of which sticks where it ends."""
    hidden = HIDDEN | {
        "effects.stribeck_friction.force": 4e3,
        "effects.stribeck_friction.breakaway": 1.7,
        "effects.viscous_friction.coefficient": 0.0,
    }
    command = recorded.moves(24.0, seed=5)
    time = recorded.COMMAND_PERIOD * np.arange(command.size)
    slow = np.interp(time, [1.0, 2.0, 10.6, 11.0], [0.0, 0.3, 0.3, 0.0])
    command = np.where(time < 11.0, slow, command)
    searched, _, evidence = search({}, lambda _: operated(with_values(joint1(), hidden), command))
    found = searched.run()[0]
    assert found.effects == ("stribeck_friction",)
    errors = np.concatenate(free_run_errors(found.machine, evidence))
    assert np.sqrt(np.mean(errors**2)) < 1.05


@pytest.mark.parametrize(("left", "over_all"), [(1.05, 0), (1.2, 1)])
def test_what_is_led_to_the_noise_is_not_fitted_over_all_at_once(
    monkeypatch: pytest.MonkeyPatch, left: float, over_all: int
) -> None:
    searched, sheet, evidence = search(HIDDEN)
    known = fit_balances(trial(sheet, ("coulomb_friction",)), evidence, searched.floor)
    fitted: list[Trial] = []

    def refine(known: Trial, *_: object) -> Trial:
        fitted.append(known)
        return known

    monkeypatch.setattr(whole_module, "follows_the_beginning", lambda *_: True)
    monkeypatch.setattr(whole_module, "refine_free_run", refine)
    led = Grown(known, left, 16.0, False, known, 12.0)
    monkeypatch.setattr(Growths, "followed", lambda *_: led)
    monkeypatch.setattr(Growths, "grown", lambda *_: led)
    searched.whole.fitted(known)
    assert len(fitted) == over_all


def test_a_break_away_is_looked_for_where_coulomb_s_friction_leaves_a_little(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Coulomb's, which the beginning tells, is at the noise; what it leaves shows later."""
    hidden = HIDDEN | {
        "effects.stribeck_friction.force": 1.15e3,
        "effects.stribeck_friction.breakaway": 2.0,
        "effects.stribeck_friction.smoothing_speed": 1e-3,
        "effects.viscous_friction.coefficient": 0.0,
    }
    command = recorded.moves(60.0, seed=3)
    searched, sheet, evidence = search(
        {}, lambda _: operated(with_values(joint1(), hidden), command)
    )
    start = fit_balances(trial(sheet, ("coulomb_friction",)), evidence, searched.floor)
    coulomb = searched.whole.fitted(fit_free_run(start, evidence))
    assert LEFT < math.sqrt(mean_square(coulomb, evidence)) < AT_NOISE
    begins = fit_balances(trial(sheet, ("stribeck_friction",)), evidence, searched.floor)
    fuller = fit_free_run(begins, evidence)
    monkeypatch.setattr(friction_told, "begun", lambda *_: fuller)
    monkeypatch.setattr(friction_told, "with_less_friction", lambda *_: [coulomb, fuller])
    _, found = searched._friction.told([coulomb], Tried(coulomb, 0.0))
    assert found.trial.effects == ("stribeck_friction",)
    assert math.sqrt(mean_square(found.trial, evidence)) < LEFT


def test_what_sticks_beside_another_first_effect_is_told_by_a_beginning(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    searched, sheet, evidence = search(HIDDEN)
    start = trial(sheet, ("stribeck_friction", "viscous_friction"))
    members = start.unknowns.members
    told = start.at(np.array([u.at(HIDDEN[u.path]) if u.path in HIDDEN else 0 for u in members]))
    coulomb = fit_balances(trial(sheet, ("coulomb_friction",)), evidence, searched.floor)
    monkeypatch.setattr(searched._friction, "_with_friction", lambda *_: told)
    assert searched._forward._sufficient([Tried(coulomb, 0.0, 0.0)]) == [told]


def test_coulomb_s_friction_is_one_with_a_break_away_of_one() -> None:
    """One law is the other with a parameter fixed, and no third one."""
    sheet = Sheet(joint1(), TOLERANCES, {}, ())
    coulomb, stribeck, viscous = (
        trial(sheet, (f"{name}_friction",)) for name in ("coulomb", "stribeck", "viscous")
    )
    assert nested(stribeck, coulomb)
    assert not nested(coulomb, stribeck)
    assert not nested(coulomb, coulomb)
    assert not nested(stribeck, viscous)

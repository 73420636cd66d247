"""Loads from outside that follow no formula, added by another integrator than the model's."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import recorded
from operated import COMMAND_STEPS, STEPS_PER_SAMPLE, operated
from test_diagnosis_search import TOLERANCES

from emir_analysis.diagnosis.balances import FORCE, sensed
from emir_analysis.diagnosis.diagnose import Findings, diagnose
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.experiment import COMMAND_STEP, OUTPUTS, Experiment
from emir_analysis.diagnosis.fitting import fit_balances
from emir_analysis.diagnosis.judged import STAGES, judged
from emir_analysis.diagnosis.load_course import (
    FORETOLD,
    elsewhere,
    foretold,
    load_course,
    may_be_loaded,
)
from emir_analysis.diagnosis.result import diagnosis
from emir_analysis.diagnosis.select import LEFT, beyond, excess
from emir_analysis.diagnosis.trial import trial
from emir_common.parameter_tree import with_values
from emir_plant.linkage import strokes
from emir_plant.parameters import Machine
from emir_plant.plant import Plant
from emir_plant.sheet import Sheet, joint1
from emir_plant.unnamed.load import COURSE

SHEET = Sheet(joint1(), TOLERANCES, {}, ())
SECONDS = 30.0
GUSTS = ((3.0, 3.5, -900.0), (8.0, 2.5, 600.0), (13.0, 5.0, -1200.0), (20.5, 4.0, 900.0))


def gusts(time: float) -> float:
    """Return the sum of gusts (begin, s, duration, s, size, N) that come and go as 1 - cos."""
    return sum(
        0.5 * size * (1.0 - math.cos(2.0 * math.pi * (time - begin) / length))
        for begin, length, size in GUSTS
        if begin < time < begin + length
    )


def pushes(time: float) -> float:
    """Return the force, N, of something on which the boom leans now and then, always from below."""
    held = ((3.0, 4.0, 900.0), (11.0, 6.0, 1200.0), (20.0, 7.0, 700.0), (33.0, 9.0, 1000.0))
    edge = 0.2  # s
    return sum(
        size * max(min((time - begin) / edge, (begin + length - time) / edge, 1.0), 0.0)
        for begin, length, size in held
    )


def pushed(
    machine: Machine,
    load: Callable[[float], float] | None,
    friction: recorded.Force | None = None,
    seed: int = 5,
    seconds: float = SECONDS,
) -> Experiment:
    """Return a run of random moves under a load as the sensors show it."""
    moves = recorded.moves(seconds, seed)
    truth = recorded.simulate(machine, moves, friction, load=load)
    commands = np.repeat(moves, COMMAND_STEPS)[: STEPS_PER_SAMPLE * (len(truth) - 1)]
    unseen = np.zeros(len(truth)), np.zeros((len(truth), len(OUTPUTS)))
    empty = Experiment("run", STEPS_PER_SAMPLE * COMMAND_STEP, commands, *unseen, 20)
    p_h, p_s, angle, tip = truth.T
    stroke = strokes(angle, Plant(machine).record[0])
    return sensed(empty, machine, np.column_stack([angle, stroke, p_h, p_s, tip - angle]))


def windy_machine() -> Machine:
    """Return a machine whose valve is off its middle."""
    return with_values(joint1(), {"effects.valve_null_offset.offset": 0.01})


@pytest.fixture(scope="module")
def windy() -> Findings:
    """Return what is found of it in gusts."""
    return diagnose([pushed(windy_machine(), gusts)], SHEET, print)


def test_gusts_are_a_load_beside_another_effect(windy: Findings) -> None:
    assert windy.verdict == "found"
    assert set(windy.chosen.effects) == {"valve_null_offset", "external_load"}
    offset = windy.chosen.machine.effects.valve_null_offset.offset
    assert offset == pytest.approx(0.01, rel=0.02)


def test_their_course_is_that_of_the_force(windy: Findings) -> None:
    load = windy.chosen.machine.unnamed_load
    time = np.linspace(load.first, load.last, len(load.course))
    true = np.array([gusts(t) for t in time])
    assert np.std(load.course - true) < 0.1 * np.std(true)
    assert load.joint_share == pytest.approx(0.0, abs=0.05)


def test_without_it_the_machine_is_foreseen_where_no_wind_blows(windy: Findings) -> None:
    calm = pushed(windy_machine(), None, seed=9)
    said = judged(windy, [replace(calm, name="calm")])
    assert said.off(STAGES[-1]) < 1.1
    result = diagnosis(windy, said)
    load = next(effect for effect in result.effects if effect.name == "external_load")
    furthest = load.parameters["force"]
    assert furthest.low < -1200.0 - load.parameters["mean"].value < furthest.high
    assert result.curve is not None
    assert result.curve.over == "time"


def test_what_was_learned_from_is_judged_with_the_load(windy: Findings) -> None:
    said = judged(windy, windy.evidence.experiments)
    assert said.off(STAGES[-1]) < 1.1


def test_pushes_in_one_direction_with_sharp_edges_are_a_load() -> None:
    """Their mean is foretold by anything, and they leave the noise alone."""
    stiff = with_values(joint1(), {"geometry.boom_mass": 3000.0, "cylinder.beta": 1.5e9})
    evidence = Evidence([pushed(stiff, pushes, seconds=2.0 * SECONDS)], stiff)
    floor = evidence.floor(stiff)
    known = fit_balances(trial(Sheet(stiff, TOLERANCES, {}, ()), ()), evidence, floor)
    found = load_course(known, evidence, floor, print)
    assert found is not None
    assert excess(found, evidence) < beyond(LEFT)


def test_friction_at_a_place_is_no_load() -> None:
    """A scored bore: what is missing follows from where the piston is and goes."""

    def scored(stroke: float, velocity: float) -> float:
        return 2e4 * math.exp(-(((stroke - 0.53) / 0.03) ** 2)) * math.tanh(velocity / 5e-3)

    experiment = pushed(joint1(), None, scored)
    evidence = Evidence([experiment], joint1())
    floor = evidence.floor(joint1())
    known = fit_balances(trial(SHEET, ()), evidence, floor)
    missing = evidence.residuals([known.machine])[0][:, FORCE]
    assert foretold(missing, evidence, float(floor[FORCE])) > FORETOLD
    assert load_course(known, evidence, floor, print) is None


def test_a_force_that_bends_no_arm_may_be_inside() -> None:
    """On the piston, where unknown friction acts, too."""
    time = np.linspace(0.0, SECONDS, COURSE)
    inside = {"over": 1, "last": SECONDS, "course": [gusts(t) for t in time], "joint_share": 1.0}
    hidden = with_values(joint1(), {f"unnamed_load.{name}": at for name, at in inside.items()})
    evidence = Evidence([operated(hidden, recorded.moves(SECONDS, 5))], joint1())
    floor = evidence.floor(joint1())
    known = fit_balances(trial(SHEET, ()), evidence, floor)
    assert may_be_loaded(known, evidence)
    assert load_course(known, evidence, floor, print) is None


def test_of_two_recordings_no_course_is_told(windy: Findings) -> None:
    """Which begin when they begin."""
    one, both = (Evidence(windy.evidence.experiments * k, joint1()) for k in (1, 2))
    known = fit_balances(trial(SHEET, ("valve_null_offset",)), one, windy.floor)
    assert may_be_loaded(known, one)
    assert not may_be_loaded(known, both)


def test_what_nothing_foretells_is_foretold_by_nothing(windy: Findings) -> None:
    """And a force in proportion to a signal all but wholly."""
    missing = windy.evidence.residuals([elsewhere(windy.chosen).machine])[0][:, FORCE]
    assert foretold(missing, windy.evidence, 0.0) < FORETOLD
    velocity = windy.evidence.signals()["piston_velocity"][1]
    assert foretold(1e5 * velocity, windy.evidence, 0.0) > 0.95

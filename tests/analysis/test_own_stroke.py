"""A stroke that a sensor of its own shows, not the angle and the stated linkage."""

import numpy as np
import pytest
import recorded
from operated import moved
from test_diagnosis_search import TOLERANCES

from emir_analysis.diagnosis.balances import LINKAGE, Balances, level, sensed
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.experiment import Experiment, experiment
from emir_analysis.diagnosis.free_run import free_runs
from emir_analysis.diagnosis.search import Search
from emir_analysis.signals import Recording, Signal
from emir_common.parameter_tree import with_values
from emir_plant.sheet import Sheet, joint1

ANGLE_STEP = joint1().sensors.resolver_step
GAP = {"effects.backlash.gap": 2e-3}
MEASURED = with_values(joint1(), {"sensors.own_stroke": 1})
WRONG_LINKAGE = {
    "effects.linkage_error.scale": 0.01,
    "effects.linkage_error.slope": -0.03,
    "effects.linkage_error.curvature": 0.05,
}


def shown(stroke: recorded.Array, truth: recorded.Array) -> Experiment:
    """Return a recording of a run with another stroke, (n,) m."""
    sensors = recorded.measured(joint1(), truth, seed=5)
    sensors["cylinder"] = (sensors["cylinder"][0], stroke)
    topics = {
        "joint_angle": "joint_states",
        "piston_stroke": "cylinder",
        "pressure_lifting": "pressure_lifting",
        "pressure_lowering": "pressure_lowering",
    }
    signals = {name: Signal(name, *sensors[topic], "") for name, topic in topics.items()}
    commands = recorded.moves(12.0, seed=5)
    time = np.arange(commands.size) * recorded.COMMAND_PERIOD
    signals["valve_command"] = Signal("valve_command", time, commands, "1")
    return experiment("run", Recording(signals, 0), joint1())


@pytest.fixture(scope="module")
def truth() -> recorded.Array:
    """A run of EMIR's main joint, (n, 4)."""
    return recorded.simulate(joint1(), recorded.moves(12.0, seed=5))


def stated(angle: recorded.Array) -> recorded.Array:
    """Return the stroke of the stated triangle, written a second time."""
    g = joint1().geometry
    a, b, gamma = g.triangle_a, g.triangle_b, g.triangle_gamma0
    length, at_zero = (
        np.sqrt(a**2 + b**2 - 2.0 * a * b * np.cos(x + gamma)) for x in (angle, np.zeros(1))
    )
    return np.asarray(length - at_zero)


def test_a_stroke_of_its_own_is_told_from_one_that_the_angle_makes(truth: recorded.Array) -> None:
    angle = np.round(truth[:, 2] / recorded.STEP) * recorded.STEP
    assert not shown(stated(angle), truth).own_stroke
    assert not shown(np.round(stated(angle), 4), truth).own_stroke  # written in 0.1 mm
    assert shown(1.02 * stated(angle), truth).own_stroke


def test_a_linkage_and_a_play_that_are_known_leave_the_balance_quiet(
    truth: recorded.Array,
) -> None:
    h = stated(truth[:, 2])
    built = h + 0.01 * h - 0.03 * h**2 / 2.0 + 0.05 * h**3 / 3.0
    cylinder = joint1().cylinder
    force = truth[:, 0] * cylinder.area_lifting - truth[:, 1] * cylinder.area_lowering
    assert force.min() > 1e5  # far from where the piston leaves its flank
    balances = Balances(shown(built + 1e-3, truth), joint1())
    right = with_values(MEASURED, WRONG_LINKAGE | GAP)
    others = [with_values(MEASURED, part) for part in ({}, WRONG_LINKAGE, GAP)]
    seen, *unseen = balances.residuals([right, *others])
    noise = ANGLE_STEP / np.sqrt(12.0) * 0.65  # the lever arm, m
    assert level(seen)[LINKAGE] < noise
    assert min(level(each)[LINKAGE] for each in unseen) > 3.0 * noise


@pytest.mark.parametrize(
    ("hidden", "name"),
    [
        ({"effects.linkage_error.scale": 0.015}, "linkage_error"),
        ({"effects.sensor_bias.angle": 8e-3}, "sensor_bias"),
        ({"effects.sensor_bias.stroke": -8e-3}, "sensor_bias"),
        ({"effects.sensor_gain.stroke": 0.02}, "sensor_gain"),
        ({"effects.sensor_delay.stroke": 0.05}, "sensor_delay"),
    ],
)
def test_what_shows_between_stroke_and_angle_is_named(hidden: dict[str, float], name: str) -> None:
    machine = with_values(MEASURED, hidden)
    own = moved(machine)
    ideal = free_runs([machine], own, [(0.8, 20e5)])[0]
    evidence = Evidence([sensed(own, machine, ideal)], MEASURED)
    found = Search(evidence, Sheet(MEASURED, TOLERANCES, {}, ()), lambda _: None).run()
    assert found[0].effects == (name,)

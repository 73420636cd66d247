"""Dry friction that comes along the way, of seals that give before they slide."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from emir_common.parameter_tree import with_values
from emir_common.quantity import ParameterError
from emir_plant import bristles, core
from emir_plant.bristles import Bristles
from emir_plant.core import Truth
from emir_plant.effects import terms
from emir_plant.plant import Plant
from emir_plant.robot.actuators import machines
from emir_plant.robot.sheet import robot
from emir_plant.sheet import data, joint1

STATED = data("joint1.yaml")

FORTY_FIVE = math.radians(45.0)
STROKE = Truth._fields.index("stroke")
SEALS = Bristles(2e4, 5e8, 0.0, 0.0)
ELASTIC = SEALS._replace(elastic=0.7)
BOTH = pytest.mark.parametrize("seals", [SEALS, ELASTIC], ids=["creep", "elastic"])


def _on_bristles(effect: str = "coulomb_friction", **fields: float) -> Plant:
    return Plant(with_values(joint1(), {f"effects.{effect}.{k}": v for k, v in fields.items()}))


@BOTH
def test_bristles_are_a_spring_at_first_and_slide_far_on(seals: Bristles) -> None:
    assert bristles.carried(0.0, 1e-8, seals) == pytest.approx(5e8 * 1e-8, rel=1e-3)
    assert bristles.carried(0.0, 1e-2, seals) == pytest.approx(2e4)
    assert bristles.carried(2e4, -1e-2, seals) == pytest.approx(-2e4)


@pytest.mark.parametrize(
    ("effect", "size"),
    [
        ("coulomb_friction", {"force": 1e4}),
        ("stribeck_friction", {"force": 1e4}),
        ("pressure_dependent_friction", {"coefficient": 0.03}),
    ],
)
def test_all_seals_may_be_elastic(effect: str, size: dict[str, float]) -> None:
    plant = _on_bristles(effect, **size, presliding=1e-4, elastic_share=0.7)
    assert terms.bristles(0.1, 3e5, plant.record[0]).elastic == pytest.approx(0.7)


def test_elastic_bristles_do_not_creep_under_a_force_that_comes_and_goes() -> None:
    """From 0.1 to 0.6 of what they slide at, elastic to 0.7: each way leads back to its start.

    What drifts so is the known fault of the others (Dupont et al. 2002).
    """
    way = 0.5 * SEALS.sliding / SEALS.stiffness
    ends = {}
    for seals in (SEALS, ELASTIC):
        force = 0.1 * seals.sliding
        for _ in range(10):
            force = bristles.carried(bristles.carried(force, way, seals), -way, seals)
        ends[seals] = force / seals.sliding
    assert ends[ELASTIC] == pytest.approx(0.1)
    assert ends[SEALS] < 0.0


@pytest.mark.parametrize("force", [-1.5e4, 0.0, 1.9e4])
@pytest.mark.parametrize("velocity", [-0.02, 0.003])
@BOTH
def test_along_the_way_is_what_the_rate_says(
    seals: Bristles, force: float, velocity: float
) -> None:
    """A way in two goes is the same as in one, and its start is the rate's."""
    half = bristles.carried(force, 5e-4 * velocity, seals)
    whole = bristles.carried(force, 1e-3 * velocity, seals)
    assert bristles.carried(half, 5e-4 * velocity, seals) == pytest.approx(whole)
    short = bristles.carried(force, 1e-6 * velocity, seals)
    rate = seals.stiffness * bristles.bending(force, velocity, seals)
    assert (short - force) / 1e-6 == pytest.approx(rate, rel=2e-3)


@BOTH
def test_a_way_there_and_back_takes_work(seals: Bristles) -> None:
    """Second law: no cycle of the piston gives any back, however short."""
    for reach in (1e-6, 4e-5, 1e-3):
        way = reach * np.sin(np.linspace(0.0, 4.0 * math.pi, 20001))
        forces = [0.0]
        for moved in np.diff(way):
            forces.append(bristles.carried(forces[-1], float(moved), seals))
        middle = 0.5 * (np.array(forces[1:]) + forces[:-1])
        second = len(middle) // 2  # settled
        work = middle[second:] @ np.diff(way)[second:]
        springs = seals is ELASTIC and reach < 0.7 * seals.sliding / seals.stiffness
        assert work == pytest.approx(0.0, abs=1e-9) if springs else work > 0.0


def test_a_held_piston_gives_no_further_than_its_seals_do() -> None:
    """1 % more pressure at once, 7 kN, and some times that as it swings, against 60 kN, for 10 s.

    It never slides, so it never creeps, as friction by the velocity lets it.
    """
    plant = _on_bristles(force=6e4, presliding=1e-4)
    state = plant.initial(FORTY_FIVE, 20e5)
    state[core.P_H] *= 1.01
    stroke = plant.simulate(state, np.zeros(10_000), 1e-3, 10)[:, STROKE]
    given = stroke - stroke[0]
    assert 1e-6 < given.max() < 1e-4
    assert np.abs(given).max() < 1e-4


@pytest.mark.parametrize(
    ("effect", "fields"),
    [
        ("coulomb_friction", {"force": 2e4, "presliding": 4e-5}),
        ("stribeck_friction", {"force": 1e4, "presliding": 4e-5, "presliding_time": 1.5e-3}),
        ("pressure_dependent_friction", {"coefficient": 0.03, "presliding": 4e-5}),
    ],
)
def test_it_agrees_with_a_stiff_solver(
    stiff_solver: Callable[..., np.ndarray], effect: str, fields: dict[str, float]
) -> None:
    """Lift, stop, lower, with the bristles' force as a differential equation."""
    plant, commands = _on_bristles(effect, **fields), np.zeros(3000)
    commands[100:1000], commands[1500:2500] = 0.5, -0.5
    start = plant.initial(FORTY_FIVE, 20e5)
    ours = plant.simulate(start, commands, 1e-3)
    exact = np.array([plant.outputs(x) for x in stiff_solver(plant, start, commands, "LSODA")])
    assert np.ptp(exact[:, STROKE]) > 0.02
    assert np.abs(ours[:, STROKE] - exact[:, STROKE]).max() < 5e-6  # a tenth of a resolver step
    for name in ("pressure_lifting", "pressure_lowering"):
        k = Truth._fields.index(name)
        assert np.abs(ours[:, k] - exact[:, k]).max() < 2e-3 * np.ptp(exact[:, k]), name


def test_the_robots_state_has_no_place_for_bristles(
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    pytest.importorskip("pinocchio")
    file = tmp_path_factory.mktemp("machine") / "machine.yaml"
    rubs = "effects: {coulomb_friction: {force: 3.0e+3, presliding: 5.0e-5}}"
    file.write_text(f"based_on: {STATED}\n{rubs}\n")
    known = robot(None, file)
    expected = r"effects.coulomb_friction.presliding: not in the model of the whole robot"
    with pytest.raises(ParameterError, match=expected):
        machines(known, ())

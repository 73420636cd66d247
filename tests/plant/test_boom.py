"""The boom against the analytic beam and the paper's numbers."""

import math

import numpy as np
import pytest

from emir_common.parameter_tree import with_values
from emir_plant import core
from emir_plant.boom import PointMass, boom_modes, section_model
from emir_plant.linearize import linearize
from emir_plant.plant import Plant
from emir_plant.sheet import joint1

GRAVITY = 9.81
FORTY_FIVE = math.radians(45.0)
GEOMETRY = joint1().geometry
MASS_PER_LENGTH = GEOMETRY.boom_mass / GEOMETRY.boom_length
SPRINGS = GEOMETRY.arms * (GEOMETRY.sections_per_arm - 1)
BENDING_STIFFNESS = GEOMETRY.section_spring * GEOMETRY.boom_length / SPRINGS  # E I, N m^2


def test_pinned_free_frequencies_are_those_of_the_uniform_beam() -> None:
    # roots of tan x = tanh x
    lengths = np.array([3.926602, 7.068583])
    scale = math.sqrt(BENDING_STIFFNESS / MASS_PER_LENGTH) / GEOMETRY.boom_length**2
    expected = lengths**2 * scale / (2.0 * math.pi)
    found = boom_modes(GEOMETRY).frequency[1:3] / (2.0 * math.pi)
    assert found == pytest.approx(expected, rel=0.02)


def test_slowest_mode_of_the_mechanics_is_the_papers_5_4_hz() -> None:
    """From the linearized model with the piston force held: no oil spring."""
    plant = Plant(joint1())
    model = linearize(plant, plant.initial(FORTY_FIVE))
    boom = model.states >= core.MODES
    mechanics = model.A[np.ix_(boom, boom)]
    poles = np.linalg.eigvals(mechanics)
    oscillating = np.abs(poles[poles.imag > 1.0]) / (2.0 * math.pi)
    assert oscillating.min() == pytest.approx(5.4, abs=0.1)


def test_static_deflection_is_the_papers_18_cm_and_the_beams() -> None:
    truth = Plant(joint1()).outputs(Plant(joint1()).initial(FORTY_FIVE))
    load = MASS_PER_LENGTH * GRAVITY * math.cos(FORTY_FIVE)
    beam = load * GEOMETRY.boom_length**4 / (8.0 * BENDING_STIFFNESS)
    assert -truth.tcp_deflection == pytest.approx(beam, rel=0.02)
    assert -truth.tcp_deflection == pytest.approx(0.18, abs=0.01)


def test_section_model_has_the_mass_and_moment_of_the_boom() -> None:
    model = section_model(GEOMETRY)
    rigid = np.ones(len(model.weight))
    inertia = GEOMETRY.boom_mass * GEOMETRY.boom_length**2 / 3.0
    assert rigid @ model.mass @ rigid == pytest.approx(inertia, rel=1e-12)
    moment = GEOMETRY.boom_mass * GRAVITY * GEOMETRY.boom_length / 2.0
    assert model.weight.sum() == pytest.approx(moment, rel=1e-12)
    assert np.abs(model.stiffness @ rigid).max() < 1e-6  # turning as a whole bends nothing


@pytest.mark.parametrize("place", [0.37, 0.85, 1.0, 1.1])
def test_a_mass_on_the_boom_weighs_and_turns_where_it_is(place: float) -> None:
    """A mass m at d has the moment m g d and the inertia m d^2: no mass at the TCP has both."""
    empty, loaded = section_model(GEOMETRY), section_model(GEOMETRY, PointMass(300.0, place))
    rigid, reach = np.ones(len(empty.weight)), place * GEOMETRY.boom_length
    inertia = rigid @ (loaded.mass - empty.mass) @ rigid
    assert inertia == pytest.approx(300.0 * reach**2, rel=1e-10)
    moment = (loaded.weight - empty.weight).sum()
    assert moment == pytest.approx(300.0 * GRAVITY * reach, rel=1e-10)


def test_a_mass_half_way_bends_the_boom_as_a_beam() -> None:
    """Its tip sags by P a^2 (3 L - a) / (6 E I)."""
    there = {"effects.payload.mass": 500.0, "effects.payload.place": 0.5}
    empty, loaded = Plant(joint1()), Plant(with_values(joint1(), there))
    sag = [p.outputs(p.initial(FORTY_FIVE)).tcp_deflection for p in (empty, loaded)]
    force, reach = 500.0 * GRAVITY * math.cos(FORTY_FIVE), 0.5 * GEOMETRY.boom_length
    beam = force * reach**2 * (3.0 * GEOMETRY.boom_length - reach) / (6.0 * BENDING_STIFFNESS)
    assert sag[0] - sag[1] == pytest.approx(beam, rel=0.02)


def test_more_modes_than_coordinates_are_refused() -> None:
    from dataclasses import replace

    few = replace(GEOMETRY, arms=1, sections_per_arm=2, modes_kept=5)
    with pytest.raises(ValueError, match="has only 2 modes"):
        boom_modes(few)

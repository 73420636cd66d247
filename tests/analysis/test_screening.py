"""Where the fit of an effect begins, and that it goes on from there."""

import math

import numpy as np
import pytest
from operated import moved
from scipy.stats import norm

from emir_analysis.diagnosis.candidate import SOFT_NOISE, Left, soft
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.fit import Problem, fit
from emir_analysis.diagnosis.fitting import fit_balances
from emir_analysis.diagnosis.screening import OnBalances
from emir_analysis.diagnosis.trial import Trial, trial
from emir_analysis.diagnosis.unknowns import unknowns
from emir_analysis.signals import Array
from emir_common.parameter_tree import with_values
from emir_plant.effects import REGISTRY
from emir_plant.parameters import Machine
from emir_plant.sheet import Sheet, joint1

TIME = np.arange(0.5, 59.5, 0.25)  # s


def test_noise_costs_what_the_normal_distribution_makes_it_cost() -> None:
    weighed = norm.expect(lambda z: soft(np.array([z])))
    assert pytest.approx(weighed, abs=1e-3) == SOFT_NOISE


@pytest.mark.parametrize("effect", REGISTRY)
def test_an_effect_may_be_tried_at_the_edges_of_its_range(effect: str) -> None:
    tried = unknowns(Sheet(joint1(), {}, {}, ()), (effect,))
    for edge in tried.bounds:
        tried.at(edge)  # raises outside the range


def test_a_robust_fit_goes_on_after_steps_that_were_too_long() -> None:
    """Errors of a hundred times the noise: the soft loss is flat there and steps overshoot."""
    wave = np.sin(2.0 * np.pi * 0.214 * TIME + 1.6)

    def model(points: Array) -> Array:
        return np.array([150.0 * (np.sin(2.0 * np.pi * x[0] * TIME + x[1]) - wave) for x in points])

    free = np.zeros(2, dtype=bool)
    begin, low, high = np.array([0.2115, 1.6]), np.zeros(2), np.array([10.0, 6.3])
    found = fit(Problem(model, begin, low, high, free), 1e-3, robust=True)
    assert found.x == pytest.approx([0.214, 1.6], abs=5e-5)


def test_what_shapes_an_effect_is_not_moved_along_straight_lines() -> None:
    """By their slopes two of a load's sizes and three of its shapes would do best further on."""
    members = unknowns(Sheet(joint1(), {"cylinder.beta": 0.15}, {}, ()), ("external_load",))
    x = members.start.copy()
    paths = [unknown.path.rsplit(".", 1)[1] for unknown in members.members]
    wanted = x + np.isin(paths, ["beta", "force", "mean", "start", "phase", "piston_share"]) * 0.4
    known = Trial(("external_load",), members, x, np.full((x.size, x.size), np.nan))

    def missing(trials: list[Trial]) -> Array:
        return np.array([1e3 * (one.x - wanted) for one in trials])

    (best,) = Left(known, missing, 1e-3).inside([known])[1]
    moved = {name for name, b, a in zip(paths, best, x, strict=True) if abs(b - a) > 1e-3}
    assert moved == {"beta", "force", "mean"}
    assert best[paths.index("force")] == pytest.approx(x[paths.index("force")] + 0.4, rel=1e-3)


def test_parameters_that_do_their_best_stay_inside_their_bounds_to_the_last_digit() -> None:
    """Random straight residuals whose optimum lies far off."""
    members = unknowns(Sheet(joint1(), {}, {}, ()), ("valve_dead_zone_error", "linkage_error"))
    low, high = members.bounds
    random = np.random.default_rng(0)
    size = low.size
    on_bounds = 0
    for _ in range(300):
        slopes, wanted = random.normal(size=(40, size)), random.normal(0.0, 30.0, size)
        x = random.uniform(low, high)
        known = Trial((), members, x, np.full((size, size), np.nan))

        def missing(trials: list[Trial], a: Array = slopes, b: Array = wanted) -> Array:
            return np.array([a @ (one.x - b) for one in trials])

        (best,) = Left(known, missing, 1e-3).inside([known])[1]
        members.at(best)  # raises outside the range
        assert np.all((best >= low) & (best <= high))
        on_bounds += np.count_nonzero((best == low) | (best == high))
    assert on_bounds > 100


def test_a_machine_that_runs_away_leaves_the_parameters_as_they_are() -> None:
    """It leaves so much that its square is no number: no change of theirs leads anywhere."""
    members = unknowns(Sheet(joint1(), {}, {}, ()), ("valve_dead_zone_error",))
    known = Trial((), members, members.start, np.full((members.start.size,) * 2, np.nan))
    runaway = known.at(members.start + 1e-3)

    def missing(trials: list[Trial]) -> Array:
        left = [1e171 if one is runaway else 30.0 for one in trials]
        return np.outer(left, np.linspace(1.0, 2.0, 40)) + [[5.0 * one.x[0]] for one in trials]

    residuals, x = Left(known, missing, 1e-3).inside([known, runaway])
    assert np.all(x[1] == known.x)
    assert np.max(residuals[1]) >= 1e171


def test_what_was_simulated_is_not_simulated_again_for_its_cost() -> None:
    """Half the sum of soft squares of what trials leave as they are, in their order."""
    members = unknowns(Sheet(joint1(), {"cylinder.beta": 0.15}, {}, ()), ("payload",))
    known = Trial((), members, members.start, np.full((members.start.size,) * 2, np.nan))
    asked: list[float] = []

    def missing(trials: list[Trial]) -> Array:
        asked.extend(one.x[0] for one in trials)
        return np.array([np.full(40, one.x[0] - 0.2) for one in trials])

    first, second, third = (
        known.at(known.x + step * np.eye(members.start.size)[0]) for step in (0.1, 0.2, 0.3)
    )
    left = Left(known, missing, 1e-3)
    left.inside([third, first])
    asked.clear()
    expected = [40.0 * ((1.0 + (x - 0.2) ** 2) ** 0.5 - 1.0) for x in (0.1, 0.2, 0.3)]
    assert left.costs([first, second, third]) == pytest.approx(expected)
    assert asked == [second.x[0]]


def similar(size: float) -> Machine:
    """Return a machine so many times as long as EMIR, at the same pressures, times and angles.

    Its boom swings the slower the longer it is; the mass goes with the square of its length, as
    the section of a box of the same walls does.
    """
    emir = joint1()
    powers = {
        "geometry": {"boom_length": 1, "boom_mass": 2, "triangle_a": 1, "triangle_b": 1},
        "cylinder": {"area_lifting": 2, "area_lowering": 2},
        "valve": {"flow_nominal": 3},
    }
    powers["geometry"]["section_spring"] = 2
    powers["cylinder"] |= {"volume_lifting_0": 3, "volume_lowering_0": 3}
    powers["resistances"] = dict.fromkeys(vars(emir.resistances), -6)
    return with_values(
        emir,
        {
            f"{group}.{name}": getattr(getattr(emir, group), name) * size**power
            for group, names in powers.items()
            for name, power in names.items()
        },
    )


@pytest.mark.parametrize("size", [1.0, 0.5])
def test_an_effect_that_shows_only_when_it_is_large_is_seen(size: float) -> None:
    """A droop of the supply is felt only where the pressure left is short: a trial size makes none.

    The load takes some 100 bar, the balance 8, so that a droop of 15 bar changes nothing. A
    smaller machine takes less oil, so that the same droop belongs to a higher resistance.
    """
    stated, resistance = similar(size), 1.9e10 / size**3
    droop = {"effects.supply_pressure_droop.resistance": resistance}
    evidence = Evidence([moved(with_values(stated, droop))], stated)
    floor = evidence.floor(stated)
    sheet = Sheet(stated, {"cylinder.beta": 0.15, "valve.flow_nominal": 0.03}, {}, ())
    plain = fit_balances(trial(sheet, ()), evidence, floor)
    first = OnBalances(plain, sheet, evidence, floor).singles[0].trial
    assert first.name == "supply_pressure_droop"
    found = first.machine.effects.supply_pressure_droop.resistance
    assert found == pytest.approx(resistance, rel=0.1)


@pytest.mark.parametrize("off", [85e5, 75e5, 66e5])
def test_one_of_several_sizes_is_seen_where_another_hides_it(off: float) -> None:
    """The logic block's pilot, begun beside its threshold, takes away what the threshold explains.

    A threshold of 106 bar and more, above which p_H has to be, in place of 40.
    """
    stated = joint1()
    spring = {"effects.logic_block_fault.threshold": off}
    evidence = Evidence([moved(with_values(stated, spring))], stated)
    floor = evidence.floor(stated)
    sheet = Sheet(stated, {"cylinder.beta": 0.15, "valve.flow_nominal": 0.03}, {}, ())
    plain = fit_balances(trial(sheet, ()), evidence, floor)
    first = OnBalances(plain, sheet, evidence, floor).singles[0].trial
    assert first.name == "logic_block_fault"
    assert first.machine.effects.logic_block_fault.threshold == pytest.approx(off, rel=0.05)


def test_an_effect_is_not_promised_parameters_beyond_their_tolerances() -> None:
    """Air alone would explain softer hoses too, if the cylinders were larger than they can be."""
    stated = joint1()
    soft = {
        "effects.entrained_air.share": 0.013,
        "effects.vessel_compliance.lifting": 2.25e-11,
    }
    evidence = Evidence([moved(with_values(stated, soft))], stated)
    floor = evidence.floor(stated)
    tolerances = {"cylinder.beta": 0.15, "cylinder.volume_lifting_0": 0.1}
    sheet = Sheet(stated, tolerances, {}, ())
    plain = fit_balances(trial(sheet, ()), evidence, floor)
    assert OnBalances(plain, sheet, evidence, floor).singles[0].trial.name == "vessel_compliance"
    first = OnBalances(plain, sheet, evidence, floor).pairs[0].trial
    assert set(first.effects) == {"entrained_air", "vessel_compliance"}


@pytest.mark.parametrize("edge", [0.0, 1.0, -1.0])
def test_it_is_told_which_edge_of_the_valve_is_off(edge: float) -> None:
    """Alone, and beside air in the oil."""
    stated = joint1()
    off = {"effects.valve_dead_zone_error.error": 0.03, "effects.valve_dead_zone_error.edge": edge}
    air = {"effects.entrained_air.share": 0.013}
    for hidden in (off, off | air):
        evidence = Evidence([moved(with_values(stated, hidden))], stated)
        floor = evidence.floor(stated)
        sheet = Sheet(stated, {"cylinder.beta": 0.15, "valve.flow_nominal": 0.03}, {}, ())
        plain = fit_balances(trial(sheet, ()), evidence, floor)
        begun = OnBalances(plain, sheet, evidence, floor)
        first = (begun.pairs if hidden.keys() > off.keys() else begun.singles)[0].trial
        assert set(first.effects) == {path.split(".")[1] for path in hidden}
        found = first.machine.effects.valve_dead_zone_error
        assert (found.edge, found.error) == (edge, pytest.approx(0.03, abs=0.003))


def test_what_the_residuals_do_not_depend_on_stays_unknown() -> None:
    def model(points: Array) -> Array:
        return np.array([x[0] * TIME - 2.0 * TIME for x in points])

    free = np.zeros(2, dtype=bool)
    found = fit(Problem(model, np.ones(2), np.zeros(2), np.full(2, 9.0), free), 1e-6)
    assert found.covariance[0, 0] == pytest.approx(1.0 / np.sum(TIME**2), rel=1e-3)
    assert found.covariance[1, 1] == math.inf

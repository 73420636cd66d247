"""Which curves the sensors of a recording allow, and where they begin."""

import numpy as np
import pytest
from operated import moved, without

from emir_analysis.diagnosis.curves import (
    KINDS,
    Curve,
    Kind,
    as_far_as_recorded,
    curve,
    ends,
    told_forms,
)
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.experiment import Experiment
from emir_analysis.diagnosis.fitting import fit_balances, fit_free_run
from emir_analysis.diagnosis.trial import Trial, trial
from emir_analysis.diagnosis.unnamed import Curves
from emir_common.parameter_tree import with_values
from emir_plant.curve import POINTS
from emir_plant.parameters import Machine
from emir_plant.sheet import Sheet, joint1

H, S = 1, 2  # columns of the outputs
WIDENED = 5e-19  # m^3/(s Pa^2), 5e-5 m^3/s at 100 bar
AT = np.linspace(0.3, 0.7, POINTS)
SPRING = 3e4 * np.sin(20.0 * AT)  # N, a lifting force by the stroke


def recording(machine: Machine) -> Experiment:
    return moved(machine, 20.0, seed=6)


@pytest.fixture(scope="module")
def plain() -> Experiment:
    return recording(joint1())


def told(experiment: Experiment) -> set[tuple[str, str, tuple[str, ...]]]:
    evidence = Evidence([experiment], joint1())
    return {(k.group, k.over, form) for k in KINDS for form in told_forms(k, evidence)}


def test_a_curve_is_told_as_far_as_each_chamber_was(plain: Experiment) -> None:
    """The lowering chamber never has the pressures of the lifting one."""
    evidence = Evidence([plain], joint1())
    places = tuple(np.linspace(0.0, 200e5, POINTS))
    leak = (1e-6,) * POINTS
    whole = Curve(
        "unnamed_leakage",
        "own_pressure",
        "Pa",
        places,
        "m^3/s",
        {"lifting": leak, "lowering": leak},
    )
    shown = as_far_as_recorded(whole, evidence).parts
    for name, column in (("lifting", H), ("lowering", S)):
        pressure = plain.outputs[:, column]
        reached = np.interp(pressure, places, shown[name])  # NaN where a neighbour is
        assert np.all(np.isfinite(reached))
        told = np.array(places)[np.isfinite(shown[name])]
        assert told[0] > pressure.min() - places[1]
        assert told[-1] < pressure.max() + places[1]
    assert np.nansum(shown["lowering"]) < np.nansum(shown["lifting"])


def test_a_curve_wants_a_sensor_for_every_balance_in_which_it_acts(plain: Experiment) -> None:
    everything = told(plain)
    assert everything == {(k.group, k.over, form) for k in KINDS for form in k.forms}
    lacking = told(without(plain, "pressure_lowering"))
    assert lacking == {
        ("unnamed_leakage", "own_pressure", ("lifting",)),
        ("unnamed_compliance", "own_pressure", ("lifting",)),
    }
    neither = without(without(plain, "pressure_lowering"), "pressure_lifting")
    assert told(neither) == set()


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: f"{kind.group}-{kind.over}")
def test_a_curve_runs_over_where_the_recording_was(kind: Kind, plain: Experiment) -> None:
    first, last = ends(kind, Evidence([plain], joint1()))
    assert first < last
    stroke, high, low = plain.outputs[:, 0], plain.outputs[:, H], plain.outputs[:, S]
    expected = {
        "piston_stroke": (stroke.min(), stroke.max()),
        "own_pressure": (min(low.min(), high.min()), max(low.max(), high.max())),
        "pressure_difference": ((high - low).min(), (high - low).max()),
        "valve_opening": (plain.commands.min(), plain.commands.max()),
    }
    if kind.over in expected:
        assert (first, last) == pytest.approx(expected[kind.over])


def test_nothing_is_measured_in_a_machine_that_lacks_nothing(plain: Experiment) -> None:
    evidence = Evidence([plain], joint1())
    sheet = Sheet(joint1(), {"cylinder.beta": 0.1}, {}, ())
    floor = evidence.floor(sheet.machine)
    balanced = fit_balances(trial(sheet, ()), evidence, floor)
    assert Curves(balanced, evidence, floor).measured() is None


def test_a_force_by_the_stroke_is_measured() -> None:
    """With a data sheet that tells everything, and with a tolerance."""
    values = {"over": 1, "first": AT[0], "last": AT[-1], "along": SPRING.tolist()}
    named = {f"unnamed_force.{name}": value for name, value in values.items()}
    evidence = Evidence([recording(with_values(joint1(), named))], joint1())
    for tolerances in ({}, {"cylinder.beta": 0.1}):
        sheet = Sheet(joint1(), tolerances, {}, ())
        floor = evidence.floor(sheet.machine)
        balanced = fit_balances(trial(sheet, ()), evidence, floor)
        found = Curves(balanced, evidence, floor).measured()
        shape = curve_of(found)
        assert (shape.name, shape.over, shape.parts.keys()) == (
            "unnamed_force", "piston_stroke", {"along"},
        )  # fmt: skip
        law = 3e4 * np.sin(20.0 * np.array(shape.signal))
        assert shape.parts["along"] == pytest.approx(law, abs=0.05 * 3e4)


def test_a_force_by_the_stroke_is_measured_beside_an_effect() -> None:
    """A heavy payload, without which it is not; what the curve does is found without it."""
    values = {"over": 1, "first": AT[0], "last": AT[-1], "along": SPRING.tolist()}
    named = {f"unnamed_force.{name}": value for name, value in values.items()}
    machine = with_values(joint1(), named | {"effects.payload.mass": 300.0})
    evidence = Evidence([recording(machine)], joint1())
    sheet = Sheet(joint1(), {}, {}, ())
    floor = evidence.floor(sheet.machine)
    balanced, loaded = [
        fit_balances(trial(sheet, effects), evidence, floor) for effects in ((), ("payload",))
    ]
    found = Curves(balanced, evidence, floor).measured(beside=loaded)
    shape = curve_of(found)
    assert (shape.name, shape.over) == ("unnamed_force", "piston_stroke")
    law = 3e4 * np.sin(20.0 * np.array(shape.signal))
    left = np.array(shape.parts["along"]) - law
    assert np.std(left) < 0.05 * 3e4  # a constant of it the payload may have


def test_a_curve_takes_the_place_of_an_effect_that_only_comes_near() -> None:
    """A gap that the pressure widens: its flow goes with the pressure's square."""
    at = np.linspace(0.0, 2e7, POINTS)
    values = {"over": 1, "first": at[0], "last": at[-1], "lifting": (WIDENED * at**2).tolist()}
    gap = with_values(joint1(), {f"unnamed_leakage.{name}": v for name, v in values.items()})
    shape = curve_of(instead(gap, "external_leakage"))
    assert (shape.name, shape.over, shape.parts.keys()) == (
        "unnamed_leakage", "own_pressure", {"lifting"},
    )  # fmt: skip
    pressure = np.array(shape.signal)
    often = (pressure > 9e6) & (pressure < 1.3e7)
    law = WIDENED * pressure[often] ** 2
    assert np.array(shape.parts["lifting"])[often] == pytest.approx(law, rel=0.05)


def test_no_curve_takes_the_place_of_an_effect_that_is_there() -> None:
    gap = {"effects.external_leakage.lifting": 5e-12}
    assert instead(with_values(joint1(), gap), "external_leakage") is None


BETWEEN = np.linspace(-0.3, 0.3, POINTS)  # m/s


@pytest.mark.parametrize(
    ("beside", "uneven"),
    [
        # 14 kN lifting, 5 kN lowering: an even friction and 4.5 kN against lifting while it moves
        ({"unnamed_force.over": 2, "unnamed_force.first": BETWEEN[0],
          "unnamed_force.last": BETWEEN[-1],
          "unnamed_force.along": (-4.5e3 * (np.abs(BETWEEN) > 1e-3)).tolist()}, True),
        ({}, False),
        ({"effects.sensor_bias.pressure_lifting": 1e5}, False),
        ({"effects.internal_leakage.coefficient": 1e-12}, False),
    ],
)  # fmt: skip
def test_friction_that_differs_with_the_direction_is_told_from_a_bias(
    beside: dict[str, object], *, uneven: bool
) -> None:
    friction = {"effects.coulomb_friction.force": 9.5e3}
    evidence = Evidence([recording(with_values(joint1(), friction | beside))], joint1())
    sheet = Sheet(joint1(), {"cylinder.beta": 0.1}, {}, ())
    floor = evidence.floor(sheet.machine)
    curves = Curves(fit_balances(trial(sheet, ()), evidence, floor), evidence, floor)
    second = (
        "internal_leakage" if "effects.internal_leakage.coefficient" in beside else "sensor_bias"
    )
    assert curves.uneven(trial(sheet, ("coulomb_friction", second))) == uneven


def test_friction_is_not_asked_about_where_no_sensor_tells_a_force() -> None:
    machine = with_values(joint1(), {"effects.coulomb_friction.force": 9.5e3})
    evidence = Evidence([without(moved(machine), "pressure_lowering")], joint1())
    sheet = Sheet(joint1(), {"cylinder.beta": 0.1}, {}, ())
    floor = evidence.floor(sheet.machine)
    curves = Curves(fit_balances(trial(sheet, ()), evidence, floor), evidence, floor)
    assert not curves.uneven(trial(sheet, ("coulomb_friction",)))


def curve_of(found: Trial | None) -> Curve:
    """Return the curve that was measured."""
    assert found is not None
    shape = curve(found.machine)
    assert shape is not None
    return shape


def instead(machine: Machine, effect: str) -> Trial | None:
    """Return what takes the place of an effect in the model of a machine."""
    evidence = Evidence([recording(machine)], joint1())
    sheet = Sheet(joint1(), {}, {}, ())
    floor = evidence.floor(sheet.machine)
    balanced = fit_balances(trial(sheet, ()), evidence, floor)
    named = fit_free_run(fit_balances(trial(sheet, (effect,)), evidence, floor), evidence)
    return Curves(balanced, evidence, floor).measured_instead(named)

"""Which value of a data sheet is another one in the machine."""

import numpy as np
import pytest
from operated import moved, without

from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.experiment import Experiment
from emir_analysis.diagnosis.fitting import fit_balances, fit_free_run
from emir_analysis.diagnosis.misstated import Misstated
from emir_analysis.diagnosis.trial import Trial, trial
from emir_common.parameter_tree import with_values
from emir_plant.curve import POINTS
from emir_plant.sheet import Sheet, joint1

TOLERANCES = {"cylinder.beta": 0.05, "cylinder.volume_lifting_0": 0.05}


def asked(experiment: Experiment, tolerances: dict[str, float] = TOLERANCES) -> list[Trial]:
    """Return the answers for a recording of EMIR's joint 1 with the data sheet above."""
    sheet = Sheet(joint1(), tolerances, {}, ())
    evidence = Evidence([experiment], sheet.machine)
    floor = evidence.floor(sheet.machine)
    balanced = fit_balances(trial(sheet, ()), evidence, floor)
    asked = Misstated(balanced, evidence, floor, lambda _: None)
    return asked.better_than(fit_free_run(balanced, evidence))


def recording(values: dict[str, float]) -> Experiment:
    return moved(with_values(joint1(), values), 20.0, seed=6)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("geometry.modal_damping", 0.06),  # the free run tells
        ("geometry.modal_damping", 0.04),  # hardly more than the noise is left without
        ("cylinder.area_lowering", 0.028),  # the balances tell
        ("cylinder.beta", 4e8),  # further off than its tolerance
    ],
)
def test_a_value_that_is_another_is_told_with_its_size(path: str, value: float) -> None:
    best, *_ = asked(recording({path: value}))
    wanted = best.unknowns.members[-1]
    assert wanted.path == path
    assert wanted.value(float(best.x[-1])) == pytest.approx(value, rel=0.03)
    low, high = wanted.deviation(float(best.x[-1]), 3.0 * float(best.spread[-1]))
    assert low < value < high


def test_it_is_told_of_a_sheet_that_is_sure_of_all_its_values() -> None:
    best, *_ = asked(recording({"geometry.modal_damping": 0.06}), {})
    assert [unknown.path for unknown in best.unknowns.members] == ["geometry.modal_damping"]


def test_it_is_told_without_any_pressure() -> None:
    """By the free run alone, where missing sensors leave the balances out."""
    blind = recording({"geometry.modal_damping": 0.06})
    for name in ("pressure_lifting", "pressure_lowering"):
        blind = without(blind, name)
    best, *_ = asked(blind)
    assert best.unknowns.members[-1].path == "geometry.modal_damping"


def test_what_is_no_matter_of_one_value_is_not_told_as_one() -> None:
    """A force by the stroke."""
    at = np.linspace(0.3, 0.7, POINTS)
    values = {"over": 1, "first": 0.3, "last": 0.7, "along": (3e4 * np.sin(20.0 * at)).tolist()}
    forced = with_values(joint1(), {f"unnamed_force.{k}": v for k, v in values.items()})
    assert not asked(moved(forced, 20.0, seed=6))


def test_parameters_that_are_as_stated_are_not_told() -> None:
    """Another value inside its tolerance, and one off by less than anybody could tell."""
    values = {"cylinder.beta": 5.1e8, "cylinder.area_lowering": joint1().cylinder.area_lowering}
    values["cylinder.area_lowering"] *= 1.0001
    assert not asked(recording(values))

"""Where a run starts, and that only effects stay in a model which its recordings need."""

import math
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import recorded
from operated import moved, operated, without

from emir_analysis.closed_loop import ClosedLoop
from emir_analysis.diagnosis import free_run_fits
from emir_analysis.diagnosis.balances import BALANCES, Balances, level, sensed
from emir_analysis.diagnosis.black_box import train, train_one_step
from emir_analysis.diagnosis.diagnose import diagnose, loudest
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.experiment import Experiment
from emir_analysis.diagnosis.fitting import fit_balances, fit_free_run, refine_free_run
from emir_analysis.diagnosis.foresight import is_enough
from emir_analysis.diagnosis.free_run import free_runs
from emir_analysis.diagnosis.friction_laws import uneven, viscous_is_heard, with_square
from emir_analysis.diagnosis.judged import judged
from emir_analysis.diagnosis.result import ParameterResult, effect_results
from emir_analysis.diagnosis.rounds import CLOSE
from emir_analysis.diagnosis.run_errors import at_rest, mean_square
from emir_analysis.diagnosis.screening import OnBalances, Screened, screen_free_run
from emir_analysis.diagnosis.search import Search
from emir_analysis.diagnosis.select import (
    AT_NOISE,
    EXPLAINED,
    HOPELESS,
    LEFT,
    SEEN,
    STRONG,
    at_noise,
    balance_score,
    beyond,
    excess,
    free_run_score,
    limits,
    quiet,
    speaks,
)
from emir_analysis.diagnosis.starts import Starts
from emir_analysis.diagnosis.statement import closest, statement, verdict
from emir_analysis.diagnosis.trial import Trial, trial
from emir_analysis.diagnosis.trial import moved as changed
from emir_analysis.diagnosis.tried import Tried, free
from emir_analysis.diagnosis.unknowns import first_tried, unknowns
from emir_analysis.errors import InputError
from emir_analysis.node_controls import CascadeControl
from emir_analysis.root_mean_square import column_rms
from emir_common.parameter_tree import declared, with_values
from emir_control.cascade import Cascade, CascadeParameters
from emir_control.trajectory import TrajectoryParameters, named
from emir_plant.effects import external_load, vessel_compliance
from emir_plant.plant import Plant
from emir_plant.sheet import Sheet, joint1

TOLERANCES = {"cylinder.beta": 0.15, "valve.flow_nominal": 0.03}
FRICTION = {"effects.viscous_friction.coefficient": 1e5}  # N s/m
BLOCK = "effects.logic_block_fault"
SHIFT = {"effects.valve_null_offset.offset": 0.03}


def without_p_s(experiment: Experiment) -> Experiment:
    return without(experiment, "pressure_lowering")


def search(
    missing: dict[str, float], seen: Callable[[Experiment], Experiment] = lambda e: e
) -> tuple[Search, Sheet, Evidence]:
    """Return the search for what a data sheet lacks, before its first round."""
    stated = joint1()
    evidence = Evidence([seen(moved(with_values(stated, missing)))], stated)
    sheet = Sheet(stated, TOLERANCES, {}, ())
    return Search(evidence, sheet, lambda _: None), sheet, evidence


def diagnosed(missing: dict[str, float]) -> Trial:
    """Return the trial that a search ends with, as it is named."""
    searched, _, _ = search(missing)
    return searched.named(searched.run()[0])


def needed(searched: Search, chosen: Trial) -> Trial:
    """Return a trial without the effects that are not needed."""
    return searched.elimination.needed(chosen, searched.refitted)


def fitted(begun: tuple[Search, Sheet, Evidence], *effects: str) -> Trial:
    """Return a trial with the effects, fitted."""
    searched, sheet, evidence = begun
    start = fit_balances(trial(sheet, effects), evidence, searched.floor)
    return searched.whole.fitted(fit_free_run(start, evidence))


@pytest.mark.parametrize("samples", [2, 4, 10, 20])
def test_the_pressure_at_the_start_is_known_while_oil_leaks(samples: int) -> None:
    """A worn piston under 85 bar lets 0.08 l/s past, for which p_S rises by some 13 bar/s."""
    noise = joint1().sensors.pressure_noise
    time = np.arange(100) * 0.2 / samples
    outputs = np.zeros((100, 4))
    for seed in range(200):
        random = np.random.default_rng(seed)
        outputs[:, 2] = 25e5 + 13e5 * time + noise * random.standard_normal(100)
        found = Experiment("leak", time[1], np.zeros(0), time, outputs, samples).start()[1]
        assert abs(found - 25e5) < 4.5 * noise  # that seldom, of a line through two samples


def test_the_angle_at_the_start_is_known_while_the_boom_sinks() -> None:
    """Through a leak, by many steps of a fine resolver, before the first move."""
    leaky = {"effects.internal_leakage.coefficient": 2e-11, "sensors.resolver_bits": 19}
    machine = with_values(joint1(), leaky)
    step = machine.sensors.resolver_span / 2**machine.sensors.resolver_bits
    experiment = moved(machine, 2.0)
    assert np.ptp(experiment.angle[: experiment.rest]) > 4.0 * step
    assert abs(experiment.start()[0] - 0.8) <= 0.5 * step


def test_readings_that_stay_the_same_count_as_one() -> None:
    outputs = np.random.default_rng(1).standard_normal((6, 4))
    outputs[:, 0] = [0.0, 1.0, 1.0, 1.0, 1.0, 0.0]
    outputs[:, 3] = np.nan
    shown = Experiment("steps", 0.01, np.zeros(0), np.zeros(6), outputs, 1)
    assert shown.weights[:, 0] == pytest.approx([1.0, 0.5, 0.5, 0.5, 0.5, 1.0])
    assert np.all(shown.weights[:, 1:] == 1.0)


@pytest.mark.parametrize("pressure", [5e5, 12e5, 20e5, 50e5, 90e5])
def test_a_pressure_at_rest_that_no_sensor_shows_is_told_by_the_motion(pressure: float) -> None:
    machine = joint1()
    experiment = without_p_s(moved(machine, 12.0, pressure))
    found = at_rest(machine, experiment, Evidence([experiment], machine))[1]
    assert found == pytest.approx(pressure, abs=2.0 * machine.sensors.pressure_noise)


@pytest.mark.parametrize("pressure", [12e5, 60e5])
@pytest.mark.parametrize(
    "missing",
    [
        {},
        {"effects.payload.mass": 900.0},
        {"effects.sensor_bias.pressure_lifting": 3e5, "effects.sensor_bias.angle": 0.02},
    ],
)
def test_a_pressure_at_rest_that_no_sensor_shows_is_told_by_the_other(
    pressure: float, missing: dict[str, float]
) -> None:
    """Forces are in balance there, in each machine that is tried, in its own way."""
    machine = with_values(joint1(), missing)
    experiment = without_p_s(moved(machine, 10.0, pressure))
    starts = Starts(experiment, Evidence([experiment], joint1()))
    cylinder, rest = machine.cylinder, experiment.rest
    line = 2.0 * machine.sensors.pressure_noise / math.sqrt(rest)  # where it begins
    ratio = cylinder.area_lifting / cylinder.area_lowering
    found = starts.at(np.zeros((1, 2)), [machine])[0][1]
    assert abs(found - pressure) < 4.0 * ratio * line
    another = with_values(machine, {"effects.payload.mass": 300.0})
    angle = 0.8 - machine.effects.sensor_bias.angle
    more = Plant(another).initial(angle, pressure)[0] - Plant(machine).initial(angle, pressure)[0]
    other = starts.at(np.zeros((1, 2)), [another])[0][1]
    assert other == pytest.approx(np.clip(found - ratio * more, 2e5, 1e7), abs=1e4)


def test_a_payload_is_found_though_no_sensor_shows_how_it_rests() -> None:
    """Fitted without it, all parameters are led astray by the pressure that is then too high."""
    missing = {"effects.payload.mass": 1500.0}
    searched, _, _ = search(missing, without_p_s)
    found = searched.run()[0]
    assert found.effects == ("payload",)
    assert found.machine.effects.payload.mass == pytest.approx(1500.0, rel=0.02)


def test_a_balance_without_its_sensor_says_nothing() -> None:
    """Neither of a machine that is far off: force, lowering chamber and bending need p_S."""
    stated = joint1()
    evidence = Evidence([without_p_s(moved(with_values(stated, FRICTION)))], stated)
    left, floor = evidence.residuals([stated])[0], evidence.floor(stated)
    silent = [name in {"force", "lowering_chamber", "bending"} for name in BALANCES]
    assert np.all(np.isnan(left[:, silent]))
    assert np.all(np.isfinite(left[:, np.invert(silent)]))
    assert np.array_equal(np.isnan(floor), silent)
    assert loudest(1e6 * left, floor, limits(stated, evidence)) == "lifting_chamber"


def test_the_noise_of_a_balance_is_that_of_a_machine_with_another_boom() -> None:
    """A payload: what is missing counts in the stated machine's units, so does its noise."""
    stated = joint1()
    machine = with_values(stated, {"effects.payload.mass": 900.0})
    evidence = Evidence([moved(machine, 60.0)], stated)
    left, floor = level(evidence.residuals([machine])[0]), evidence.floor(machine)
    assert left[:3] == pytest.approx(floor[:3], rel=0.15)


def test_viscous_friction_is_kept_where_no_force_balance_tells_how_much_is_heard() -> None:
    stated = joint1()
    evidence = Evidence([without_p_s(moved(with_values(stated, FRICTION)))], stated)
    found = trial(Sheet(stated, TOLERANCES, {}, ()), ("viscous_friction",))
    assert viscous_is_heard(found, evidence, evidence.floor(stated))


def test_a_stiff_boom_is_simulated_in_steps_that_stay_stable() -> None:
    """Its fastest mode, 250 Hz, is beyond what steps of 2 ms can follow."""
    stiff = with_values(joint1(), {"geometry.section_spring": 16.0 * 1.839e8})
    assert Plant(stiff).fastest > 2.8 / 2e-3
    experiment = moved(stiff, 6.0)
    fine, coarse = (
        free_runs([stiff], experiment, [(0.8, 20e5)], coarse=each)[0] for each in (False, True)
    )
    assert np.all(np.isfinite(coarse))
    assert np.sqrt(np.mean((coarse - fine)[:, 2] ** 2)) < 0.1 * stiff.sensors.pressure_noise
    assert np.all(np.isfinite(Balances(experiment, stiff).residuals([stiff])))


def test_a_tolerance_leads_no_further_than_a_machine_can_be_built() -> None:
    stated = with_values(joint1(), {"cylinder.beta": 2.9e9})
    found = unknowns(Sheet(stated, {"cylinder.beta": 0.1}, {}, ()))
    for x in found.bounds:
        assert 0.89 * 2.9e9 < found.at(x).cylinder.beta < 1.04 * 2.9e9


def test_less_error_than_the_noise_is_no_merit() -> None:
    """At rest the free run may stand anywhere in the resolver's step."""
    stated = joint1()
    still = moved(stated, 30.0).until(0.9)  # before the first move
    scores = []
    for part in (-0.45, 0.0, 0.45):
        shown = replace(still, angle=still.angle + part * stated.sensors.resolver_step)
        evidence = Evidence([shown], stated)
        scores.append(free_run_score(trial(Sheet(stated, {}, {}, ()), ()), evidence, seen=0.0))
    assert max(scores) - min(scores) < 2.0


@pytest.mark.parametrize("angle", [0.75, 0.78, 0.8, 0.83, 0.86, 0.9, 0.95, 1.0])
def test_a_black_box_may_be_trained_where_a_signal_stays_as_it_is(angle: float) -> None:
    """At rest but for the last third: the stroke has no spread before."""
    commands = np.append(np.zeros(500), recorded.moves(8.0, seed=5))
    experiment = operated(joint1(), commands, angle=angle)
    model = train(Evidence([experiment], joint1()))
    assert np.all(np.isfinite(model.free_run(experiment)))


def test_a_load_that_is_gone_before_the_last_third_speaks_to_the_balances() -> None:
    """No window of the last third knows of a load that acted from 2 to 6 s of 16 s."""
    sizes = {"force": 1500.0, "start": 2.0, "duration": 4.0}
    others = ("mean", "frequency", "phase", "rise", "decay")
    others += ("piston_share", "joint_share", "vertical_share")
    sizes |= dict.fromkeys(others, 0.0)
    pulse = {f"effects.external_load.{name}": value for name, value in sizes.items()}
    searched, sheet, evidence = search(pulse)
    plain = fit_balances(trial(sheet, ()), evidence, searched.floor)
    loaded = trial(sheet, ("external_load",), plain)
    further = loaded.unknowns.members[plain.x.size :]
    loaded = loaded.at(np.append(plain.x, [u.at(pulse[u.path]) for u in further]))
    scores = [balance_score(t, evidence, searched.floor) for t in (loaded, plain)]
    assert scores[0] < scores[1] - STRONG


def test_a_load_that_swings_about_a_mean_from_before_the_start_is_begun_so() -> None:
    """Begun as a swing without one, the constant load seems to explain more."""
    sizes = {"mean": -600.0, "force": 300.0, "frequency": 0.175, "phase": -1.33, "start": -1.0}
    searched, sheet, evidence = search(
        {f"effects.external_load.{name}": value for name, value in sizes.items()}
    )
    plain = fit_balances(trial(sheet, ()), evidence, searched.floor)
    best = OnBalances(plain, sheet, evidence, searched.floor).singles[0].trial
    assert best.effects == ("external_load",)
    best = fit_balances(best, evidence, searched.floor)
    load = best.machine.effects.external_load
    middle = float(np.mean(evidence.experiments[0].angle))
    across = external_load.at_tip(1.0, middle, Plant(best.machine).record[0])
    assert across * load.mean == pytest.approx(-600.0, rel=0.02)
    lasted = 0.5 * float(evidence.experiments[0].time[-1]) - load.start  # in the middle
    amplitude = abs(load.force) * math.exp(-load.decay * lasted)
    assert across * amplitude == pytest.approx(300.0, rel=0.02)
    assert load.frequency == pytest.approx(0.175, rel=0.02)


@pytest.mark.parametrize(("payload", "reconciled"), [(0.0, True), (200.0, False)])
def test_a_judge_recording_lacks_nothing_that_other_parameters_explain(
    payload: float, *, reconciled: bool
) -> None:
    """Oil half a tolerance off, as if what was fitted had not told; the payload is no parameter."""
    _, sheet, evidence = search({})
    found = diagnose(evidence.experiments, sheet, lambda _: None)
    assert found.verdict == "nothing_missing"
    paths = [unknown.path for unknown in found.refitted.unknowns.members]
    off = found.refitted.x.copy()
    off[paths.index("cylinder.beta")] += 0.5
    off_there = replace(found, chosen=found.refitted.at(off), refitted=found.refitted.at(off))
    _, _, other = search({"effects.payload.mass": payload})
    judgement = judged(off_there, other.experiments)
    assert judgement.surprising
    assert judgement.reconciled == reconciled
    assert verdict(off_there, judgement) == ("nothing_missing" if reconciled else "unexplained")
    unclear = judged(replace(off_there, verdict="ambiguous"), other.experiments)
    assert unclear.reconciled == reconciled
    said = "which other parameters inside the tolerances explain as well: diagnose from that too"
    assert (said in statement(off_there, judgement)) == reconciled


def test_how_much_parameters_leave_is_said() -> None:
    _, sheet, evidence = search({})
    found = diagnose(evidence.experiments, sheet, lambda _: None)
    assert "the free run to the noise" in statement(found, judged(found, evidence.experiments))
    paths = [unknown.path for unknown in found.refitted.unknowns.members]
    off = found.refitted.x.copy()
    off[paths.index("cylinder.beta")] += 0.1
    near = replace(found, chosen=found.refitted.at(off))
    judgement = judged(near, evidence.experiments)
    left = judgement.off("with_effect")
    assert left > AT_NOISE
    assert f"the free run to {left:.1f} times it" in statement(near, judgement)


def test_a_judge_recording_in_which_the_machine_cannot_rest_is_said_to_be_one() -> None:
    """With 300 bar in the lowering chamber the pump does not hold the boom."""
    _, sheet, evidence = search({})
    found = diagnose(evidence.experiments, sheet, lambda _: None)
    (experiment,) = evidence.experiments
    full = experiment.outputs + np.array([0.0, 0.0, 3e7, 0.0])
    judgement = judged(found, [experiment.showing(experiment.angle, full)])
    assert not judgement.reconciled
    assert verdict(found, judgement) == "unexplained"
    assert "where it cannot even rest" in statement(found, judgement)


@pytest.mark.parametrize(
    ("payload", "bias", "said"), [(200.0, 3e-4, "found"), (0.0, 0.0, "unexplained")]
)
def test_what_explains_one_recording_alone_is_not_found(
    payload: float, bias: float, said: str
) -> None:
    """A payload takes away of what another recording shows, if there is one, whatever else."""
    _, sheet, evidence = search({"effects.payload.mass": 200.0})
    found = diagnose(evidence.experiments, sheet, lambda _: None)
    assert (found.verdict, found.chosen.effects) == ("found", ("payload",))
    there = {"effects.payload.mass": payload, "effects.sensor_bias.deflection": bias}
    judgement = judged(found, search(there)[2].experiments)
    assert judgement.off("with_effect") > HOPELESS
    assert verdict(found, judgement) == said
    unclear = replace(found, verdict="ambiguous", rivals=(found.chosen,))
    judgement = judged(unclear, judgement.evidence.experiments)
    assert judgement.rivals == pytest.approx((judgement.off("with_effect"),), rel=1e-6)
    assert verdict(unclear, judgement) == ("ambiguous" if said == "found" else said)
    either = f"in {evidence.name} alone explained by payload or payload"
    assert statement(unclear, judgement).startswith(either) == (said == "unexplained")
    alone = f"in {evidence.name} alone explained by payload; but"
    assert statement(found, judgement).startswith(alone) == (said == "unexplained")


def test_a_load_of_one_recording_may_not_be_another_s() -> None:
    _, sheet, evidence = search({})
    found = diagnose(evidence.experiments, sheet, lambda _: None)
    loaded = trial(sheet, ("external_load",), found.refitted)
    judgement = judged(replace(found, verdict="found", chosen=loaded), evidence.experiments)
    assert judgement.surprising
    assert not judgement.reconciled
    said = statement(replace(found, verdict="found", chosen=loaded), judgement)
    assert "a load from outside may have come at other times there" in said
    unloaded = judged(replace(found, verdict="found"), evidence.experiments)
    assert "a load from outside" not in statement(found, unloaded)


@pytest.mark.parametrize("place", [0.35, 0.8, 1.0])
def test_where_on_the_boom_a_payload_sits_is_told(place: float) -> None:
    """At the TCP unless the recording says otherwise: then it is not fitted."""
    there = {"effects.payload.mass": 200.0, "effects.payload.place": place}
    found = diagnosed(there)
    assert found.effects == ("payload",)
    payload = found.machine.effects.payload
    assert payload.mass == pytest.approx(200.0, rel=0.01)
    assert payload.place == pytest.approx(place, abs=0.005)
    assert ("effects.payload.place" in found.unknowns.values(found.x)) == (place != 1.0)


def test_a_poppet_that_does_not_open_all_the_way_is_found() -> None:
    found = diagnosed({"effects.logic_block_fault.blocked": 0.6})
    assert found.effects == ("logic_block_fault",)
    fitted = found.unknowns.values(found.x)
    assert fitted["effects.logic_block_fault.blocked"] == pytest.approx(0.6, abs=0.03)


def switching(fault: dict[str, float]) -> tuple[Search, Sheet, Evidence]:
    """Return the search for a logic block that shuts and opens again on the way down."""
    stated = joint1()
    jerks = [-1.0] * 12 + [-0.4] * 16
    command = [0.0] * 40 + ([0.4] * 60 + [0.0] * 30 + jerks * 3 + [0.0] * 30) * 6
    hidden = {f"{BLOCK}.{name}": size for name, size in fault.items()}
    run = operated(with_values(stated, hidden), np.array(command), angle=1.1)
    evidence, sheet = Evidence([run], stated), Sheet(stated, TOLERANCES, {}, ())
    return Search(evidence, sheet, lambda _: None), sheet, evidence


@pytest.mark.parametrize("other", [{"opening": 29.0}, {"hysteresis": 30e5}])
def test_a_logic_block_that_opens_late_or_shuts_late_is_found(other: dict[str, float]) -> None:
    """Its spring is too strong besides."""
    sizes = {"threshold": 60e5} | other
    searched, _, _ = switching(sizes)
    found = searched.named(searched.run()[0])
    assert found.effects == ("logic_block_fault",)
    assert found.machine.effects.logic_block_fault.closing == pytest.approx(0.0, abs=0.02)
    for name, size in sizes.items():
        fitted = getattr(found.machine.effects.logic_block_fault, name)
        assert fitted == pytest.approx(size, rel=0.05 if name in other else 0.01), name


def near(switches: tuple[Search, Sheet, Evidence], **sizes: float) -> Trial:
    """Return a logic block fitted from some sizes, the others as stated."""
    _, sheet, evidence = switches
    begun = trial(sheet, ("logic_block_fault",))
    at = {f"{BLOCK}.{name}": size for name, size in sizes.items()}
    x = [
        u.at(at.get(u.path, 0.0)) if u.path.startswith(BLOCK) else x
        for u, x in zip(begun.unknowns.members, begun.x, strict=True)
    ]
    return refine_free_run(begun.at(np.array(x)), evidence)


def test_a_threshold_is_fitted_beyond_the_minima_of_the_pressure_next_to_it() -> None:
    """Between two of them other sizes make up for it."""
    switches = switching({"threshold": 60e5, "closing": 1.0})
    between = near(switches, threshold=61e5)
    assert abs(between.machine.effects.logic_block_fault.threshold - 60e5) > 0.3e5
    found = switches[0].whole.plainer(between).machine.effects.logic_block_fault
    assert found.threshold == pytest.approx(60e5, abs=0.1e5)
    assert found.closing == pytest.approx(1.0, abs=0.02)


def test_beside_a_threshold_one_size_is_kept_where_it_says_all() -> None:
    switches = switching({"threshold": 60e5, "closing": 1.0})
    astray = near(switches, threshold=59.8e5, closing=0.9, opening=1.0, blocked=0.05)
    assert astray.machine.effects.logic_block_fault.opening > 0.5
    found = switches[0].whole.plainer(astray)
    assert found.sizes("logic_block_fault") == ["threshold", "closing"]
    assert found.machine.effects.logic_block_fault.closing == pytest.approx(1.0, abs=0.02)


def test_what_is_not_needed_beside_the_usual_form_goes() -> None:
    """One edge of a dead zone that is off by twice as much is both beside a null offset."""
    searched, sheet, evidence = search({"effects.valve_dead_zone_error.error": 0.035})
    both = trial(sheet, ("valve_null_offset", "valve_dead_zone_error"))
    unusual = both.formed({"effects.valve_dead_zone_error.edge": -1.0})
    begun = fit_free_run(fit_balances(unusual, evidence, searched.floor), evidence)
    assert begun.form != both.form
    assert needed(searched, begun).effects == ("valve_dead_zone_error",)


def test_friction_that_grows_faster_than_the_speed_is_found() -> None:
    path = "effects.viscous_friction"
    found = diagnosed({f"{path}.coefficient": 1e5, f"{path}.square": 3e6})
    assert found.effects == ("viscous_friction",)
    friction = found.machine.effects.viscous_friction
    assert friction.coefficient == pytest.approx(1e5, rel=0.04)
    assert friction.square == pytest.approx(3e6, rel=0.04)


def test_a_number_that_is_fitted_late_is_not_rounded_beyond_its_range() -> None:
    """A machine out of range raises; whether a rounded one is depends on its proportions."""
    for pressure in np.linspace(150e5, 300e5, 60):
        sheet = Sheet(with_values(joint1(), {"supply.p0": pressure}), {}, {}, ())
        known = with_square(uneven(trial(sheet, ("viscous_friction", "coulomb_friction"))))
        assert known is not None
        least, most = (known.at(end).machine.effects for end in known.unknowns.bounds)
        assert (least.viscous_friction.square, most.viscous_friction.square) == pytest.approx(
            (0.0, 1e9)
        )
        assert least.coulomb_friction.asymmetry == pytest.approx(-0.5)
        assert most.coulomb_friction.asymmetry == pytest.approx(0.5)


def test_friction_by_the_square_begins_in_proportion_to_the_machine() -> None:
    """With twice the force at half the speed it is eight times as much."""
    slow = {
        "supply.p0": 2.0 * joint1().supply.p0,
        "valve.flow_nominal": 0.5 * joint1().valve.flow_nominal,
    }
    tried = [
        first_tried("viscous_friction", "square", m)
        for m in (joint1(), with_values(joint1(), slow))
    ]
    assert tried[1] == pytest.approx(8.0 * tried[0])


@pytest.mark.parametrize(
    ("name", "asymmetry"), [("coulomb_friction", -0.3), ("stribeck_friction", 0.25)]
)
def test_friction_that_differs_with_the_direction_is_found(name: str, asymmetry: float) -> None:
    found = diagnosed({f"effects.{name}.force": 9.5e3, f"effects.{name}.asymmetry": asymmetry})
    assert found.effects == (name,)
    friction = getattr(found.machine.effects, name)
    assert friction.force == pytest.approx(9.5e3, rel=0.03)
    assert friction.asymmetry == pytest.approx(asymmetry, abs=0.02)


def test_a_gauge_that_is_off_beside_friction_is_no_friction_that_differs_with_the_direction() -> (
    None
):
    """While it moves one way or the other they are the same; at rest before the first they part."""
    bias = "effects.sensor_bias.pressure_lifting"
    found = diagnosed({"effects.coulomb_friction.force": 9.5e3, bias: 1e5})
    assert set(found.effects) == {"coulomb_friction", "sensor_bias"}
    assert found.unknowns.values(found.x)[bias] == pytest.approx(1e5, rel=0.05)


def test_an_uneven_friction_is_taken_for_an_even_one_and_a_gauge_that_is_off() -> None:
    hidden = {"coulomb_friction.force": 9.5e3, "coulomb_friction.asymmetry": 0.3}
    begun = search({f"effects.{path}": value for path, value in hidden.items()})
    known = fitted(begun, "coulomb_friction", "sensor_bias")
    assert excess(known, begun[2]) > beyond(LEFT)
    plain = begun[0].whole.plainer(known)
    assert plain.effects == ("coulomb_friction",)
    asymmetry = plain.machine.effects.coulomb_friction.asymmetry
    assert asymmetry == pytest.approx(0.3, abs=0.02)


@pytest.mark.parametrize("seals", [0.0, 1.0])
def test_friction_of_seals_is_told_from_that_of_bearings(seals: float) -> None:
    path = "effects.pressure_dependent_friction"
    found = diagnosed({f"{path}.coefficient": 0.03, f"{path}.seal_share": seals})
    assert found.effects == ("pressure_dependent_friction",)
    friction = found.machine.effects.pressure_dependent_friction
    assert friction.coefficient == pytest.approx(0.03, rel=0.02)
    assert friction.seal_share == pytest.approx(seals, abs=0.05)


def test_a_pilot_line_that_leaks_much_is_found_beside_a_gauge_that_is_off() -> None:
    """Nothing of it shows until the pilot pressure meets the threshold: slopes say nothing."""
    hidden = {"logic_block_fault.pilot": 0.9, "sensor_gain.pressure_lowering": -0.036}
    values = {f"effects.{path}": value for path, value in hidden.items()}
    evidence = Evidence([moved(with_values(joint1(), values), 30.0)], joint1())
    searched = Search(evidence, Sheet(joint1(), TOLERANCES, {}, ()), lambda _: None)
    found = searched.named(searched.run()[0])
    assert set(found.effects) == {"logic_block_fault", "sensor_gain"}
    for path, value in values.items():
        assert found.unknowns.values(found.x)[path] == pytest.approx(value, rel=0.05)


def test_a_fault_of_the_logic_block_that_shuts_in_the_part_held_back_alone_is_found() -> None:
    """It lifts for two thirds of the time: what the fits see is explained without."""
    stated = joint1()
    lifted = np.concatenate([[0.0] * 40, ([0.3] * 20 + [0.0] * 70) * 4])
    lowered = np.array(([-0.45] * 40 + [0.0] * 50) * 2)
    fault = with_values(stated, {"effects.logic_block_fault.threshold": 30e5})
    run = operated(fault, np.concatenate([lifted, lowered]), angle=1.2)
    searched = Search(Evidence([run], stated), Sheet(stated, TOLERANCES, {}, ()), lambda _: None)
    (found,) = searched.run()
    assert found.effects == ("logic_block_fault",)
    threshold = found.machine.effects.logic_block_fault.threshold
    assert threshold == pytest.approx(30e5, rel=0.02)


def test_what_acts_late_is_found_beside_an_effect_that_explains_the_part_before() -> None:
    """A gauge is off; a logic block shuts in the part held back alone, and drives it away there."""
    lifted = np.concatenate([[0.0] * 40, ([0.3] * 20 + [0.0] * 70) * 4])
    lowered = np.array(([-0.45] * 40 + [0.0] * 50) * 2)
    hidden = {"logic_block_fault.threshold": 30e5, "sensor_bias.pressure_lifting": 1e5}
    values = {f"effects.{path}": value for path, value in hidden.items()}
    run = operated(with_values(joint1(), values), np.concatenate([lifted, lowered]), angle=1.2)
    evidence = Evidence([run], joint1())
    searched = Search(evidence, Sheet(joint1(), TOLERANCES, {}, ()), lambda _: None)
    found = searched.whole.fitted(searched.run()[0])
    assert set(found.effects) == {"logic_block_fault", "sensor_bias"}
    assert at_noise(found, evidence)
    for path, value in values.items():
        assert found.unknowns.values(found.x)[path] == pytest.approx(value, rel=0.02)


def test_without_a_gauge_the_free_run_is_asked_until_it_is_explained() -> None:
    """Beside a payload the one chamber's balance leads to the valve, 2.5 times the noise off."""
    hidden = {"effects.payload.mass": 60.0, "effects.external_leakage.lowering": 2e-12}
    run = without_p_s(moved(with_values(joint1(), hidden), duration=40.0))
    evidence = Evidence([run], joint1())
    sheet = Sheet(joint1(), TOLERANCES, {}, ())
    rounds, head = Search(evidence, sheet, lambda _: None)._rounds, evidence.head(SEEN)
    floor = evidence.floor(joint1())
    payload = fit_free_run(fit_balances(trial(sheet, ("payload",)), head, floor), head)
    better = rounds.beside(rounds.scored(payload, free_run_score(payload, evidence)))
    at_the_noise = [each.trial for each in better if at_noise(each.trial, evidence)]
    assert [each.effects for each in at_the_noise] == [("payload", "external_leakage")]


def test_an_effect_that_stood_for_another_is_exchanged() -> None:
    """A gain that differs with the direction was first, for a spool off its middle."""
    hidden = {
        "effects.viscous_friction.coefficient": 6e5,
        "effects.valve_dead_zone_error.error": 0.0314,
        "effects.valve_null_offset.offset": -0.0105,
    }
    evidence = Evidence([moved(with_values(joint1(), hidden), duration=24.0)], joint1())
    sheet = Sheet(joint1(), TOLERANCES, {}, ())
    searched = Search(evidence, sheet, lambda _: None)
    effects = ("viscous_friction", "valve_gain_asymmetry", "valve_dead_zone_error")
    wrong = fit_balances(trial(sheet, effects), evidence, searched.floor)
    (found,) = searched._with_others_in_place([wrong])
    found = searched.whole.fitted(found)
    assert at_noise(found, evidence)
    for path, value in hidden.items():
        assert found.unknowns.values(found.x)[path] == pytest.approx(value, rel=0.02)


@pytest.mark.parametrize(
    ("size", "value", "off", "places"),
    [
        ("linkage_error.scale", 0.01, 0.0108, ["viscous_friction"]),
        ("payload.mass", 40.0, 41.6, []),
    ],
)
def test_a_series_that_leaves_a_little_may_stand_for_another(
    size: str, value: float, off: float, places: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another effect is asked for in its place, beside the one that stays."""
    viscous, path = {"effects.viscous_friction.coefficient": 1e5}, f"effects.{size}"
    searched, sheet, evidence = search(viscous | {path: value})
    start = trial(sheet, ("viscous_friction", size.split(".", maxsplit=1)[0]))
    values, members = viscous | {path: off}, start.unknowns.members
    near = start.at(np.array([u.at(values[u.path]) if u.path in values else 0 for u in members]))
    assert beyond(LEFT) < excess(near, evidence) <= beyond(AT_NOISE)
    asked: list[str] = []
    monkeypatch.setattr(searched.whole, "fitted", lambda known: known)
    monkeypatch.setattr(
        searched._rounds, "_in_its_place", lambda fewer, _: asked.append(fewer.name) or []
    )
    searched._with_others_in_place([near])
    assert asked == places


def test_what_comes_next_is_asked_before_a_series_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without pressures an error of the linkage may be nearer to a soft hose than that itself."""

    def hose_fourth(*known: Any) -> list[Screened]:
        found = {each.trial.effects[0]: each for each in screen_free_run(*known)}
        ahead = ("linkage_error", "valve_gain_asymmetry", "external_leakage", "vessel_compliance")
        return [found[effect] for effect in ahead]

    monkeypatch.setattr("emir_analysis.diagnosis.rounds.screen_free_run", hose_fourth)
    soft = with_values(joint1(), {"effects.vessel_compliance.lowering": 6e-12})
    evidence = Evidence([without(without_p_s(moved(soft)), "pressure_lifting")], joint1())
    searched = Search(evidence, Sheet(joint1(), TOLERANCES, {}, ()), lambda _: None)
    asked = searched._rounds
    linkage, *_ = asked._on_free_run(asked.scored(searched._plain()))
    asked.tried = [asked._fits.fitted(linkage)]
    (found,) = searched.nearest_the_whole([asked.tried[0].trial])
    assert found.effects == ("vessel_compliance",)


def test_without_a_gauge_effects_are_begun_from_parameters_as_they_are_as_well(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Those that were fitted to a beginning have taken the place of the hose."""
    soft = with_values(joint1(), {"effects.vessel_compliance.lowering": 6e-12})
    evidence = Evidence([without_p_s(moved(soft))], joint1())
    searched = Search(evidence, Sheet(joint1(), TOLERANCES, {}, ()), lambda _: None)
    rounds, plain = searched._rounds, searched._plain()
    asked_from = []

    def hidden_from_fitted(known: Trial, sheet: Sheet, near: Evidence) -> list[Screened]:
        asked_from.append(known)
        found = screen_free_run(known, sheet, near)
        return [s for s in found if known is plain or "vessel_compliance" not in s.trial.effects]

    monkeypatch.setattr("emir_analysis.diagnosis.rounds.screen_free_run", hidden_from_fitted)
    found = rounds._on_free_run(rounds.scored(plain))
    assert len(asked_from) == 2
    assert ("vessel_compliance",) in [tried.trial.effects for tried in found]


def test_the_noise_of_a_machine_that_cannot_run_is_the_stated_one_s() -> None:
    """Of a trial, such as one that falls over the dead centre; of the sheet's it is an error."""
    evidence = Evidence([moved(joint1())], joint1())
    fallen = with_values(joint1(), {"effects.external_load.mean": -1e5})
    assert np.isnan(free_runs([fallen], evidence.experiments[0], [(0.8, 20e5)])).all()
    np.testing.assert_array_equal(evidence.floor(fallen), evidence.floor(joint1()))
    with pytest.raises(InputError, match=r"cannot rest at .* check the data sheet"):
        Evidence(evidence.experiments, fallen).floor(fallen)


def test_without_a_gauge_what_one_balance_speaks_against_is_asked_as_well() -> None:
    """Beside a loop of the valve: of four that the balance of a chamber likes three go on."""
    hidden = {"effects.valve_hysteresis.width": 0.05, "effects.linkage_error.scale": -0.02}
    run = without(moved(with_values(joint1(), hidden), duration=40.0), "pressure_lifting")
    evidence = Evidence([run], joint1())
    searched = Search(evidence, Sheet(joint1(), TOLERANCES, {}, ()), lambda _: None)
    rounds, head = searched._rounds, evidence.head(SEEN)
    loop = fit_balances(trial(searched._sheet, ("valve_hysteresis",)), head, searched.floor)
    beside = ("linkage_error", "flow_gain_drift")
    both = [trial(searched._sheet, ("valve_hysteresis", each), loop) for each in beside]
    told, drift = (rounds.scored(fit_balances(each, head, searched.floor)) for each in both)
    simulated = rounds._fits.fitted(drift)
    first = rounds.scored(loop, free_run_score(loop, evidence))
    rounds.tried = [first, told, simulated]
    assert excess(simulated.trial, evidence) < beyond(EXPLAINED)
    assert searched.nearest_the_whole([simulated.trial])[0].effects == told.trial.effects
    assert all(t.free_run is not None for t in rounds.tried)


def test_what_is_close_on_the_balances_is_simulated_before_another_set_is_named() -> None:
    """Where all balances are told, what is far from the best there is not."""
    hidden = {"effects.valve_hysteresis.width": 0.05, "effects.linkage_error.scale": -0.02}
    searched, sheet, evidence = search(hidden)
    rounds, head = searched._rounds, evidence.head(SEEN)
    loop = fit_balances(trial(sheet, ("valve_hysteresis",)), head, searched.floor)
    beside = ("linkage_error", "flow_gain_drift", "valve_null_offset")
    sets = [trial(sheet, ("valve_hysteresis", each), loop) for each in beside]
    told, drift, far = (rounds.scored(fit_balances(each, head, searched.floor)) for each in sets)
    best = rounds._fits.fitted(drift)
    limit = rounds.scored(best.trial).balances + CLOSE
    rounds.tried = [told, replace(far, balances=limit + 1.0)]
    rounds.ask_further(best.trial)
    simulated = [t.trial.effects for t in rounds.tried if t.free_run is not None]
    assert simulated == [told.trial.effects]


def test_what_was_simulated_from_elsewhere_is_not_asked_again() -> None:
    """Fitted to the balances first, it may have gone on from where the free run begins it."""
    searched, sheet, _ = search(FRICTION)
    viscous, payload = trial(sheet, ("viscous_friction",)), trial(sheet, ("payload",))
    again = viscous.at(2.0 * viscous.x)
    tried = [Tried(viscous, 0.0), Tried(payload, 1.0), Tried(again, 0.0, 5.0)]
    searched._rounds.tried = tried
    assert searched._rounds._no_further(frozenset()) == [tried[1]]
    assert searched._rounds.tried == [tried[0], tried[2]]


def test_what_acts_little_and_late_is_found() -> None:
    """It lowers from the last third on: parameters alone are at the noise before, and near it."""
    lifted = np.concatenate([[0.0] * 40, ([0.3] * 20 + [0.0] * 70) * 4])
    lowered = np.array(([-0.45] * 40 + [0.0] * 50) * 2)
    slow = with_values(joint1(), {"effects.valve_gain_asymmetry.lowering": -0.012})
    evidence = Evidence([operated(slow, np.concatenate([lifted, lowered]), angle=1.2)], joint1())
    searched = Search(evidence, Sheet(joint1(), TOLERANCES, {}, ()), lambda _: None)
    assert AT_NOISE**2 < mean_square(searched.refitted, evidence) < EXPLAINED**2
    (found,) = searched.run()
    assert found.effects == ("valve_gain_asymmetry",)
    lowering = found.machine.effects.valve_gain_asymmetry.lowering
    assert lowering == pytest.approx(-0.012, abs=0.002)
    assert at_noise(found, evidence)


def test_what_acts_late_is_asked_for_first_where_parameters_explain_all_before() -> None:
    """The balances are quiet and tell parameters less well than a free run: 1.3 times the noise."""
    lifted = np.concatenate([[0.0] * 40, ([0.3] * 20 + [0.0] * 70) * 4])
    lowered = np.array([-0.45] * 40 + [0.0] * 50 + [-0.25] * 40 + [0.0] * 50)
    slow = with_values(joint1(), {"effects.valve_gain_asymmetry.lowering": -0.05})
    evidence = Evidence([operated(slow, np.concatenate([lifted, lowered]), angle=1.2)], joint1())
    searched = Search(evidence, Sheet(joint1(), TOLERANCES, {}, ()), lambda _: None)
    seen = evidence.head(SEEN)
    assert mean_square(searched.balanced, seen) > AT_NOISE**2 > mean_square(searched._plain(), seen)
    (found,) = searched.run()
    lowering = found.machine.effects.valve_gain_asymmetry.lowering
    assert lowering == pytest.approx(-0.05, abs=0.002)
    assert [tried.trial.effects for tried in searched.tried] == [(), ("valve_gain_asymmetry",)]


def test_without_a_gauge_parameters_are_as_a_beginning_has_them() -> None:
    """Lifting only: as the one balance has them they leave far more there than the fault later."""
    lifted = np.concatenate([[0.0] * 40, ([0.3] * 20 + [0.0] * 70) * 3])
    lowered = np.array(([-0.45] * 40 + [0.0] * 50) * 3)
    fault = with_values(joint1(), {"effects.logic_block_fault.threshold": 30e5})
    run = operated(fault, np.concatenate([lifted, lowered]), angle=1.2)
    evidence = Evidence([without(run, "pressure_lifting")], joint1())
    unknown = (
        "cylinder.volume_lifting_0",
        "cylinder.volume_lowering_0",
        "resistances.k_block_in",
        "resistances.k_pump_line",
        "valve.natural_frequency",
    )
    sheet = Sheet(joint1(), TOLERANCES | dict.fromkeys(unknown, 0.1), {}, ())
    searched = Search(evidence, sheet, lambda _: None)
    lifts = evidence.until(9.0)
    assert mean_square(searched.balanced, lifts) > EXPLAINED**2
    assert mean_square(searched._plain(), lifts) < AT_NOISE**2


def test_without_gauges_an_effect_is_begun_from_parameters_as_a_beginning_has_them() -> None:
    """From far off, where the one balance that is told leaves them, a payload promises nothing."""
    stated, random = joint1(), np.random.default_rng(2)
    tolerances = {
        "cylinder.volume_lifting_0": 0.1,
        "cylinder.volume_lowering_0": 0.1,
        "cylinder.beta": 0.15,
        "valve.flow_nominal": 0.03,
        "resistances.k_pump_line": 0.1,
        "resistances.k_block_in": 0.1,
        "resistances.k_return_line": 0.1,
        "resistances.k_block_out": 0.1,
        "resistances.k_meter_out_lowering": 0.1,
    }
    values = {path: value for path, (_, value) in declared(stated).items()}
    built = {
        path: values[path] * (1.0 + tolerance * random.uniform(-0.9, 0.9))
        for path, tolerance in tolerances.items()
    }
    loaded = moved(with_values(stated, built | {"effects.payload.mass": 60.0}))
    for missing in ("pressure_lifting", "tip_deflection_angle"):
        loaded = without(loaded, missing)
    evidence = Evidence([loaded], stated)
    searched = Search(evidence, Sheet(stated, tolerances, {}, ()), lambda _: None)
    rounds = searched._rounds
    begun = rounds._on_free_run(rounds.scored(searched._plain()))
    assert "payload" in {each.trial.effects[0] for each in begun}


def test_a_share_that_no_balance_tells_is_told_by_the_free_run() -> None:
    """Play ahead of a slow spool; a fit has taken it for play behind it."""
    slow = with_values(joint1(), {"valve.natural_frequency": 40.0, "valve.damping": 0.5})
    share = "effects.valve_hysteresis.command_share"
    hidden = {"effects.payload.mass": 60.0, "effects.valve_hysteresis.width": 0.03, share: 1.0}
    evidence = Evidence([moved(with_values(slow, hidden), duration=24.0)], slow)
    sheet = Sheet(slow, TOLERANCES, {}, ())
    rounds, head = Search(evidence, sheet, lambda _: None)._rounds, evidence.head(SEEN)
    start = trial(sheet, ("payload", "valve_hysteresis"))
    balanced = fit_balances(start, head, evidence.floor(slow))
    k = [unknown.path for unknown in balanced.unknowns.members].index(share)
    astray = balanced.at(changed(balanced.x, [k], [0.0]))
    assert mean_square(astray, head) > EXPLAINED**2
    told = rounds._fits._with_shares_told(balanced, astray)
    assert mean_square(told, head) < AT_NOISE**2
    found = told.machine.effects.valve_hysteresis
    assert (found.width, found.command_share) == (pytest.approx(0.03, rel=0.01), 1.0)


@pytest.mark.parametrize(("force", "beside"), [(-100.0, {}), (-60.0, SHIFT)])
def test_a_small_load_late_is_found(force: float, beside: dict[str, float]) -> None:
    """Of 10 kg, from 12 of 16 s on; the part that the fits see ends after 10.7 s."""
    load = {"effects.external_load.force": force, "effects.external_load.start": 12.0}
    searched, _, evidence = search(load | beside | {"effects.external_load.duration": 1e4})
    found = searched.run()[0]
    names = {path.split(".")[1] for path in load | beside}
    assert set(found.effects) == names
    assert at_noise(searched.whole.fitted(found), evidence)
    told = searched.whole.fitted(found).machine.effects.external_load
    assert told.start == pytest.approx(12.0, abs=0.1)


@pytest.mark.parametrize(("bending", "first"), [(6.0, "force"), (12.0, "bending")])
def test_bending_that_no_force_makes_comes_first(bending: float, first: str) -> None:
    """A missing force makes it no louder than the force balance, a loose flange does."""
    loudness = np.array([3.0, 0.9, 0.9, 0.0, bending])
    floor = np.array([250.0, 3e-6, 2e-6, 7e-5, 6e-6])
    residual = np.tile(loudness * floor, (40, 1))
    assert list(BALANCES)[0::4] == ["force", "bending"]
    assert loudest(residual, floor, 1.4 * floor) == first


def test_three_effects_are_found_together() -> None:
    hidden = {"effects.payload.mass": 200.0, "effects.command_delay.delay": 0.03}
    searched, _, evidence = search(hidden | SHIFT)
    found = searched.whole.fitted(searched.run()[0])
    assert set(found.effects) == {"payload", "command_delay", "valve_null_offset"}
    assert at_noise(found, evidence)
    for path, value in (hidden | SHIFT).items():
        assert found.unknowns.values(found.x)[path] == pytest.approx(value, rel=0.05)


def test_two_effects_for_which_a_third_stands_are_asked_about_first() -> None:
    """A gauge that shows too much is nearest to a payload beside a bias, and leaves some of it."""
    hidden = {"effects.payload.mass": 30.0, "effects.sensor_bias.pressure_lifting": 1e5}
    stated, told = joint1(), []
    evidence = Evidence([moved(with_values(stated, hidden))], stated)
    searched = Search(evidence, Sheet(stated, TOLERANCES, {}, ()), told.append)
    found = searched.whole.fitted(searched.run()[0])
    assert set(found.effects) == {"payload", "sensor_bias"}
    for path, value in hidden.items():
        assert found.unknowns.values(found.x)[path] == pytest.approx(value, rel=0.05)
    rounds = [line for line in told if line.startswith("all effects beside")]
    assert rounds == ["all effects beside: parameters only"]


def test_a_leak_that_the_balances_hardly_know_of_is_found_beside_soft_oil() -> None:
    """The leak drives the free run away, in which play comes nearer than softer oil alone."""
    hidden = {
        "effects.vessel_compliance.lifting": 6e-12,
        "effects.external_leakage.lifting": 3e-13,
    }
    searched, sheet, evidence = search(hidden)
    rounds = searched._rounds
    rounds.tried = [rounds.scored(searched.refitted, free_run_score(searched.refitted, evidence))]
    for effect in ("backlash", "vessel_compliance"):
        balanced = fit_balances(trial(sheet, (effect,)), evidence, searched.floor)
        single = fit_free_run(balanced, evidence.head(SEEN))
        rounds.tried.append(rounds.scored(single, free_run_score(single, evidence)))
    _, play, soft = rounds.tried
    assert play.balances > soft.balances + STRONG
    better = searched._forward._with_one_more(play, enough=False)
    found = searched.whole.fitted(min(better, key=free).trial)
    assert set(found.effects) == {"vessel_compliance", "external_leakage"}
    assert at_noise(found, evidence)


def test_a_third_effect_is_looked_for_where_no_two_bring_the_free_run_nearer() -> None:
    """Beside the pair that says most to the balances, if that says more than one effect."""
    hidden = {"effects.payload.mass": 200.0, "effects.internal_leakage.coefficient": 3e-12}
    searched, sheet, evidence = search(hidden | SHIFT)
    rounds, known = searched._rounds, {}
    for effects in ((), ("payload",), ("payload", "valve_null_offset")):
        fitted_to_balances = fit_balances(trial(sheet, effects), evidence, searched.floor)
        known[len(effects)] = rounds.scored(fitted_to_balances)
    rounds.tried = [known[0], known[1]]
    assert rounds.triples(known[0]) == []
    rounds.tried.append(known[2])
    plain = rounds.scored(searched.refitted, free_run_score(searched.refitted, evidence))
    found = [set(each.trial.effects) for each in rounds.triples(plain)]
    assert {"payload", "internal_leakage", "valve_null_offset"} in found


def test_a_second_effect_is_looked_for_beside_the_two_that_say_most_to_the_balances(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Soft oil is told to say more than play of the spool does, beside which a leak shows."""
    searched, sheet, evidence = search(
        {"effects.external_leakage.lifting": 3e-12, "effects.valve_hysteresis.width": 0.05}
    )
    rounds, plain = searched._rounds, searched._rounds.scored(searched.balanced)
    told = [("vessel_compliance", 1.0), ("valve_hysteresis", 2.0), ("payload", 3.0)]
    for name, score in told:
        single = fit_balances(trial(sheet, (name,)), evidence, searched.floor)
        rounds.tried.append(Tried(single, score))
    asked: list[tuple[str, ...]] = []

    def noted(found: list[Screened], _: Tried) -> list[Tried]:
        asked.extend(each.trial.effects for each in found)
        return []

    monkeypatch.setattr(rounds, "_by_balances", noted)
    rounds.pairs(plain, plain)
    assert ("valve_hysteresis", "external_leakage") in asked
    assert ("payload", "external_leakage") not in asked


def test_a_third_effect_is_found_beside_a_pair_that_alone_helps() -> None:
    """The first effect leads nowhere near, and the pair does not suffice."""
    hidden = {
        "effects.payload.mass": 60.0,
        "effects.valve_gain_asymmetry.lowering": -0.1,
        "effects.internal_leakage.coefficient": 1.5e-12,
    }
    searched, _, evidence = search(hidden)
    found = searched.whole.fitted(searched.run()[0])
    assert set(found.effects) == {"payload", "valve_gain_asymmetry", "internal_leakage"}
    assert at_noise(found, evidence)


@pytest.mark.parametrize(("mass", "found"), [(6.0, [("viscous_friction", "payload")]), (0.0, [])])
def test_what_brings_all_to_the_noise_is_taken_though_the_part_held_back_tells_little(
    mass: float, found: list[tuple[str, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Beside an effect that explains alone; there a second one is better, if not clearly."""
    begun = search({"effects.viscous_friction.coefficient": 1e5, "effects.payload.mass": mass})
    searched, _, evidence = begun
    alone = fitted(begun, "viscous_friction")
    assert is_enough(alone, searched._evidence)
    barely = {1: 100.0, 2: 100.0 - 0.5 * STRONG}
    monkeypatch.setattr(free_run_fits, "free_run_score", lambda t, _: barely[len(t.effects)])
    better = searched._rounds.beside_enough(Tried(alone, 0.0, barely[1]))
    assert [each.trial.effects for each in better] == found
    for each in better:
        assert excess(searched.whole.fitted(each.trial), evidence) < beyond(LEFT)


def test_of_a_short_recording_a_balance_may_hold_more() -> None:
    """Of 12 independent windows the mean square of noise is above 2.74 once in a thousand."""

    def limit(duration: float) -> float:
        return speaks(Evidence([moved(joint1(), duration)], joint1()))

    assert limit(12.0) ** 2 == pytest.approx(2.74, abs=0.02)  # chi-square tables: 32.91 / 12
    assert limit(60.0) == pytest.approx(np.sqrt(2.0))


def test_what_noise_makes_of_a_short_recording_does_not_speak() -> None:
    """In closed loop, where a piston sticks under a coarse resolver, windows are not all alike.

    Of 40 runs of the machine that is asked, from elsewhere in a step and with other noise, one in
    1000 may speak.
    """
    machine = with_values(joint1(), {"effects.stribeck_friction.force": 1e4})
    loop = ClosedLoop(
        Plant(machine),
        named("lift-lower", TrajectoryParameters()),
        CascadeControl(Cascade(CascadeParameters())),
    )
    start = math.pi / 4.0
    first = operated(machine, loop.run(start, 20e5, 17.6)["valve_command"], angle=start)
    evidence = Evidence([first], machine)
    floor, limit = evidence.floor(machine), limits(machine, evidence)
    step = machine.sensors.resolver_span / 2**machine.sensors.resolver_bits
    starts = [(start + k / 40.0 * step, 20e5) for k in range(40)]
    runs = free_runs([machine] * 40, first, starts)
    others = [sensed(first, machine, ideal, seed=k) for k, ideal in enumerate(runs, start=1000)]
    levels = [level(Evidence([e], machine).residuals([machine])[0]) for e in others]
    if_alike = speaks(evidence) * floor
    assert [quiet(left, if_alike) for left in levels].count(False) > 2
    assert [quiet(left, limit) for left in levels].count(False) == 0
    without_friction = level(evidence.residuals([joint1()])[0])
    assert not quiet(without_friction, limit)


def test_an_effect_that_is_not_needed_is_dropped() -> None:
    begun = search(FRICTION)
    pair = fitted(begun, "viscous_friction", "valve_null_offset")
    kept = needed(begun[0], pair)
    assert kept.effects == ("viscous_friction",)
    assert kept.machine.effects.viscous_friction.coefficient == pytest.approx(1e5, rel=0.02)
    assert not any("valve_null_offset" in u.path for u in kept.unknowns.members)


def test_what_an_effect_that_is_not_needed_led_astray_is_fitted_anew() -> None:
    """A late command beside a dead zone, led to a lag and a slow spool where play helps them."""
    late = {"effects.command_delay.delay": 0.015, "effects.valve_dead_zone_error.error": 0.012}
    rng, pulses = np.random.default_rng(3), [np.zeros(40)]
    for opening, sign in zip(rng.uniform(0.2, 0.55, 40), rng.choice([-1.0, 1.0], 40), strict=True):
        pulses += [np.repeat([sign * opening, 0.0], rng.integers((10, 10), (44, 28)))]
    inches = np.convolve(np.concatenate(pulses), np.ones(4) / 4.0, "same")
    stated, spool = joint1(), "valve.natural_frequency"
    evidence = Evidence([operated(with_values(stated, late), inches)], stated)
    sheet = Sheet(stated, TOLERANCES | {spool: 0.1}, {}, ())
    astray = trial(sheet, ("valve_hysteresis", "command_delay", "valve_dead_zone_error"))
    astray = astray.fixed("effects.command_delay.lag_share", 1.0)
    searched = Search(evidence, sheet, lambda _: None)
    kept = needed(searched, refine_free_run(astray, evidence))
    assert set(kept.effects) == {"command_delay", "valve_dead_zone_error"}
    assert kept.machine.effects.command_delay.delay == pytest.approx(0.015, rel=0.03)
    assert kept.machine.effects.command_delay.lag_share == pytest.approx(0.0, abs=0.15)


def test_friction_that_a_beginning_told_goes_where_a_fuller_law_has_it() -> None:
    """Coulomb's beside Stribeck's, which is Coulomb's with a break-away."""
    law = {"force": 4e3, "breakaway": 2.5, "stribeck_speed": 0.02, "smoothing_speed": 1e-3}
    hidden = {f"effects.stribeck_friction.{name}": value for name, value in law.items()}
    searched, sheet, _ = search(hidden)
    both = trial(sheet, ("coulomb_friction", "stribeck_friction"))
    values = both.unknowns.values(both.x) | hidden | {"effects.coulomb_friction.force": 50.0}
    both = both.at(np.array([u.at(values[u.path]) for u in both.unknowns.members]))
    searched.elimination.settled = ("coulomb_friction",)
    assert needed(searched, both).effects == ("stribeck_friction",)


def test_a_rival_is_as_good_on_the_whole() -> None:
    """Another effect is far worse there; one with a size that is none is as good."""
    begun = search(FRICTION)
    right, wrong = fitted(begun, "viscous_friction"), fitted(begun, "payload")
    more = fitted(begun, "viscous_friction", "valve_null_offset")
    assert begun[0]._rivals_on_the_whole([right, wrong, more]) == [right, more]


def test_what_leaves_less_of_the_whole_is_taken_where_something_is_left() -> None:
    """The part held back has preferred a payload to friction, by chance."""
    begun = search({"effects.viscous_friction.coefficient": 5e4})
    searched, sheet, evidence = begun
    wrong, right = fitted(begun, "payload"), fitted(begun, "viscous_friction")
    assert AT_NOISE < math.sqrt(mean_square(wrong, evidence)) < HOPELESS
    tried = fit_free_run(trial(sheet, ("viscous_friction",)), evidence.head(SEEN))
    searched.tried.append(Tried(tried, 0.0, free_run_score(tried, evidence)))
    assert searched.nearest_the_whole([wrong]) == [tried]
    assert searched.nearest_the_whole([right]) == [right]


def test_a_series_gives_way_to_an_effect_that_explains_as_much_by_fewer_numbers() -> None:
    """Five terms of the linkage's error stand for a soft hose whose pressure no sensor shows."""
    begun = search({"effects.vessel_compliance.lowering": 3e-12}, without_p_s)
    searched, sheet, evidence = begun
    series = fitted(begun, "linkage_error")
    assert at_noise(series, evidence)
    tried = fit_free_run(trial(sheet, ("vessel_compliance",)), evidence.head(SEEN))
    searched.tried.append(Tried(tried, 0.0, free_run_score(tried, evidence)))
    assert searched.nearest_the_whole([series]) == [tried]


def test_a_series_that_is_there_stays() -> None:
    begun = search({"effects.linkage_error.slope": 0.02}, without_p_s)
    searched, sheet, evidence = begun
    series = fitted(begun, "linkage_error")
    others = [trial(sheet, (name,)) for name in ("vessel_compliance", "payload")]
    for other in (fit_free_run(each, evidence.head(SEEN)) for each in others):
        searched.tried.append(Tried(other, 0.0, free_run_score(other, evidence)))
    assert searched.nearest_the_whole([series]) == [series]


def test_what_is_needed_stays() -> None:
    begun = search(FRICTION | SHIFT)
    pair = fitted(begun, "viscous_friction", "valve_null_offset")
    assert needed(begun[0], pair).effects == pair.effects


@pytest.mark.parametrize(
    ("missing", "named"),
    [
        ({"effects.command_delay.delay": 0.013}, "command_delay"),
        ({"effects.sensor_delay.pressure_lifting": 0.03}, "sensor_delay"),
    ],
)
def test_a_late_command_is_simpler_than_four_late_sensors(
    missing: dict[str, float], named: str
) -> None:
    """Whichever extrapolates better; one late sensor it does not explain."""
    begun = search(missing)
    searched, sheet, evidence = begun
    head = evidence.head(SEEN)
    trials = [
        fit_free_run(fit_balances(trial(sheet, (name,)), head, searched.floor), head)
        for name in ("sensor_delay", "command_delay")
    ]
    chosen = searched._forward.simplest(trials[:1], [Tried(each, 0.0) for each in trials])
    assert [each.effects for each in chosen] == [(named,)]


@pytest.mark.parametrize(
    ("missing", "share", "told"),
    [
        ({"pressure_lifting": 0.005, "dead_share": 0.6}, 0.0, False),
        ({"pressure_lifting": 0.06}, 0.0, False),
        ({"pressure_lifting": 0.06, "dead_share": 1.0}, 1.0, False),
        ({"pressure_lifting": 0.3, "dead_share": 0.5}, 0.5, True),
    ],
)
def test_a_share_is_none_or_all_where_the_recording_does_not_tell(
    missing: dict[str, float], share: float, *, told: bool
) -> None:
    """As for a short delay, which shows one way or the other."""
    values = {f"effects.sensor_delay.{name}": value for name, value in missing.items()}
    found = fitted(search(values), "sensor_delay")
    assert found.machine.effects.sensor_delay.dead_share == pytest.approx(share, abs=0.1)
    members = [unknown.path for unknown in found.unknowns.members]
    assert ("effects.sensor_delay.dead_share" in members) == told


def test_a_share_in_between_is_as_usual_where_that_leaves_as_little() -> None:
    """As of a leak of a chamber without its gauge: along with its size little changes."""
    leak = {"effects.external_leakage.lowering": 2e-12}
    run = without_p_s(moved(with_values(joint1(), leak)))
    searched, sheet, evidence = search({}, lambda _: run)
    share, effects = "effects.external_leakage.turbulent_share", ("external_leakage",)
    known = trial(sheet, effects).with_one_size("external_leakage", "lowering")
    between = fit_free_run(known.fixed(share, 0.4), evidence)
    values = between.unknowns.values(between.x) | {share: 0.4}
    x = [unknown.at(values[unknown.path]) for unknown in known.unknowns.members]
    found = searched.whole.plainer(known.at(np.array(x)))
    assert found.machine.effects.external_leakage.turbulent_share == 0.0
    assert found.machine.effects.external_leakage.lowering == pytest.approx(2e-12, rel=0.03)


def test_a_share_finds_back_from_the_wrong_end() -> None:
    """Play of the magnet beside air, fitted as if it were behind the spool before the air."""
    play = {"width": 0.03, "command_share": 1.0}
    values = {f"effects.valve_hysteresis.{name}": value for name, value in play.items()}
    values |= {"effects.entrained_air.share": 0.01, "effects.entrained_air.exponent": 1.2}
    levels = np.random.default_rng(1).choice([-0.35, -0.2, 0.0, 0.0, 0.2, 0.35], 60)
    jumps = operated(with_values(joint1(), values), np.append(np.zeros(40), np.repeat(levels, 8)))
    searched, sheet, evidence = search({}, lambda _: jumps)
    share = "effects.valve_hysteresis.command_share"
    known = refine_free_run(trial(sheet, ("valve_hysteresis",)).fixed(share, 0.0), evidence)
    both = trial(sheet, ("valve_hysteresis", "entrained_air"))
    values = known.unknowns.values(known.x) | {share: 0.0}
    begun = [values.get(u.path, u.value(u.start)) for u in both.unknowns.members]
    begun = [u.at(v) for u, v in zip(both.unknowns.members, begun, strict=True)]
    found = searched.whole.fitted(both.at(np.array(begun)))
    assert found.machine.effects.valve_hysteresis.command_share == pytest.approx(1.0, abs=0.01)
    assert found.machine.effects.entrained_air.share == pytest.approx(0.01, rel=0.02)


def test_a_size_that_was_set_to_all_of_it_is_still_told() -> None:
    """A block piloted by the other chamber alone: that share is fitted no more, but the finding."""
    sheet = Sheet(joint1(), TOLERANCES, {}, ())
    alone = trial(sheet, ("logic_block_fault",)).with_one_size("logic_block_fault", "pilot")
    piloted = alone.fixed("effects.logic_block_fault.pilot", 1.0)
    (effect,) = effect_results(piloted, {})
    assert [(n, p.value) for n, p in effect.parameters.items()] == [("pilot", 1.0)]


def test_what_an_effect_has_besides_and_was_not_asked_for_is_not_told() -> None:
    """But which form it has is."""
    sheet = Sheet(joint1(), TOLERANCES, {}, ())
    names = ("coulomb_friction", "viscous_friction", "valve_dead_zone_error")
    dry, viscous, edges = effect_results(trial(sheet, names), {})
    assert "asymmetry" not in dry.parameters
    assert "square" not in viscous.parameters
    assert edges.parameters["edge"].value == 0.0
    uneven = trial(sheet, names).fixed("effects.coulomb_friction.asymmetry", 0.2)
    assert effect_results(uneven, {})[0].parameters["asymmetry"].value == pytest.approx(0.2)


@pytest.mark.parametrize(("half_width", "figures"), [(0.3, 3), (4e-3, 3), (5e-5, 5), (0.0, 3)])
def test_an_interval_has_the_digits_that_tell_its_ends_apart(
    half_width: float, figures: int
) -> None:
    low, high = 0.98 - half_width, 0.98 + half_width
    shown = ParameterResult(0.98, "1", low, high, ()).told
    assert [float(s) for s in shown] == pytest.approx([0.98, low, high], abs=0.11 * half_width)
    assert max(len(s.replace(".", "").lstrip("0")) for s in shown) <= figures


@pytest.mark.parametrize(
    ("hidden", "terms"),
    [
        ({"scale": 0.015}, ["scale"]),
        ({"scale": 0.015, "curvature": 0.1}, ["scale", "slope", "curvature"]),
    ],
)
def test_a_series_keeps_the_terms_that_tell(hidden: dict[str, float], terms: list[str]) -> None:
    """Those up to the last that tells."""
    begun = search({f"effects.linkage_error.{name}": value for name, value in hidden.items()})
    found = begun[0].whole.plainer(fitted(begun, "linkage_error"))
    paths = [u.path.rsplit(".", 1)[1] for u in found.unknowns.members if not u.toleranced]
    assert paths == terms
    error = found.machine.effects.linkage_error
    for name, value in hidden.items():
        assert getattr(error, name) == pytest.approx(value, rel=0.1)


def test_a_load_that_hardly_swings_while_it_acts_is_steady() -> None:
    """On the piston from 4 to 8 s, fitted from a slow swing with a decay."""
    hidden = {"force": -1200.0, "start": 4.0, "duration": 4.0, "rise": 0.2, "piston_share": 1.0}
    slow = hidden | {"mean": 0.0, "frequency": 1e-3, "phase": -0.3, "decay": 1e-3}
    slow |= {"joint_share": 0.0, "vertical_share": 0.0}
    searched, sheet, _ = search({f"effects.external_load.{n}": v for n, v in hidden.items()})
    begun = trial(sheet, ("external_load",)).with_one_size("external_load", "force")
    x = [
        unknown.at(slow[unknown.path.rsplit(".", 1)[1]]) if not unknown.toleranced else 0.0
        for unknown in begun.unknowns.members
    ]
    found = searched.whole.fitted(begun.at(np.array(x))).machine.effects.external_load
    assert (found.frequency, found.phase, found.decay, found.mean) == (0.0, 0.0, 0.0, 0.0)
    assert found.force == pytest.approx(-1200.0, rel=0.01)
    assert found.start == pytest.approx(4.0, abs=0.02)


@pytest.mark.parametrize(
    ("effect", "sizes"),
    [
        ("flow_gain_drift", {"change": 0.3, "time_constant": 1e5}),
        ("valve_gain_asymmetry", {"lifting": 0.1}),
    ],
)
def test_a_gain_at_the_inlet_alone_is_found(effect: str, sizes: dict[str, float]) -> None:
    """Of both metering edges it would be another flow back, too."""
    values = {f"effects.{effect}.{name}": value for name, value in sizes.items()}
    begun = search(values | {f"effects.{effect}.inlet_share": 1.0})
    found = begun[0].run()
    assert [each.effects for each in found] == [(effect,)]
    shown = begun[0].whole.fitted(found[0]).machine.effects
    assert getattr(shown, effect).inlet_share == pytest.approx(1.0, abs=0.05)


def test_a_size_as_large_as_is_looked_for_is_named_with_what_comes_closest() -> None:
    """What is larger still is hidden; a size inside is not said, nor a parameter of the maker's."""
    members = unknowns(Sheet(joint1(), TOLERANCES, {}, ()), ("sensor_bias",))
    _, high = members.bounds
    for path, said in (
        ("effects.sensor_bias.pressure_lowering", ["pressure_lowering = 5e+06 Pa at the end"]),
        (next(iter(TOLERANCES)), []),
    ):
        at = [member.path for member in members.members].index(path)
        x = members.start
        x[at] = high[at]
        named = closest(Trial(("sensor_bias",), members, x, np.zeros((x.size, x.size))))
        assert named.startswith("sensor_bias comes closest")
        assert re.findall(r"pressure_lowering = .* at the end", named) == said


def test_what_is_fixed_no_longer_widens_what_is_left() -> None:
    """The curvature of a fit in which it is known lacks its row and column, nothing else."""
    members = unknowns(Sheet(joint1(), {}, {}, ()), ("sensor_delay",))
    count = len(members.members)
    slopes = np.random.default_rng(3).standard_normal((2 * count, count))
    curvature = slopes.T @ slopes
    told = Trial(("sensor_delay",), members, members.start, np.linalg.inv(curvature))
    share = [unknown.is_share for unknown in members.members].index(True)
    kept = np.delete(np.delete(curvature, share, 0), share, 1)
    found = told.fixed(members.members[share].path, 1.0).covariance
    assert found == pytest.approx(np.linalg.inv(kept))


def test_a_healthy_machine_keeps_no_effect() -> None:
    begun = search({})
    assert needed(begun[0], fitted(begun, "viscous_friction")).effects == ()


def test_parameters_are_fitted_to_the_end_before_an_effect_is_asked_about() -> None:
    """A fit of parameters that leaves a little lacks nothing but its end."""
    searched, _, evidence = search({})
    off = searched.refitted
    while at_noise(off, evidence):
        off = off.at(off.x + np.where(off.unknowns.toleranced, 0.01, 0.0))
    assert mean_square(off, evidence) < EXPLAINED**2
    searched.refitted = off
    (found,) = searched.run()
    assert found.effects == ()
    assert at_noise(found, evidence)
    assert len(searched.tried) == 1


def test_one_effect_stays_as_the_balances_say_while_another_drives_the_free_run_away() -> None:
    """Soft hoses on a valve that lowers a tenth slower: fitted to the free run alone they are off.

    What is looked for beside them is then looked for beside the right ones.
    """
    hidden = {
        "effects.vessel_compliance.lifting": 3.1e-11,
        "effects.vessel_compliance.lowering": 9.3e-11,
        "effects.valve_gain_asymmetry.lowering": -0.1,
    }
    long = moved(with_values(joint1(), hidden), duration=24.0)
    searched, _, _ = search({}, lambda _: long)
    found = searched.run()
    assert [t.effects for t in found] == [("vessel_compliance", "valve_gain_asymmetry")]
    hoses = next(t.trial for t in searched.tried if t.trial.effects == ("vessel_compliance",))
    cylinder = joint1().cylinder
    stroke = float(np.mean(long.outputs[:, 0]))
    volume = cylinder.volume_lowering_0 - cylinder.area_lowering * stroke
    lowering = vessel_compliance.lowering(volume, Plant(hoses.machine).record[0])
    assert lowering == pytest.approx(9.3e-11, rel=0.06)


def test_a_black_box_learns_from_recordings_of_different_sampling() -> None:
    """A second recording with twice as many samples as the first says what it says without."""

    def thinned(experiment: Experiment) -> Experiment:
        return replace(
            experiment,
            period=2.0 * experiment.period,
            angle=experiment.angle[::2],
            outputs=experiment.outputs[::2],
            rest=experiment.rest // 2,
        )

    first, second = thinned(moved(joint1(), seed=5)), moved(joint1(), seed=6)
    mixed = train_one_step(Evidence([first, second], joint1()))
    alike = train_one_step(Evidence([first, thinned(second)], joint1()))
    assert mixed.period == alike.period == first.period
    errors = [mixed.one_step(second), alike.one_step(thinned(second))]
    largest = column_rms(errors[1]).max()
    assert column_rms(errors[0] - errors[1]) == pytest.approx(0.0, abs=1e-3 * largest)

"""The balances of runs that another integrator made: quiet, or loud where the effect is."""

import numpy as np
import pytest
import recorded
from operated import operated

from emir_analysis.diagnosis.balances import BALANCES, Balances
from emir_analysis.diagnosis.experiment import experiment
from emir_analysis.signals import Recording, Signal
from emir_common.parameter_tree import with_values
from emir_plant.parameters import Machine
from emir_plant.sheet import joint1, load_sheet

FRICTION = 12e3  # N
DROOP = "effects.supply_pressure_droop"
SPRING = 1.839e8  # N m/rad, of the data sheet


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Machine:
    """The machine of the tests' data sheet."""
    sheet = tmp_path_factory.mktemp("sheet") / "datasheet.yaml"
    sheet.write_text(recorded.DATA_SHEET)
    return load_sheet(sheet).machine


def residuals(machine: Machine, friction: recorded.Force | None) -> tuple[Balances, recorded.Array]:
    """Return the balances of the machine along a run with friction, and what they lack."""
    commands = recorded.moves(16.0, seed=5)
    balances = balances_of(machine, commands, recorded.simulate(machine, commands, friction))
    return balances, balances.residuals([machine])[0]


def distorted(machine: Machine, wrong: Machine) -> Balances:
    """Return the balances of a run of the machine, read by the sensors of the wrong one.

    A bias, a gain and a delay written a second time: dead time by shifting, a lag by its step
    response.
    """
    effects = wrong.effects
    commands = recorded.moves(16.0, seed=5)
    truth = recorded.simulate(machine, commands)
    bent = truth[:, 3] - truth[:, 2]
    late = [bent[0]]
    if effects.sensor_delay.dead_share == 1.0:
        samples = round(effects.sensor_delay.deflection / recorded.SAMPLE_PERIOD)
        late = [*([bent[0]] * samples), *bent[:-samples]]
    else:
        decay = np.exp(-recorded.SAMPLE_PERIOD / effects.sensor_delay.deflection)
        for now, before in zip(bent[1:], bent[:-1], strict=True):
            late.append(decay * late[-1] + (1.0 - decay) * 0.5 * (now + before))
    truth[:, 3] = truth[:, 2] + late
    truth[:, 0] += effects.sensor_bias.pressure_lifting
    truth[:, 1] *= 1.0 + effects.sensor_gain.pressure_lowering
    return balances_of(machine, commands, truth)


def balances_of(machine: Machine, commands: recorded.Array, truth: recorded.Array) -> Balances:
    """Return the balances of a run whose true signals are given."""
    sensors = recorded.measured(machine, truth, seed=5)
    topics = {
        "joint_angle": "joint_states",
        "piston_stroke": "cylinder",
        "pressure_lifting": "pressure_lifting",
        "pressure_lowering": "pressure_lowering",
        "tip_deflection_angle": "boom_deflection",
    }
    signals = {name: Signal(name, *sensors[topic], "") for name, topic in topics.items()}
    time = np.arange(commands.size) * recorded.COMMAND_PERIOD
    signals["valve_command"] = Signal("valve_command", time, commands, "1")
    return Balances(experiment("run", Recording(signals, 0), machine), machine)


def test_a_stroke_that_no_sensor_shows_is_the_angles(machine: Machine) -> None:
    truth = recorded.simulate(machine, recorded.moves(12.0, seed=5))
    sensors = recorded.measured(machine, truth, seed=5)
    command = Signal("valve_command", np.array([0.0, 1.0]), np.array([0.0, 0.4]), "1")
    angle = Signal("joint_angle", *sensors["joint_states"], "rad")
    run = experiment("run", Recording({"valve_command": command, "joint_angle": angle}, 0), machine)
    stroke = sensors["cylinder"][1]
    assert run.outputs[:, 0] == pytest.approx(stroke[: run.angle.size], abs=1e-9)
    assert "piston_stroke" not in run.measured


def test_a_command_that_is_published_when_it_changes_is_0_before_the_first_move(
    machine: Machine,
) -> None:
    truth = recorded.simulate(machine, recorded.moves(12.0, seed=5))
    angle = Signal("joint_angle", *recorded.measured(machine, truth, seed=5)["joint_states"], "rad")
    command = Signal("valve_command", np.array([1.0, 3.0]), np.array([0.4, 0.0]), "1")
    run = experiment("run", Recording({"valve_command": command, "joint_angle": angle}, 0), machine)
    assert np.all(run.commands[:1000] == 0.0)
    assert np.all(run.commands[1000:3000] == 0.4)
    assert np.all(run.commands[3000:] == 0.0)


def rms(missing: recorded.Array) -> dict[str, float]:
    return dict(zip(BALANCES, np.sqrt(np.mean(missing**2, axis=0)), strict=True))


def assert_nothing_is_missing(machine: Machine, missing: recorded.Array) -> None:
    """Demand that no balance keeps more than the sensors leave in it.

    From the resolver alone: a parabola through 100 angles of 1 s, a line through 50 of 0.5 s, each
    angle off by a step's uniform error; 2 for the pressures' noise and the smoothing.
    """
    found = rms(missing)
    step = recorded.STEP / np.sqrt(12.0)
    arm, inertia = 0.64, 5000.0 * 22.5**2 / 3.0
    assert found["force"] < 2.0 * np.sqrt(4.0 * 180.0 / 100.0) * step * inertia / arm
    slope = np.sqrt(12.0 / 50.0) / 0.5 * step * arm
    assert found["lifting_chamber"] < 2.0 * slope * machine.cylinder.area_lifting + 4e-6
    assert found["lowering_chamber"] < 2.0 * slope * machine.cylinder.area_lowering + 4e-6
    assert found["linkage"] < 1e-9
    assert found["bending"] < machine.sensors.deflection_noise


def test_the_right_machine_lacks_nothing(machine: Machine) -> None:
    assert_nothing_is_missing(machine, residuals(machine, None)[1])


def test_long_steps_of_integration_leave_the_balances_as_they_are(machine: Machine) -> None:
    """Commands change inside a step of 5 ms, which takes the mean of them."""
    balances, found = residuals(machine, None)
    exact = balances.residuals([machine], longest=1e-3)[0]
    for name in ("force", "lifting_chamber", "lowering_chamber", "bending"):
        assert 0.0 < rms(found - exact)[name] < 0.05 * rms(exact)[name], name


@pytest.mark.parametrize(
    "quick",
    [
        {"geometry.section_spring": 16.0 * SPRING},  # its modes turn by up to 8 rad in 5 ms
        {"logic_block.time_constant_opening": 1e-3, "logic_block.threshold": 105e5},
        {"effects.logic_block_fault.opening": 50.0, "logic_block.threshold": 105e5},
        {"effects.logic_block_fault.blocked": 0.5, "logic_block.threshold": 105e5},
        {"effects.logic_block_fault.hysteresis": 10e5, "logic_block.threshold": 105e5},
        {"valve.natural_frequency": 2000.0},
        {f"{DROOP}.resistance": 1e9, f"{DROOP}.time_constant": 1e-3},
        {f"{DROOP}.resistance": 1e10, f"{DROOP}.time_constant": 0.1},
        {"effects.backlash.gap": 1e-3, "effects.backlash.crossing_time": 2e-3},
    ],
)
def test_what_is_quick_is_followed(machine: Machine, quick: dict[str, float]) -> None:
    """At the minima of p_H the block shuts at its threshold and opens at once."""
    other = with_values(machine, quick)
    commands = np.round(5.0 * recorded.moves(12.0, seed=5)) / 5.0
    balances = balances_of(other, commands, recorded.simulate(other, commands))
    found = balances.residuals([other])[0]
    if not other.effects.backlash.is_on:  # which moves the stroke
        assert_nothing_is_missing(other, found)
    exact = balances.residuals([other], longest=2e-4)[0]
    for name in ("force", "lifting_chamber", "lowering_chamber", "bending"):
        assert rms(found - exact)[name] < 0.05 * rms(exact)[name], name


def test_the_mean_command_of_a_step_keeps_what_the_command_adds_up_to(machine: Machine) -> None:
    truth = recorded.simulate(machine, recorded.moves(12.0, seed=5))
    angle = Signal("joint_angle", *recorded.measured(machine, truth, seed=5)["joint_states"], "rad")
    command = Signal("valve_command", np.array([0.0, 1.003, 2.5]), np.array([0.0, 0.4, -0.2]), "1")
    run = experiment("run", Recording({"valve_command": command, "joint_angle": angle}, 0), machine)
    means, step = run.mean_commands(4e-3)  # rows of 10 ms: three steps in each
    assert step == pytest.approx(0.01 / 3.0)
    total = np.cumsum(means) * step
    time = step * np.arange(1, total.size + 1)
    given = 0.4 * np.clip(time - 1.003, 0.0, 1.497) - 0.2 * np.maximum(time - 2.5, 0.0)
    assert total == pytest.approx(given, abs=1e-9)


def test_friction_shows_in_the_force_balance_and_leaves_the_chambers_quiet(
    machine: Machine,
) -> None:
    _, quiet = residuals(machine, None)
    balances, missing = residuals(machine, lambda _, v: FRICTION * float(np.tanh(v / 1e-3)))
    _, velocity = balances.signals()["piston_velocity"]
    steady = np.abs(velocity) > 0.015
    force = missing[:, 0]
    assert np.median(force[steady & (velocity > 0.0)]) == pytest.approx(-FRICTION, rel=0.05)
    assert np.median(force[steady & (velocity < 0.0)]) == pytest.approx(FRICTION, rel=0.05)
    assert rms(missing)["lifting_chamber"] < 1.5 * rms(quiet)["lifting_chamber"]
    assert rms(missing)["lowering_chamber"] < 1.5 * rms(quiet)["lowering_chamber"]


@pytest.mark.parametrize("dead_share", [0.0, 1.0])
def test_a_sensor_that_is_known_to_distort_leaves_the_balances_quiet(
    machine: Machine, dead_share: float
) -> None:
    balances, _ = residuals(machine, None)
    wrong = with_values(
        machine,
        {
            "effects.sensor_bias.pressure_lifting": 3e5,
            "effects.sensor_gain.pressure_lowering": 0.05,
            "effects.sensor_delay.deflection": 0.02,
            "effects.sensor_delay.dead_share": dead_share,
        },
    )
    seen, unseen = distorted(machine, wrong).residuals([wrong, machine])
    quiet, loud = rms(seen), rms(unseen)
    healthy = rms(balances.residuals([machine])[0])
    for name in ("force", "lifting_chamber", "lowering_chamber", "bending"):
        assert quiet[name] < 1.5 * healthy[name], name
    assert loud["force"] > 5.0 * quiet["force"]
    assert loud["bending"] > 1.5 * quiet["bending"]


def test_a_chamber_that_runs_empty_is_known_to_under_a_bias() -> None:
    """An empty chamber has no rate of pressure; a transducer 1.5 bar too high shows it filled."""
    machine = joint1()
    biased = with_values(machine, {"effects.sensor_bias.pressure_lowering": 1.5e5})
    commands = np.clip(1.6 * recorded.moves(16.0, seed=7), -1.0, 1.0)
    runs = {each: operated(each, commands) for each in (machine, biased)}
    empty = np.mean(runs[machine].outputs[:, 2] < 5.0 * machine.sensors.pressure_noise)
    assert empty > 0.01
    as_read, as_biased = (
        rms(Balances(run, machine).residuals([each])[0])["lowering_chamber"]
        for each, run in runs.items()
    )
    assert as_biased < 1.2 * as_read

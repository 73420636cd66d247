"""Signals that are wired or stamped wrongly, on machines that another integrator simulated."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import recorded

from emir_analysis.diagnosis.experiment import Experiment, experiment
from emir_analysis.diagnosis.statement import of_stamps
from emir_analysis.diagnosis.wiring import check_wiring
from emir_analysis.errors import InputError
from emir_analysis.signals import Recording, Signal
from emir_common.parameter_tree import with_values
from emir_plant.parameters import Machine
from emir_plant.sheet import load_sheet

TOPICS = {
    "joint_angle": "joint_states",
    "piston_stroke": "cylinder",
    "pressure_lifting": "pressure_lifting",
    "pressure_lowering": "pressure_lowering",
    "tip_deflection_angle": "boom_deflection",
}
DURATION = 14.0  # s

Signals = dict[str, Signal]


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Machine:
    """The machine of the data sheet."""
    path = tmp_path_factory.mktemp("rig") / "datasheet.yaml"
    path.write_text(recorded.DATA_SHEET)
    return load_sheet(path).machine


def signals(machine: Machine) -> Signals:
    """Return what the sensors of a machine show while it is moved up and down."""
    commands = recorded.moves(DURATION, seed=5)
    shown = recorded.measured(machine, recorded.simulate(machine, commands), seed=6)
    found = {name: Signal(name, *shown[topic], "") for name, topic in TOPICS.items()}
    time = np.arange(commands.size) * recorded.COMMAND_PERIOD
    return found | {"valve_command": Signal("valve_command", time, commands, "1")}


@pytest.fixture(scope="module")
def healthy(machine: Machine) -> Signals:
    """What a machine shows that is as its data sheet says."""
    return signals(machine)


def opened(shown: Signals, machine: Machine) -> Experiment:
    """Open a recording as the command does."""
    found = experiment("bag", Recording(shown, 0), machine)
    check_wiring(found, machine)
    return found


def _turned(name: str) -> Callable[[Signals], Signals]:
    return lambda shown: shown | {name: replace(shown[name], value=-shown[name].value)}


def _deflection_in(unit: float) -> Callable[[Signals], Signals]:
    name = "tip_deflection_angle"
    return lambda shown: shown | {name: replace(shown[name], value=shown[name].value / unit)}


def _exchanged(shown: Signals) -> Signals:
    lifting, lowering = shown["pressure_lifting"], shown["pressure_lowering"]
    return shown | {
        "pressure_lifting": replace(lowering, name="pressure_lifting"),
        "pressure_lowering": replace(lifting, name="pressure_lowering"),
    }


def _angle_alone_turned(shown: Signals) -> Signals:
    return {name: s for name, s in _turned("joint_angle")(shown).items() if name != "piston_stroke"}


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (_exchanged, "pressure_lifting and pressure_lowering look exchanged"),
        (_turned("tip_deflection_angle"), "tip_deflection_angle has its sign turned round"),
        (_deflection_in(np.pi / 180.0), "tip_deflection_angle looks to be in deg"),
        (_deflection_in(1e-3), "tip_deflection_angle reaches .* is it in mrad"),
        (_turned("piston_stroke"), "piston_stroke has its sign turned round"),
        (_turned("valve_command"), "moves against valve_command"),
        (_turned("joint_angle"), "moves against valve_command"),
        (_angle_alone_turned, "moves against valve_command"),
    ],
)
def test_a_signal_that_is_another_or_turned_round_is_told(
    healthy: Signals, machine: Machine, spoil: Callable[[Signals], Signals], reason: str
) -> None:
    with pytest.raises(InputError, match=f"bag: .*{reason}") as told:
        opened(spoil(healthy), machine)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    "effect",
    [
        {},
        {"effects.payload.mass": 900.0},
        {"effects.stribeck_friction.force": 25e3, "effects.stribeck_friction.breakaway": 1.5},
        {"effects.sensor_bias.deflection": 5e-3},
        {"effects.linkage_error.scale": 0.1},
    ],
)
def test_what_a_machine_lacks_is_not_taken_for_a_wrong_wiring(
    machine: Machine, effect: dict[str, float]
) -> None:
    found = opened(signals(with_values(machine, effect)), machine)
    assert found.measured == {*TOPICS}


@pytest.mark.parametrize("steady", [True, False])
def test_stamps_that_scatter_are_mended_or_told(
    healthy: Signals, machine: Machine, *, steady: bool
) -> None:
    """Those of messages that were 0 to 8 ms under way, and of sensors read at such times."""
    random, late = np.random.default_rng(1), dict(healthy)
    for name in TOPICS:
        signal = healthy[name]
        time = np.sort(signal.time + random.uniform(0.0, 8e-3, signal.time.size))
        value = signal.value if steady else np.interp(time, signal.time, signal.value)
        late[name] = replace(signal, time=time, value=value)
    found = opened(late, machine)
    told = "".join(found.mended) if steady else of_stamps([opened(healthy, machine), found])
    assert "scatter by 2." in told  # of two such delays' difference half is within 2.3 ms
    assert bool(found.mended) == steady
    assert not (steady and of_stamps([found]))


@pytest.mark.parametrize(("share", "told"), [(0.0, ""), (0.05, ""), (0.3, "% of a sensor's sam")])
def test_lost_samples_are_told(healthy: Signals, machine: Machine, share: float, told: str) -> None:
    random, thinned = np.random.default_rng(1), dict(healthy)
    for name in TOPICS:
        signal = healthy[name]
        kept = random.uniform(size=signal.time.size) >= share
        kept[[0, -1]] = True
        thinned[name] = replace(signal, time=signal.time[kept], value=signal.value[kept])
    found = opened(thinned, machine)
    assert found.stamps.lost == pytest.approx(share, abs=0.03)
    said = of_stamps([found])
    assert bool(said) == bool(told)
    assert told in said

"""The design model against the nonlinear machine, and the stability map against its motion."""

import math
from pathlib import Path

import numpy as np
import pytest
import yaml

from emir_analysis.cli import main
from emir_analysis.closed_loop import ClosedLoop
from emir_analysis.design_pfc import (
    DesignTask,
    OperatingPoint,
    design_pfc,
    steady_motion,
    velocity_model,
)
from emir_analysis.node_controls import PfcControl
from emir_analysis.stability_map import stability_map
from emir_common.parameter_tree import with_values
from emir_common.quantity import ParameterError
from emir_control import pfc_file
from emir_control.design import spectral_radius
from emir_control.force_loop import ForceLoop, ForceLoopInputs, ForceLoopParameters
from emir_control.pfc import Pfc
from emir_control.trajectory import TrajectoryParameters, named
from emir_msgs_py.topics import CONTROL_PERIOD
from emir_plant import core
from emir_plant.plant import Plant, SimulationError
from emir_plant.sheet import joint1

FORTY_FIVE = math.radians(45.0)


@pytest.mark.parametrize("velocity", [0.02, -0.02])
def test_steady_motion_keeps_its_pressures(velocity: float) -> None:
    plant = Plant(joint1())
    state, command = steady_motion(plant, OperatingPoint(velocity=velocity))
    rate = plant.derivative(state, command)
    stiff = plant.machine.cylinder.beta / 0.03  # Pa/m^3, what a shut chamber would answer
    assert abs(rate[[core.P_H, core.P_S]]).max() < 1e-6 * stiff * abs(velocity) * 0.06
    assert plant.outputs(state).velocity == pytest.approx(velocity, rel=1e-3)


def test_a_motion_that_the_machine_does_not_have_is_named() -> None:
    heavy = with_values(joint1(), {"geometry.payload": 3000.0})
    with pytest.raises(SimulationError, match=r"30\.0 deg the boom needs"):
        steady_motion(Plant(heavy), OperatingPoint(angle=math.radians(30.0), payload=3000.0))
    with pytest.raises(ParameterError, match="the machine has to move"):
        OperatingPoint(velocity=0.0)


@pytest.mark.parametrize("output", ["stroke", "tip_angle"])
@pytest.mark.parametrize("payload", [0.0, 1000.0])
def test_design_model_answers_a_small_step_as_the_nonlinear_machine_does(
    output: str, payload: float
) -> None:
    """Machine and force loop, moving at 20 mm/s; the command's step is 1 mm/s."""
    point = OperatingPoint(payload=payload, velocity=0.02)
    machine = with_values(joint1(), {"geometry.payload": payload})
    plant, loop = Plant(machine), ForceLoop(ForceLoopParameters())

    def run(step: float) -> np.ndarray:
        state, _ = steady_motion(plant, point)
        shown, control, found = plant.outputs(state), None, []
        for _ in range(60):
            found.append(getattr(shown, output))
            sensed = ForceLoopInputs(
                0.02 + step, 0.0, 0.0, shown.pressure_lifting, shown.pressure_lowering
            )
            control = control or loop.initial(sensed, 0.02)
            control, out = loop.step(control, sensed, CONTROL_PERIOD)
            state, shown = plant.step(state, out.valve_command, CONTROL_PERIOD)
        return np.array(found)

    model = velocity_model(joint1(), point, output)
    x, expected = np.zeros(model.order), []
    for _ in range(60):
        expected.append(float(model.C @ x))
        x = model.next(x, 1e-3)
    answer = run(1e-3) - run(0.0)
    assert answer == pytest.approx(expected, abs=0.03 * max(expected))


def test_the_designs_that_come_with_the_project_are_what_the_command_makes(tmp_path: Path) -> None:
    for controller, output in (("pfc", "stroke"), ("pfc_tip", "tip_angle")):
        file = tmp_path / f"{controller}.yaml"
        assert main(["design", "--controller", controller, "--out", str(file)]) == 0
        made, kept = (pfc_file.load(f, output) for f in (file, pfc_file.default_file(output)))
        assert Pfc(made).gains.reference == pytest.approx(Pfc(kept).gains.reference, rel=1e-3)
        assert Pfc(made).gains.decay == pytest.approx(Pfc(kept).gains.decay, rel=1e-3)
        # LAPACKs differ; the state's basis is free, what the model answers is not
        for steps in (1, 7, 20):
            answers = [p.model.held_response(steps) for p in (made, kept)]
            assert answers[0] == pytest.approx(answers[1], rel=1e-3)


@pytest.mark.parametrize(
    ("degrees", "payload", "stable"),
    [
        (45.0, 0.0, True),
        (60.0, 0.0, True),
        (45.0, 500.0, True),
        (45.0, 1500.0, False),
        (60.0, 1500.0, False),
    ],
)
def test_stability_is_what_the_nonlinear_machine_shows(
    degrees: float,
    payload: float,
    stable: bool,  # noqa: FBT001 (a parameter)
) -> None:
    """Designed empty at 45 deg, tried elsewhere: it swings on after the move, or comes to rest."""
    angle = math.radians(degrees)
    machine = with_values(joint1(), {"geometry.payload": payload})
    law = Pfc(pfc_file.load(pfc_file.default_file("stroke"), "stroke"))
    point = OperatingPoint(angle=angle, payload=payload)
    assert (spectral_radius(law, velocity_model(machine, point, "stroke")) < 1.0) == stable
    trajectory = named("lift-lower", TrajectoryParameters(pause=12.0))
    run = ClosedLoop(Plant(machine), trajectory, PfcControl(law)).run(angle, 2e6, 16.3)
    early, late = (
        np.ptp(run["tcp_deflection"][round(a / 0.008) : round((a + 3.0) / 0.008)])
        for a in (4.3, 13.3)
    )
    assert (late < 0.03) == stable  # m: a step of the resolver is 3 cm at the TCP
    assert stable or late > early


def test_a_slow_observer_and_a_heavy_design_hold_everywhere() -> None:
    """One set of gains over postures 30-75 deg and 0-1500 kg; the design at 45 deg does not."""
    point = OperatingPoint(angle=math.radians(75.0), payload=750.0)
    robust = design_pfc(joint1(), DesignTask(point=point, observer=2e-5))
    assert stability_map(joint1(), "pfc", robust).worst < 1.0
    assert stability_map(joint1(), "pfc", design_pfc(joint1(), DesignTask())).worst > 1.0


def test_design_command_writes_file_and_picture_and_says_where_it_is_stable(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, image = tmp_path / "pfc.yaml", tmp_path / "map.png"
    words = ["--order", "4", "--coincidence", "10", "20", "--response-time", "2"]
    words += ["--observer", "1e-4", "--out", str(file), "--picture", str(image)]
    assert main(["design", *words]) == 0
    said = capsys.readouterr().out
    assert "pfc of order 5" in said  # the observer's state included
    assert "lifting" in said
    assert "1500 kg" in said
    assert pfc_file.load(file, "stroke").coincidence == (10, 20)
    # the file says how it is made again
    told, again = yaml.safe_load(file.read_text())["made_by"]["command"], tmp_path / "again.yaml"
    assert main([*told.removeprefix("emir ").split(), "--out", str(again)]) == 0
    assert again.read_text() == file.read_text()
    assert image.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--controller", "magic"], "controller 'magic': there are pfc, pfc_tip"),
        (["--order", "40"], "order = 40: the model allows"),
        (["--order", "0"], "order = 0: the model allows"),
        (["--observer", "-1"], "observer = -1 m/s: has to be 0 or more"),
        (["--observer", "nan"], "observer = nan m/s: has to be 0 or more"),
        (["--from", "nowhere.yaml"], "nowhere.yaml: No such file"),
        (["--angle", "200"], "angle = 3.49"),
        (["--payload", "3000", "--angle", "20"], "design: joint 1: at 20.0 deg the boom needs"),
        (["--coincidence", "25"], "rising numbers from 1 to 20"),
        (["--oil-tolerance", "0.1"], "--oil-tolerance: of lqg and mpc, not of pfc"),
    ],
)
def test_bad_input_is_one_clear_line(
    words: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    import re

    file = tmp_path / "pfc.yaml"
    assert main(["design", *words, "--out", str(file)]) == 1
    errors = [line for line in capsys.readouterr().err.splitlines() if line.startswith("emir ")]
    assert len(errors) == 1
    assert re.search(said, errors[0])
    assert not file.exists()


def test_a_folder_called_as_the_joint_is_no_recording_to_design_from(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "joint1").mkdir()
    monkeypatch.chdir(tmp_path)
    assert main(["design", "--out", str(tmp_path / "pfc.yaml")]) == 0

"""Models from recorded signals against the model that made them, and against the machine's own."""

import math
from pathlib import Path

import numpy as np
import pytest

from emir_analysis.cli import main
from emir_analysis.closed_loop import ClosedLoop
from emir_analysis.control_protocols import Stepping
from emir_analysis.design_pfc import DesignTask, OperatingPoint, designed, velocity_model
from emir_analysis.errors import InputError
from emir_analysis.identify import difference, identify
from emir_analysis.node_controls import CascadeControl, PfcControl
from emir_common.quantity import ParameterError
from emir_control import pfc_file
from emir_control.design import spectral_radius
from emir_control.internal_model import InternalModel
from emir_control.pfc import Pfc
from emir_control.trajectory import TrajectoryParameters, named
from emir_msgs_py.topics import TICKS
from emir_plant.plant import Plant
from emir_plant.sheet import joint1

SHORT = Path(__file__).parents[2] / "bags" / "lift"
PLAIN = Pfc(pfc_file.load(pfc_file.default_file("stroke"), "stroke"))
TO_THE_SLOW_MODE = (0.1, 0.2, 0.35, 0.5, 0.7)  # Hz


def _oscillator() -> InternalModel:
    """An integrator and a damped swing of 0.7 Hz."""
    pole = np.exp((-0.3 + 0.95j) * 2.0 * math.pi * 0.7 * 0.032)
    swing = np.array([[2.0 * pole.real, -(abs(pole) ** 2)], [1.0, 0.0]])
    gain = 0.5 * (1.0 - 2.0 * pole.real + abs(pole) ** 2)
    stepping = np.block([[swing, np.zeros((2, 1))], [np.array([[gain, gain, 1.0]])]])
    return InternalModel(stepping, np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.032]), 0.032)


def test_the_model_that_made_the_signals_is_found() -> None:
    model, rng = _oscillator(), np.random.default_rng(1)
    command = 0.02 * np.repeat(rng.choice([-1.0, 0.0, 1.0], 60), 12)
    x, output = np.zeros(3), []
    for u in command:
        output.append(float(model.C @ x))
        x = model.next(x, u)
    found = identify(command, np.array(output), 3)
    assert found.fit > 0.999
    assert difference(found.model, model, TO_THE_SLOW_MODE).max() < 1e-3
    rounded = identify(command, np.round(np.array(output) / 1e-3) * 1e-3, 3)
    assert difference(rounded.model, model, TO_THE_SLOW_MODE).max() < 0.05


@pytest.mark.parametrize("output", ["stroke", "tip_angle"])
@pytest.mark.parametrize("outer", [CascadeControl(), PfcControl(PLAIN)], ids=["cascade", "pfc"])
def test_an_ordinary_run_of_the_machine_tells_its_slow_dynamics(
    outer: Stepping, output: str
) -> None:
    """Sensors as they are, 12 bits and noise; against the machine linearized, order 10 and more."""
    trajectory = named("lift-lower", TrajectoryParameters())
    run = ClosedLoop(Plant(joint1()), trajectory, outer).run(math.pi / 4, 2e6, 17.6)
    shown = run["stroke"] if output == "stroke" else run["angle"] + run["deflection"]
    found = identify(run["velocity_command"], shown[::TICKS], 4)
    assert found.fit > 0.75
    own = velocity_model(joint1(), OperatingPoint(), output)
    assert difference(found.model, own, TO_THE_SLOW_MODE).max() < 0.12
    if output == "stroke":  # good enough to design by: stable on the machine it came from
        assert spectral_radius(Pfc(designed(found.model, DesignTask())), own) < 1.0


def test_what_tells_nothing_is_refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nothing moves"):
        identify(np.zeros(400), np.full(400, 0.5), 4)
    with pytest.raises(ParameterError, match="order = 1: at least 2"):
        identify(np.zeros(400), np.zeros(400), 1)
    out = ["--out", str(tmp_path / "pfc.yaml")]
    assert main(["design", "--from", str(SHORT), *out]) == 1
    assert f"{SHORT}: 3.2 s: at least 8 s are needed" in capsys.readouterr().err
    assert main(["design", "--from", str(SHORT), "--schedule", *out]) == 1
    assert "--schedule: one recording tells one model" in capsys.readouterr().err

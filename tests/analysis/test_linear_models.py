"""Linear design models against python-control, an independent simulation, and bad input."""

import json
import math
from importlib.util import find_spec
from pathlib import Path

import control
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from emir_analysis import linearize_command
from emir_analysis.cli import main
from emir_analysis.linear_models import FREQUENCIES, FULL, Point, design_models, linear, state_space
from emir_common.parameter_tree import with_values
from emir_plant import core
from emir_plant.core import Truth
from emir_plant.plant import Plant
from emir_plant.sheet import even_edges, joint1
from emir_plant.transfer import mechanics

FORTY_FIVE = math.radians(45.0)
PLANT = Plant(joint1())
LIFTING, LOWERING = Point(FORTY_FIVE, 0.02), Point(math.radians(60.0), -0.015)
OUTPUTS = ("stroke", "tip_angle", "force")


@pytest.mark.parametrize("point", [LIFTING, LOWERING], ids=["lifting", "lowering"])
def test_step_response_is_an_independent_solvers(point: Point) -> None:
    """The nonlinear machine by Radau, pushed a little further from its steady motion.

    For as long as its posture, and with it the linear model, is the same.
    """
    state, command = point.steady(PLANT)
    time = np.arange(0.0, 0.6, 0.01)

    def run(y: float) -> np.ndarray:
        found = solve_ivp(
            lambda _t, x: PLANT.derivative(x, y), (0.0, time[-1]), state, "Radau", time,
            rtol=1e-9, atol=1e-9,
        )  # fmt: skip
        return np.array([PLANT.outputs(x) for x in found.y.T])

    push = 1e-3
    columns = [Truth._fields.index(name) for name in OUTPUTS]
    exact = (run(command + push) - run(command))[:, columns].T
    system = state_space(linear(PLANT, point, OUTPUTS), OUTPUTS)
    ours = control.forced_response(system, time, np.full(time.size, push)).outputs
    for wanted, found in zip(exact, ours, strict=True):
        assert np.abs(found - wanted).max() < 0.02 * np.abs(wanted).max()


def test_frequency_response_is_that_of_the_mechanics_transfer_functions() -> None:
    """Stroke over force and tip over force are G_h and G_alpha6 (2), (4), known in closed form."""
    plant = Plant(with_values(joint1(), {"resistances.k_meter_out_lifting": 1e12}))
    point = Point(FORTY_FIVE, 1e-3)
    system = state_space(linear(plant, point, OUTPUTS), OUTPUTS)
    frequency = np.geomspace(0.05, 15.0, 60)
    stroke, tip, force = system(2j * np.pi * frequency, squeeze=False)[:, 0, :]
    found = mechanics(plant, FORTY_FIVE)
    s = 2j * np.pi * frequency
    assert stroke / force == pytest.approx(found.stroke()(s), rel=0.05)
    assert tip / force == pytest.approx(found.tip_angle()(s), rel=0.05)


def test_low_orders_do_up_to_the_dominant_mode() -> None:
    """What the paper found, 2.3: order 6 or 8 is a good trade."""
    for machine in (joint1(), even_edges()):
        found = design_models(Plant(machine), LIFTING)
        assert found.systems[FULL].nstates == 15
        for name in found.error:
            assert found.systems[name].nstates == int(name[-1])
            assert found.worst(name, "tip_angle", 0.8) < 0.05
            assert found.off(name, "stroke") < 0.03
        theirs = control.frequency_response(found.systems[FULL], 2.0 * np.pi * FREQUENCIES)
        assert abs(found.response[FULL]) == pytest.approx(theirs.magnitude[:, 0, :])


def test_every_posture_load_and_motion_has_its_model() -> None:
    for angle in (10.0, 45.0, 75.0):
        for load in (0.0, 500.0):
            plant = Plant(with_values(joint1(), {"geometry.payload": load, "supply.p0": 3e7}))
            for point in (
                Point(math.radians(angle), 0.01),
                Point(math.radians(angle), -0.03),
                Point(math.radians(angle), None, 0.4),
                Point(math.radians(angle), None, -0.4),
            ):
                state, command = point.steady(plant)
                rate = plant.derivative(state, command)
                assert np.abs(rate[[core.P_H, core.P_S]]).max() < 1.0  # Pa/s
                assert np.sign(plant.outputs(state).velocity) == np.sign(command)
                assert np.isfinite(linear(plant, point, OUTPUTS).A).all()


def test_command_writes_models_that_python_control_reads_back(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["linearize", "--out", str(tmp_path / "new"), "--angle", "30", "--order", "6"]
    assert main(words) == 0
    assert (tmp_path / "new" / "linear.png").stat().st_size > 1e4
    said = capsys.readouterr().out
    told = json.loads((tmp_path / "new" / "linear.json").read_text())
    assert set(told["models"]) == {"linear", "balanced, order 6", "modal, order 6"}
    for name, model in told["models"].items():
        system = control.StateSpace(*(model[key] for key in "ABCD"))
        assert system.nstates == (15 if name == FULL else 6)
        assert name in said
    full, modal = (told["models"][n] for n in (FULL, "modal, order 6"))
    at = 2j * np.pi * 0.7
    answers = [control.StateSpace(*(m[k] for k in "ABCD"))(at)[1, 0] for m in (full, modal)]
    assert answers[1] == pytest.approx(answers[0], rel=0.01)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--velocity", "0"], "the machine has to move"),
        (["--command", "0.05"], "y2 = 0.05: in the valve's dead zone nothing moves"),
        (["--command", "5"], "command = 5: outside -1 ... 1"),
        (["--command", "nan"], "command = nan: outside -1 ... 1"),
        (["--step", "0"], "step = 0: outside -1 ... 1, or none"),
        (["--step", "nan"], "step = nan: outside"),
        (["--step", "100"], "step = 100: outside"),
        (["--velocity", "500"], "no steady motion of 500 mm/s at 45 deg with 0 kg"),
        (["--angle", "-60"], "boom angle -60.0 deg: outside the linkage's reach"),
        (["--payload", "1500", "--angle", "5"], "linearize: joint1: at 5.0 deg the boom needs"),
        (["--outputs", "colour"], "output 'colour': there are angle, tip_angle, stroke"),
        (["--order", "1"], "order = 1: the model allows 2 ... 15"),
        (["--from", "none.yaml"], "none.yaml: No such file or directory"),
        (["--payload", "9000"], "geometry.payload = 9000: outside 0 ... 3000 kg"),
    ],
)
def test_bad_input_is_one_clear_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    assert main(["linearize", "--out", str(tmp_path / "out"), *words]) == 1
    shown = capsys.readouterr().err
    assert said in shown
    assert shown.count("\n") == 1


def test_more_than_the_rated_payload_is_allowed_with_a_warning(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--payload", "1600", "--angle", "75", "--order", "6", "--out", str(tmp_path)]
    assert main(["linearize", *words]) == 0
    assert capsys.readouterr().err == (
        "warning: payload = 1600 kg: the machine is made for 1500 kg\n"
    )


def test_without_python_control_the_command_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert find_spec("control")
    monkeypatch.setattr(linearize_command, "find_spec", lambda _: None)
    assert main(["linearize", "--out", str(tmp_path)]) == 1
    assert "pip install 'emir_ros[design]'" in capsys.readouterr().err

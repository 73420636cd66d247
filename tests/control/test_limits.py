"""Limits and bad measurements, done to the nonlinear machine in the plain loop."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from emir_analysis.closed_loop import ClosedLoop
from emir_analysis.control_protocols import Signals, Stepping
from emir_analysis.machine_model import lqg_parameters
from emir_analysis.node_controls import (
    CascadeControl,
    LqgControl,
    PfcControl,
    PfcTipControl,
    situation,
)
from emir_common.quantity import ParameterError
from emir_control import pfc_file
from emir_control.limits import LimitParameters, off_the_ends
from emir_control.lqg import Lqg, LqgInputs
from emir_control.pfc import Pfc
from emir_control.pfc_file import STROKE, TIP_ANGLE
from emir_control.tip import Tip
from emir_control.trajectory import NO_MOVE, Reference, TrajectoryParameters, named
from emir_msgs_py.topics import CONTROL_PERIOD, CYLINDER_REFERENCE
from emir_plant import linkage
from emir_plant.plant import Plant
from emir_plant.sensors import Measurement
from emir_plant.sheet import joint1

LIMITS = LimitParameters()
HOLD = named("hold", TrajectoryParameters())
LOOPS: dict[str, Callable[[], Stepping]] = {
    "cascade": CascadeControl,
    "pfc": lambda: PfcControl(Pfc(pfc_file.load(pfc_file.default_file(STROKE), STROKE))),
    "pfc_tip": lambda: PfcTipControl(
        Tip(Pfc(pfc_file.load(pfc_file.default_file(TIP_ANGLE), TIP_ANGLE)))
    ),
}


@dataclass(frozen=True)
class Commanding:
    """An outer loop that follows nothing: its command by the number of the period."""

    command: Callable[[int], float]

    def step(self, state: Any, now: Signals, dt: float) -> tuple[Any, dict[str, float]]:
        """Return the command; see `Stepping`."""
        k = state or 0
        return k + 1, {"velocity_command": self.command(k)}


@dataclass(frozen=True)
class Blind:
    """Another outer loop, whose measurements are not a number for a while; notes its commands."""

    outer: Stepping
    periods: range

    def step(self, state: Any, now: Signals, dt: float) -> tuple[Any, dict[str, float]]:
        """Return what the other one makes of it; see `Stepping`."""
        k, inner = state or (0, None)
        if k in self.periods:
            now = now | dict.fromkeys(Measurement._fields, math.nan)
        inner, signals = self.outer.step(inner, now, dt)
        return (k + 1, inner), signals


@pytest.mark.parametrize(("degrees", "velocity"), [(70.0, 0.05), (20.0, -0.05)])
def test_towards_the_end_of_the_stroke_the_piston_comes_to_rest(
    degrees: float, velocity: float
) -> None:
    loop = ClosedLoop(Plant(joint1()), HOLD, Commanding(lambda _: velocity))
    run = loop.run(math.radians(degrees), 2e6, 16.0)
    end = LIMITS.stroke_high if velocity > 0.0 else LIMITS.stroke_low
    left = np.abs(end - run["true_stroke"])
    assert np.all((run["true_stroke"] > 0.0) & (run["true_stroke"] < LIMITS.stroke_high))
    assert left.min() > 0.2 * LIMITS.end_margin  # past upright, the boom's weight pulls it on
    assert left[-1] == pytest.approx(LIMITS.end_margin, abs=0.03)
    assert np.abs(run["true_velocity"]).max() > 0.03  # it came with speed
    assert np.abs(run["true_velocity"][-50:]).max() < 2e-3


def test_away_from_the_end_it_may_go_at_once() -> None:
    assert off_the_ends(-0.05, LIMITS.stroke_high, 0.0, LIMITS) == -0.05
    assert off_the_ends(0.05, LIMITS.stroke_high, 0.0, LIMITS) == 0.0
    assert off_the_ends(0.05, LIMITS.stroke_low, 0.0, LIMITS) == 0.05


def test_wild_commands_are_limited_in_size_and_change() -> None:
    noise = np.random.default_rng(4).normal(size=200)
    loop = ClosedLoop(Plant(joint1()), HOLD, Commanding(lambda k: float(noise[k])))
    run = loop.run(math.radians(45.0), 2e6, 3.2)
    allowed = run["wanted_velocity"] + run["force_feedback"]
    assert np.abs(allowed).max() <= LIMITS.speed * (1 + 1e-12)
    steps = np.diff(allowed, prepend=0.0)
    assert np.abs(steps).max() == pytest.approx(LIMITS.acceleration * CONTROL_PERIOD, rel=1e-9)
    assert np.abs(run["valve_command"]).max() <= 1.0


def test_a_controller_that_gives_no_number_shuts_the_valve_in_the_same_period() -> None:
    loop = ClosedLoop(Plant(joint1()), HOLD, Commanding(lambda k: 0.02 if k < 40 else math.nan))
    run = loop.run(math.radians(45.0), 2e6, 3.2)
    assert np.all(run["valve_command"][39:40] > 0.0)
    assert np.all(run["valve_command"][40:] == 0.0)
    swing = run["true_stroke"][
        round(1.3 / 0.008) :
    ]  # on the oil, which nothing damps with a shut valve
    assert np.ptp(swing) < 0.02
    assert np.polyfit(np.arange(swing.size) * 0.008, swing, 1)[0] == pytest.approx(0.0, abs=4e-3)


@pytest.mark.parametrize("name", LOOPS)
def test_a_measurement_that_is_no_number_stops_any_controller_and_it_recovers(name: str) -> None:
    trajectory = named("lift-lower", TrajectoryParameters())
    lost = range(60, 65)
    run = ClosedLoop(Plant(joint1()), trajectory, Blind(LOOPS[name](), lost)).run(
        math.radians(45.0), 2e6, 7.04
    )
    command = run["velocity_command"]
    assert np.all(command[60:65] == 0.0)
    assert command[59] > 0.01
    assert np.isfinite(command).all()
    assert run["true_stroke"][-1] == pytest.approx(run["reference_stroke"][-1], abs=4e-3)


@pytest.mark.parametrize("name", LOOPS)
@pytest.mark.parametrize("lost", ["stroke", "reference"])
def test_a_controller_begun_without_a_number_begins_with_the_first(name: str, lost: str) -> None:
    plant, outer = Plant(joint1()), LOOPS[name]()
    from emir_plant.sensors import measure

    state = plant.initial(math.radians(45.0), 2e6)
    reading = measure(plant, plant.outputs(state), 0, state)
    good = situation(Reference(reading.stroke, 0.0), (reading.stroke,) * 20, reading)
    bad = (
        good | dict.fromkeys(Measurement._fields, math.nan)
        if lost == "stroke"
        else good | dict.fromkeys(CYLINDER_REFERENCE.fields, math.nan)
    )
    control, signals = outer.step(None, bad, CONTROL_PERIOD)
    assert signals["velocity_command"] == 0.0
    for _ in range(3):
        control, signals = outer.step(control, good, CONTROL_PERIOD)
        assert signals["velocity_command"] == pytest.approx(0.0, abs=1e-9)


def test_the_limits_are_the_machines_stroke() -> None:
    p = Plant(joint1()).record[0]
    assert linkage.stroke(0.0, p) == LIMITS.stroke_low
    assert linkage.stroke(math.radians(85.0), p) < LIMITS.stroke_high - LIMITS.end_margin


def test_limits_that_leave_no_stroke_are_refused() -> None:
    with pytest.raises(ParameterError, match="leaves nothing above stroke_low"):
        LimitParameters(stroke_low=0.5, stroke_high=0.51)


@pytest.mark.parametrize(("degrees", "name"), [(74.0, "lift-lower"), (8.0, "lower-lift")])
def test_a_plan_that_would_end_at_the_end_of_the_stroke_ends_at_the_margin(
    degrees: float, name: str
) -> None:
    """LQG plans what is left of the move, says that it does, and comes back."""
    trajectory = named(name, TrajectoryParameters(distance=0.2, speed=0.03, pause=4.0))
    outer = LqgControl(Lqg(lqg_parameters(joint1())))
    run = ClosedLoop(Plant(joint1()), trajectory, outer).run(
        math.radians(degrees), 2e6, trajectory.duration
    )
    lifting = name == "lift-lower"
    line = LIMITS.stroke_high - LIMITS.end_margin if lifting else LIMITS.end_margin
    stroke, reference = run["true_stroke"], run["reference_stroke"]
    beyond = reference.max() - line if lifting else line - reference.min()
    assert beyond > 0.03
    assert (stroke.max() if lifting else stroke.min()) == pytest.approx(line, abs=5e-3)
    assert stroke[-1] == pytest.approx(stroke[0], abs=1e-2)
    limited = run["lqg_limited"]
    assert limited.max() == 1.0
    assert limited[:10].max() == 0.0


def test_lqg_is_held_off_the_end_whatever_it_wants() -> None:
    """Its force at rest says less than there is: it would drive the piston on."""
    law = Lqg(lqg_parameters(joint1()))
    plant = Plant(joint1())
    state = plant.initial(math.radians(85.0), 2e6)
    from emir_plant.sensors import measure

    reading = measure(plant, plant.outputs(state), 0, state)
    inputs = LqgInputs(reading.stroke, NO_MOVE, *reading[:1], *reading[2:4], reading.deflection)
    held = law.initial(inputs)
    angle = linkage.angle(LIMITS.stroke_high, plant.record[0])
    _, outputs = law.step(held, inputs._replace(reference=2.0, angle=angle), CONTROL_PERIOD)
    assert outputs.wanted <= 0.0

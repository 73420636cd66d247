"""From one outer loop to another on the nonlinear machine while it moves."""

import math
from dataclasses import dataclass
from itertools import permutations
from typing import Any

import numpy as np
import pytest

from emir_analysis.closed_loop import ClosedLoop
from emir_analysis.compare import dynamic_deflection
from emir_analysis.control_protocols import NodeControl, Switchable
from emir_analysis.machine_model import lqg_parameters
from emir_analysis.node_controls import CascadeControl, LqgControl, PfcControl, PfcTipControl
from emir_analysis.switching import Ready, Selector, Switch, SwitchedLoop
from emir_common.quantity import ParameterError
from emir_control import pfc_file
from emir_control.cascade import Cascade, CascadeParameters
from emir_control.lqg import Lqg
from emir_control.pfc import Pfc
from emir_control.pfc_file import STROKE, TIP_ANGLE
from emir_control.prefilter import PrefilterParameters, commanded_velocity
from emir_control.tip import Tip
from emir_control.trajectory import TrajectoryParameters, named
from emir_msgs_py.topics import TICKS
from emir_plant.plant import Plant
from emir_plant.sheet import joint1

SWITCH = 78  # control periods: 2.5 s, in the middle of the plateau
CONTROLS: dict[str, NodeControl] = {
    "cascade": CascadeControl(Cascade(CascadeParameters())),
    "pfc": PfcControl(Pfc(pfc_file.load(pfc_file.default_file(STROKE), STROKE))),
    "pfc_tip": PfcTipControl(Tip(Pfc(pfc_file.load(pfc_file.default_file(TIP_ANGLE), TIP_ANGLE)))),
}


@dataclass(frozen=True)
class Cold:
    """A controller that begins anew when it is chosen: what `Ready` is there against."""

    control: NodeControl

    def step(self, state: Any, signals: dict[str, float], dt: float) -> tuple[Any, Any]:
        """Return the next state and the outputs; see `NodeControl`."""
        return self.control.step(state, signals, dt)


def _run(first: str, then: str, *, cold: bool = False) -> dict[str, np.ndarray]:
    controls = {name: Cold(CONTROLS[name]) if cold else CONTROLS[name] for name in (first, then)}
    loop = SwitchedLoop(controls, (Switch(0.0, first), Switch(SWITCH * 0.032, then)))
    trajectory = named("lift-lower", TrajectoryParameters())
    return ClosedLoop(Plant(joint1()), trajectory, loop).run(math.pi / 4, 2e6, 9.024)


@pytest.mark.parametrize(("first", "then"), list(permutations(CONTROLS, 2)))
def test_switching_while_moving_is_bumpless(first: str, then: str) -> None:
    """The command goes on as if nothing was switched; a cold start lets it jump."""
    run, cold = _run(first, then), _run(first, then, cold=True)
    command, jump = run["velocity_command"], abs(np.diff(run["velocity_command"]))
    assert command[SWITCH - 1] > 0.015  # it moves
    assert np.all(run[f"{first}_active"][:SWITCH] == 1.0)
    assert np.all(run[f"{then}_active"][SWITCH:] == 1.0)
    assert command[SWITCH] == pytest.approx(command[SWITCH - 1], abs=1e-9)
    assert jump[SWITCH - 1 : SWITCH + 10].max() <= max(jump[30 : SWITCH - 1].max(), 0.003)
    if then != "cascade":  # whose start is the place where the machine is
        assert abs(np.diff(cold["velocity_command"]))[SWITCH - 1] > 0.015
    assert run["true_stroke"][-1] == pytest.approx(run["reference_stroke"][-1], abs=2e-3)


def test_a_controller_that_was_never_switched_does_what_it_does_alone() -> None:
    """Standing by does not change the one that drives, nor does being chosen from the start."""
    from emir_analysis.node_controls import PfcControl

    trajectory = named("lift-lower", TrajectoryParameters())
    loop = SwitchedLoop(CONTROLS, (Switch(0.0, "pfc"),))
    alone = PfcControl(CONTROLS["pfc"].pfc)  # type: ignore[attr-defined]
    runs = [
        ClosedLoop(Plant(joint1()), trajectory, outer).run(math.pi / 4, 2e6, 4.8)
        for outer in (loop, alone)
    ]
    assert np.array_equal(runs[0]["velocity_command"], runs[1]["velocity_command"])


def test_one_that_follows_its_twin_offers_what_the_twin_commands() -> None:
    """It sees all that the other does; taking over changes nothing then."""
    twin = CONTROLS["pfc"]
    assert isinstance(twin, Switchable)
    ready = Ready("pfc", twin)
    rng = np.random.default_rng(3)
    state = driving = None
    signals: dict[str, float] = {
        "stroke": 0.5,
        "force": 2e5,
        "reference_stroke": 0.5,
        "reference_velocity": 0.0,
    }
    signals |= {f"reference_stroke_{k}_ahead": 0.5 for k in range(1, 21)}
    fed_back: dict[str, float] = {}
    for _ in range(60):
        now = signals | {"stroke": 0.5 + 1e-3 * rng.normal()}
        driving, applied = twin.step(driving, now, 0.032)
        state, _ = ready.step(state, now | fed_back, 0.032)
        fed_back = {"applied_command": applied["velocity_command"], "pfc_active": 0.0}
    assert state is not None
    assert driving is not None
    applied_command = fed_back["applied_command"]
    followed = twin.follow(state.before, state.signals, applied_command, 0.032)
    assert followed.model == pytest.approx(driving.model, abs=1e-12)
    assert followed.errors == pytest.approx(driving.errors, abs=1e-12)


@pytest.mark.parametrize("name", CONTROLS)
def test_one_that_begins_anew_beside_one_that_drives_offers_its_command(name: str) -> None:
    """It was without inputs for a while, and may be chosen in its first period."""
    signals = {"stroke": 0.5, "angle": 0.8, "deflection": 0.01, "force": 2e5}
    signals |= {"reference_stroke": 0.52, "reference_velocity": 0.025}
    signals |= {f"reference_stroke_{k}_ahead": 0.52 + 8e-4 * k for k in range(1, 21)}
    signals |= {"applied_command": 0.021, f"{name}_active": 0.0}
    _, offered = Ready(name, CONTROLS[name]).step(None, signals, 0.032)
    assert offered[f"{name}_command"] == pytest.approx(0.021, abs=1e-9)


@pytest.mark.parametrize(
    ("controllers", "switches", "said"),
    [
        (("cascade", "magic"), ((0.0, "cascade"),), "controller 'magic': there are cascade, pfc"),
        (("cascade",), ((0.0, "pfc"),), "controller 'pfc': running are cascade"),
        (("cascade", "pfc"), ((1.0, "pfc"),), "have to rise from 0 s"),
        (("cascade", "pfc"), ((0.0, "pfc"), (math.nan, "cascade")), "have to rise from 0 s"),
        (("cascade", "pfc"), ((0.0, "pfc"), (math.inf, "cascade")), "have to rise from 0 s"),
        (("cascade", "pfc"), ((0.0, "pfc"), (2.0, "cascade"), (2.0, "pfc")), "have to rise"),
    ],
)
def test_a_plan_of_switching_that_cannot_be_is_refused(
    controllers: tuple[str, ...], switches: tuple[tuple[float, str], ...], said: str
) -> None:
    with pytest.raises(ParameterError, match=said):
        Selector(controllers, tuple(Switch(*switch) for switch in switches))


@pytest.fixture(scope="module")
def by_way_of_lqg() -> dict[str, np.ndarray]:
    """Cascade, LQG asked for near a move's end, PFC in the middle of LQG's own move."""
    lqg = LqgControl(Lqg(lqg_parameters(joint1())))
    controls = {"cascade": CONTROLS["cascade"], "lqg": lqg, "pfc": CONTROLS["pfc"]}
    back = 1.0 + 3.3 + 5.0  # s, when the way back begins
    switches = Switch(0.0, "cascade"), Switch(3.5, "lqg"), Switch(back + 1.6, "pfc")
    trajectory = named("lift-lower", TrajectoryParameters())
    loop = ClosedLoop(Plant(joint1()), trajectory, SwitchedLoop(controls, switches))
    return loop.run(math.pi / 4, 2e6, 17.6)


def test_lqg_takes_over_when_the_machine_rests(by_way_of_lqg: dict[str, np.ndarray]) -> None:
    run = by_way_of_lqg
    first = int(np.argmax(run["lqg_active"]))
    assert first * 0.032 > 4.3 + 1.0  # asked for at 3.5 s; the reference rests from 4.3 s on
    assert run["move_since"][first] < -1.0  # the next move is not near
    assert run["lqg_ready"][first] == 1.0
    assert run["valve_command"][first] == 0.0
    swing, tick = abs(dynamic_deflection(run)), first * TICKS
    assert swing[tick : tick + 200].max() < 1.2 * swing[tick - 125 : tick].max()  # 1.6 s, 1 s
    assert run["lqg_payload"][first] == pytest.approx(0.0, abs=30.0)


def test_lqg_hands_its_command_on_and_over_in_mid_move(
    by_way_of_lqg: dict[str, np.ndarray],
) -> None:
    """While it drives, the force loop neither damps nor limits; PFC goes on from its command."""
    run = by_way_of_lqg
    drives = run["lqg_active"] == 1.0
    assert np.all(run["force_feedback"][drives] == 0.0)
    p = PrefilterParameters()
    expected = [commanded_velocity(each, p) for each in run["valve_command"][drives]]
    assert run["lqg_command"][drives] == pytest.approx(expected, abs=1e-12)
    last = int(np.flatnonzero(drives)[-1])
    velocity, valve = run["velocity_command"], run["valve_command"]
    assert velocity[last] < -0.015  # it lowers
    assert run["pfc_active"][last + 1] == 1.0
    assert velocity[last + 1] == pytest.approx(velocity[last], abs=1e-9)
    assert valve[last + 1] == pytest.approx(valve[last], abs=0.04)
    assert run["true_stroke"][-1] == pytest.approx(run["reference_stroke"][-1], abs=3e-3)


@pytest.mark.parametrize("first", ["cascade", "pfc"])
def test_lqg_takes_over_in_mid_move(first: str) -> None:
    """It goes on with the flow that it has found, leads the move to its end, and calms the boom."""
    lqg = LqgControl(Lqg(lqg_parameters(joint1())))
    switches = Switch(0.0, first), Switch(SWITCH * 0.032, "lqg")
    loop = SwitchedLoop({first: CONTROLS[first], "lqg": lqg}, switches)
    trajectory = named("lift-lower", TrajectoryParameters())
    run = ClosedLoop(Plant(joint1()), trajectory, loop).run(math.pi / 4, 2e6, 9.024)
    assert np.all(run[f"{first}_active"][:SWITCH] == 1.0)
    assert np.all(run["lqg_active"][SWITCH:] == 1.0)
    valve = run["valve_command"]
    assert valve[SWITCH - 1] > 0.4  # it moves
    assert valve[SWITCH] == pytest.approx(valve[SWITCH - 1], abs=0.04)
    assert abs(np.diff(valve))[SWITCH - 1 : SWITCH + 3].max() < 0.08
    stop, swing = round(4.3 / 0.032) * TICKS, abs(dynamic_deflection(run))
    assert swing[SWITCH * TICKS :].max() < 0.02  # conventional control's own: 0.033
    assert swing[stop + 125 :].max() < 0.005
    assert run["true_stroke"][-1] == pytest.approx(run["reference_stroke"][-1], abs=1e-3)

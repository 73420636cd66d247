"""LQG and MPC on the machine: payload, filling, equality without limits, missing numbers."""

import math
from dataclasses import replace

import numpy as np
import pytest

from emir_analysis.closed_loop import ClosedLoop
from emir_analysis.compare import Run, dynamic_deflection
from emir_analysis.disturbance import LoadChange
from emir_analysis.limit import PAPER_MOVE, least
from emir_analysis.limit import Move as PaperMove
from emir_analysis.machine_model import actuator, lqg_parameters
from emir_analysis.node_controls import LqgControl
from emir_common.parameter_tree import with_values
from emir_common.quantity import ParameterError
from emir_control import mpc
from emir_control.lqg import Lqg, LqgInputs
from emir_control.mpc import Mpc
from emir_control.regulator import Regulator, RegulatorParameters, regulator
from emir_control.trajectory import Move, TrajectoryParameters, named
from emir_plant.parameters import Machine
from emir_plant.plant import Plant
from emir_plant.sheet import joint1

FORTY_FIVE = math.radians(45.0)


def _run(machine: Machine, law: Lqg, name: str, angle: float, delay: float, last: float) -> Run:
    trajectory = named(name, TrajectoryParameters(delay=delay, pause=8.0))
    return ClosedLoop(Plant(machine), trajectory, LqgControl(law)).run(angle, 2e6, last)


@pytest.mark.parametrize("payload", [0.0, 640.0, 1400.0])
def test_payload_is_read_from_the_force_at_rest(payload: float) -> None:
    machine = with_values(joint1(), {"geometry.payload": payload, "supply.p0": 3.2e7})
    law = Lqg(replace(lqg_parameters(joint1()), actuator=actuator(machine)))
    signals = _run(machine, law, "lift-lower", FORTY_FIVE, 1.5, 1.2)
    assert signals["lqg_payload"][-1] == pytest.approx(payload, abs=25.0)


def test_regulator_is_stable_for_softer_and_stiffer_oil() -> None:
    """Feedback and observer together, on a model whose oil is another than theirs."""
    for softness in (0.8, 1.0, 1.25):
        p = lqg_parameters(joint1())
        boom, drive = p.boom.loaded(500.0), Lqg(p).drive
        law = regulator(boom, drive, 0.5, p.period, p.regulator)
        other = replace(drive, softness=softness * drive.softness)
        real = regulator(boom, other, 0.5, p.period, replace(p.regulator, modes=5))
        assert _spectral_radius(law, real, other.stiffness(0.5) / drive.stiffness(0.5)) < 1.0


def _spectral_radius(law: Regulator, real: Regulator, stiffness: float) -> float:
    """Of machine (q, q', s, past u), estimate and the law's past commands; f, d are 0."""
    m, n, past = real.controlled, len(law.A), law.delays
    columns = []
    for unit in np.eye(m + past + n):
        x, u_past, estimate = np.split(unit, (m, m + past))
        measured = real.C[:, :m] @ x
        measured[2] *= stiffness
        estimate = estimate + law.moving.gain @ (measured - law.C @ estimate)
        u = law.command(estimate, u_past)
        given = np.append(u, u_past)
        ahead = real.A[:m, :m] @ x + real.B[:m] @ given
        columns.append(np.concatenate([ahead, given[:-1], law.A @ estimate + law.B @ given]))
    return float(max(abs(np.linalg.eigvals(np.array(columns).T))))


@pytest.mark.parametrize("stiffer", [0.9, 1.17])
def test_lowering_chamber_is_filled_where_the_block_is_shut(stiffer: float) -> None:
    """At 72 deg, empty, a block of 80 bar is shut; it is open when the move starts.

    Without friction the boom swings from the filling; the move takes that into account.
    """
    values = {"logic_block.threshold": 80e5, "supply.p0": 3.2e7}
    oil = {"cylinder.beta": stiffer * joint1().cylinder.beta}
    machine = with_values(joint1(), values | oil)
    known = actuator(with_values(joint1(), values))
    law = Lqg(replace(lqg_parameters(joint1()), actuator=known))
    signals = _run(machine, law, "lower-lift", math.radians(72.0), 8.0, 12.5)
    start = round(8.0 / 0.008)
    assert signals["logic_block"][0] == 0.0
    assert signals["logic_block"][start] > 0.95
    limit = least(machine, PaperMove(math.radians(72.0), -PAPER_MOVE.distance, 3.3))
    bending = abs(dynamic_deflection(signals))
    assert bending[:start].max() < 0.01
    assert bending[start:].max() < 1.35 * limit.largest
    error = signals["true_stroke"][-1] - signals["reference_stroke"][-1]
    assert abs(error) < 2e-3


@pytest.fixture
def inputs() -> LqgInputs:
    return LqgInputs(0.5, Move(-9.0, 3.3, 0.06), 0.7, 110e5, 20e5, -0.012)


def test_a_missing_number_shuts_the_valve_and_is_forgotten(inputs: LqgInputs) -> None:
    law = Lqg(lqg_parameters(joint1()))
    state = law.initial(inputs)
    for name in ("reference", "angle", "pressure_lifting", "pressure_lowering", "deflection"):
        after, outputs = law.step(state, inputs._replace(**{name: math.nan}), 0.032)
        assert outputs.valve_command == 0.0
        _, again = law.step(after, inputs, 0.032)
        assert math.isfinite(again.wanted)


def test_a_first_reading_that_is_no_number_shuts_the_valve_and_is_forgotten(
    inputs: LqgInputs,
) -> None:
    """Neither driving nor standing by begins with it."""
    control = LqgControl(Lqg(lqg_parameters(joint1())))
    move = inputs.move._asdict().items()
    read = {f"move_{name}": value for name, value in move}
    read |= {"reference_stroke": inputs.reference} | inputs._asdict()
    begun = control.step(None, read, 0.032)
    for name in ("reference_stroke", "pressure_lifting", "deflection"):
        missing = read | {name: math.nan}
        state, signals = control.step(None, missing, 0.032)
        assert signals["valve_command"] == 0.0
        assert control.step(state, read, 0.032)[1] == begun[1]
        state, signals = control.stand_by(None, missing)
        assert signals["lqg_ready"] == 0.0
        assert control.stand_by(state, read)[1] == control.stand_by(None, read)[1]


def test_mpc_without_its_solver_is_one_clear_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mpc, "find_spec", dict[str, None]().get)
    with pytest.raises(ParameterError, match=r"needs OSQP: pip install 'emir_ros\[mpc\]'"):
        Mpc(lqg_parameters(joint1()))


def test_mpc_is_the_lqg_where_no_limit_is_near() -> None:
    """With the LQG's cost to go at its end, the program's horizon makes no difference."""
    pytest.importorskip("osqp")
    law = _law()
    for count in (2, 20):
        free = np.full(count, 1e3)
        problem = mpc.Problem(law, count, RegulatorParameters().velocity_weight)
        for k in (0, law.modes, 2 * law.modes, law.controlled):
            off = np.zeros(len(law.extended))
            off[k] = 1e-3
            command = problem.solve(off, (-free, free), np.zeros(count), 1e3)
            assert command == pytest.approx(-float(law.feedback @ off), rel=0.02, abs=2e-5)


def test_mpc_keeps_to_what_the_drive_can_give() -> None:
    pytest.importorskip("osqp")
    law = _law()
    problem = mpc.Problem(law, 10, RegulatorParameters().velocity_weight)
    off = np.zeros(len(law.extended))
    off[2 * law.modes] = -3e-3  # short of 170 kN
    low, high = np.full(10, -0.01), np.full(10, 0.02)
    assert -float(law.feedback @ off) > 0.02
    assert problem.solve(off, (low, high), np.zeros(10), 1e3) == pytest.approx(0.02, rel=1e-2)


def _law() -> Regulator:
    p = lqg_parameters(joint1())
    return regulator(p.boom.loaded(300.0), Lqg(p).drive, 0.5, p.period, p.regulator)


@pytest.mark.parametrize(("before", "after"), [(0.0, 400.0), (400.0, 0.0)])
def test_a_load_that_comes_or_goes_in_a_move_is_noticed(before: float, after: float) -> None:
    """By the innovation; the piston ends nearer to its place than with a slow estimate."""
    machine = with_values(joint1(), {"supply.p0": 3.2e7, "geometry.payload": before})
    p = replace(lqg_parameters(joint1()), actuator=actuator(machine))
    moving = replace(p.regulator.moving, sudden_load=p.regulator.moving.load_drift)
    slow = replace(p, regulator=replace(p.regulator, moving=moving))
    trajectory = named("lift-lower", TrajectoryParameters(pause=20.0))
    off = []
    for parameters in (p, slow):
        loop = ClosedLoop(
            Plant(machine),
            trajectory,
            LqgControl(Lqg(parameters)),
            change=LoadChange(2.6, after),
        )
        signals = loop.run(math.radians(50.0), 2e6, 8.0)
        reached = signals["true_stroke"][-125:]
        off.append(abs(reached - signals["reference_stroke"][-1]).max())
    assert off[0] < 3e-3
    assert off[0] < 0.8 * off[1]

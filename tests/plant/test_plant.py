"""The integrated model against an independent solver, conservation of energy and the paper."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from emir_common.parameter_tree import with_values
from emir_common.quantity import ParameterError
from emir_plant import core, linkage
from emir_plant.core import Truth
from emir_plant.linearize import linearize
from emir_plant.parameters import cautions
from emir_plant.plant import Plant, SimulationError
from emir_plant.sheet import joint1

FORTY_FIVE = math.radians(45.0)
PLANT = Plant(joint1())
TRUTH = {name: i for i, name in enumerate(Truth._fields)}


def test_initial_state_is_at_rest() -> None:
    for degrees in (0.0, 30.0, 45.0, 75.0):
        state = PLANT.initial(math.radians(degrees), 20e5)
        rate = PLANT.derivative(state, 0.0)
        assert np.abs(rate[core.MODES :]).max() < 1e-9
        assert rate[core.TIME] == 1.0
        assert np.abs(np.delete(rate[: core.MODES], core.TIME)).max() < 1e-6


def test_coupled_mode_is_the_papers_0_7_hz_linearized() -> None:
    frequency, damping = linearize(PLANT, PLANT.initial(FORTY_FIVE, 20e5)).modes()
    assert frequency[0] == pytest.approx(0.7, abs=0.015)
    assert damping[0] < 0.01  # "hardly any damping"


def test_coupled_mode_is_the_papers_0_7_hz_in_free_response() -> None:
    state = PLANT.initial(FORTY_FIVE, 60e5)
    state[core.P_H] *= 1.02  # lets go from beside the equilibrium
    run = PLANT.simulate(state, np.zeros(6000), 1e-2)
    tip = run[:, TRUTH["tip_angle"]] - run[:, TRUTH["tip_angle"]].mean()
    spectrum = np.abs(np.fft.rfft(tip * np.hanning(tip.size)))
    assert np.fft.rfftfreq(tip.size, 1e-2)[spectrum.argmax()] == pytest.approx(0.7, abs=0.02)


def test_rigid_boom_with_payload_swings_on_the_oil_with_about_half_a_hertz() -> None:
    """Raised to 75 deg with 1500 kg; stiffness of the chambers and inertia worked out by hand."""
    angle = math.radians(75.0)
    machine = joint1()
    p, r = PLANT.record[0], linkage.lever_arm(angle, PLANT.record[0])
    h = linkage.stroke(angle, p)
    c = machine.cylinder
    oil = c.beta * (
        c.area_lifting**2 / (c.volume_lifting_0 + c.area_lifting * h)
        + c.area_lowering**2 / (c.volume_lowering_0 - c.area_lowering * h)
    )
    length = machine.geometry.boom_length
    inertia = (machine.geometry.boom_mass / 3.0 + 1500.0) * length**2
    by_hand = math.sqrt(oil * r * r / inertia) / (2.0 * math.pi)
    stiff = {"geometry.payload": 1500.0, "geometry.section_spring": 1e12}
    plant = Plant(with_values(machine, stiff))
    frequency, _ = linearize(plant, plant.initial(angle, 20e5)).modes()
    assert frequency[0] == pytest.approx(by_hand, rel=0.05)
    assert frequency[0] == pytest.approx(0.5, abs=0.05)


def _commands() -> np.ndarray:
    """Lift, rest, lower with an interruption, rest: 6 s in ms."""
    y = np.zeros(6000)
    y[200:2000], y[2600:3600], y[3900:4800] = 0.5, -0.6, -0.3
    return y


@pytest.mark.parametrize("lowering", [20e5, 2e5])
def test_pressures_agree_with_a_stiff_solver_to_1e_4(
    lowering: float, stiff_solver: Callable[..., np.ndarray]
) -> None:
    commands = _commands()
    start = PLANT.initial(FORTY_FIVE, lowering)
    ours = PLANT.simulate(start, commands, 1e-3)
    exact = stiff_solver(PLANT, start, commands, "Radau")
    for index, name in ((core.P_H, "pressure_lifting"), (core.P_S, "pressure_lowering")):
        difference = np.abs(ours[:, TRUTH[name]] - exact[:, index]).max()
        assert difference < 1e-4 * np.abs(exact[:, index]).max(), name


def test_energy_balances() -> None:
    """What the oil brings in is stored in oil, motion and bending, lifted or lost in the boom."""
    p, dt = PLANT.record[0], 1e-3
    modes = p["mode_joint"].size
    state, states, shown = PLANT.initial(FORTY_FIVE, 20e5), [], []
    for command in _commands():
        states.append(state)
        shown.append(PLANT.outputs(state))
        state, _ = PLANT.step(state, command, dt)
    x = np.array(states)
    t = {name: np.array([getattr(s, name) for s in shown]) for name in Truth._fields}
    q, rate = x[:, core.MODES : core.MODES + modes], x[:, core.MODES + modes :]

    def total(power: np.ndarray) -> np.ndarray:
        return np.concatenate(([0.0], np.cumsum(0.5 * (power[1:] + power[:-1])) * dt))

    volume_lifting = p["volume_lifting_0"] + p["area_lifting"] * t["stroke"]
    volume_lowering = p["volume_lowering_0"] - p["area_lowering"] * t["stroke"]
    p_lifting, p_lowering = t["pressure_lifting"], t["pressure_lowering"]
    supplied = total(p_lifting * t["flow_lifting"] + p_lowering * t["flow_lowering"])
    in_oil = total(
        p_lifting * volume_lifting / p["beta"] * np.gradient(p_lifting, dt)
        + p_lowering * volume_lowering / p["beta"] * np.gradient(p_lowering, dt)
    )
    in_motion = 0.5 * np.sum(rate**2, axis=1)
    in_bending = 0.5 * np.sum(p["mode_stiffness"] * q**2, axis=1)
    lifted = total(np.cos(t["angle"]) * (rate @ p["mode_weight"]))
    lost = total(np.sum(p["mode_damping"] * rate**2, axis=1))
    stored = in_oil + in_motion + in_bending
    residual = supplied - (stored - stored[0]) - lifted - lost
    assert np.abs(residual).max() < 2e-3 * np.ptp(supplied)


def test_closed_valve_holds_the_boom() -> None:
    run = PLANT.simulate(PLANT.initial(FORTY_FIVE, 20e5), np.full(10000, 0.09), 1e-3)
    assert np.ptp(run[:, TRUTH["stroke"]]) < 1e-9  # inside the dead zone


def test_lowering_stops_when_the_lifting_pressure_is_below_the_threshold() -> None:
    """The logic block: with little load on the piston no oil leaves the lifting chamber."""
    machine = with_values(joint1(), {"logic_block.threshold": 300e5})
    plant = Plant(machine)
    run = plant.simulate(plant.initial(FORTY_FIVE, 20e5), np.full(1000, -0.5), 1e-3)
    free = PLANT.simulate(PLANT.initial(FORTY_FIVE, 20e5), np.full(1000, -0.5), 1e-3)
    assert np.abs(run[:, TRUTH["flow_lifting"]]).max() == 0.0
    assert free[-1, TRUTH["flow_lifting"]] < -1e-4


def test_step_is_the_same_whether_called_once_or_in_a_sequence() -> None:
    start = PLANT.initial(FORTY_FIVE, 20e5)
    commands = np.array([0.4, 0.4, -0.2, 0.0])
    run = PLANT.simulate(start, commands, 8e-3)
    state = start
    for k, command in enumerate(commands):
        state, shown = PLANT.step(state, command, 8e-3)
        assert tuple(run[k + 1]) == shown


def test_what_cannot_be_simulated_is_said_in_one_line() -> None:
    with pytest.raises(SimulationError, match="not finite"):
        PLANT.step(PLANT.initial(FORTY_FIVE), math.nan, 1e-3)
    heavy = Plant(with_values(joint1(), {"geometry.payload": 3000.0, "supply.p0": 100e5}))
    with pytest.raises(SimulationError, match="bar to rest on"):
        heavy.initial(0.0)
    with pytest.raises(ParameterError, match=r"valve.dead_zone = 2: outside 0 ... 0.5"):
        with_values(joint1(), {"valve.dead_zone": 2.0})


@pytest.mark.parametrize("degrees", [-40.5, 140.5, 250.0, math.nan])
def test_a_posture_out_of_reach_is_told_in_one_line(degrees: float) -> None:
    with pytest.raises(SimulationError, match=r"^boom angle .* deg: outside the linkage's reach"):
        PLANT.initial(math.radians(degrees))


def test_reach_ends_at_a_dead_point_or_an_empty_chamber() -> None:
    low, high = linkage.reach(PLANT.record[0])
    for end in (low, high):
        p, stroke = PLANT.record[0], linkage.stroke(end, PLANT.record[0])
        left = (
            linkage.lever_arm(end, p),
            p["volume_lifting_0"] + p["area_lifting"] * stroke,
            p["volume_lowering_0"] - p["area_lowering"] * stroke,
        )
        assert min(abs(value) for value in left) < 1e-9
        assert min(left) > -1e-9


def test_more_than_the_rated_payload_is_allowed_with_a_warning() -> None:
    assert cautions(joint1()) == []
    assert cautions(with_values(joint1(), {"geometry.payload": 1500.0})) == []
    for path in ("geometry.payload", "effects.payload.mass"):
        heavy = with_values(joint1(), {path: 2000.0, "supply.p0": 320e5})
        (line,) = cautions(heavy)
        assert line == "warning: payload = 2000 kg: the machine is made for 1500 kg"
        Plant(heavy).initial(math.radians(70.0))


def test_the_linear_model_has_no_state_of_an_effect_that_is_off() -> None:
    state = PLANT.initial(FORTY_FIVE, 20e5)
    modes = 2 * PLANT.record[0]["mode_joint"].size
    hydraulics = [core.P_H, core.P_S, core.SPOOL, core.SPOOL_RATE, core.LOGIC]
    own = [*hydraulics, *range(core.MODES, core.MODES + modes)]
    for command in (0.0, 0.5):
        assert linearize(PLANT, state, command).states.tolist() == own
    droop = {"effects.supply_pressure_droop.resistance": 1e9, "supply.p0": 95e5}
    drooping = Plant(with_values(joint1(), droop))
    start = drooping.initial(math.radians(60.0), 20e5)
    start[core.SPOOL] = 0.9
    assert core.DROOP in linearize(drooping, start).states

"""Numbers 1-13 of the paper: the machine, its valve and its sensors."""

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from emir_analysis.figure_flow import NORMAL, SUPPLIES, flow_curves
from emir_analysis.figure_steps import (
    ANGLES,
    BALANCE_IN_INLET,
    BLOCK_OPEN,
    FULL_SUPPLY,
    LIFTING,
    LOWERING,
    NAMES,
    NARROW_RETURN,
    STANDARD,
    Response,
    StepResponses,
    Without,
)
from emir_analysis.paper_number import Number, is_about, judged
from emir_common.parameter_tree import with_values
from emir_msgs_py.topics import CONTROL_PERIOD
from emir_plant import core, linkage
from emir_plant.boom import section_model
from emir_plant.core import Truth
from emir_plant.linearize import linearize
from emir_plant.parameters import Machine
from emir_plant.plant import REST_PRESSURE, Plant, SimulationError
from emir_plant.sensors import resolver
from emir_plant.transfer import mechanics

BAR = 1e5
FORTY_FIVE, SEVENTY_FIVE = math.radians(45.0), math.radians(75.0)
PAYLOAD = 1500.0  # kg, paper 1
STRONGEST = 320e5  # Pa, paper 2.2: the pump's highest pressure
RIGID = {"geometry.section_spring": 1e12}  # N m/rad, as stiff as the range allows
WEAK = 0.2  # damping, below which a response swings through several times
LINEAR = 0.05  # share, within which a curve is almost a straight line
WHOLE = 0.9  # share of its mean below which a flow counts as interrupted
APART = 0.05  # share, from which on two frequencies differ
FULL_STROKE = np.arange(10.0, 50.0, 2.0)  # Hz, at which the spool is driven
SWEEP_TICK = 2.5e-4  # s


def measure(machine: Machine, steps: StepResponses) -> list[Number]:
    """Return the numbers of a machine. Raises SimulationError where it cannot hold its boom."""
    return [
        _reach(machine),
        _orders(machine),
        _bending_mode(machine),
        _sag(machine),
        _rigid_on_oil(machine),
        _dominant_mode(machine),
        _dead_zone(machine),
        _bandwidth(machine),
        _linearity(machine),
        _logic_block(machine),
        *_steps(steps),
        _resolver(machine),
        Number(13, "sampling", "32 ms", f"{CONTROL_PERIOD * 1e3:g} ms",
               "period of the control loop", judged(math.isclose(CONTROL_PERIOD, 0.032))),
    ]  # fmt: skip


def _reach(machine: Machine) -> Number:
    reach = float(section_model(machine.geometry).tip.sum())
    loaded = with_values(machine, {"geometry.payload": PAYLOAD, "supply.p0": STRONGEST})
    try:
        state = Plant(loaded).initial(0.0)
    except SimulationError as error:
        return Number(1, "reach, payload", "22.5 m, up to 1500 kg", f"{reach:.1f} m",
                      "horizontal, held at 320 bar", judged(False), str(error))  # fmt: skip
    return Number(
        1, "reach, payload", "22.5 m, up to 1500 kg",
        f"{reach:.1f} m; {PAYLOAD:g} kg held with p_H = {state[core.P_H] / BAR:.0f} bar",
        "joint 1 to TCP; at rest, boom horizontal, pump 320 bar",
        judged(is_about(reach, 22.5, 0.1)),
    )  # fmt: skip


def _orders(machine: Machine) -> Number:
    found = mechanics(Plant(machine), FORTY_FIVE)
    functions = found.stroke(), found.joint_angle(), found.tip_angle()
    orders = {(f.numerator.size - 1, f.denominator.size - 1) for f in functions}
    return Number(
        3, "G_h, G_alpha1, G_alpha6", "numerator 8, denominator 10",
        "; ".join(f"numerator {n}, denominator {d}" for n, d in orders),
        "degrees of the polynomials at 45 deg", judged(orders == {(8, 10)}),
    )  # fmt: skip


def _bending_mode(machine: Machine) -> Number:
    poles = np.linalg.eigvals(mechanics(Plant(machine), FORTY_FIVE).state_space()[0])
    poles = poles[poles.imag > 1.0]
    slowest = poles[abs(poles).argmin()]
    frequency, damping = abs(slowest) / (2.0 * math.pi), -slowest.real / abs(slowest)
    return Number(
        4, "slowest mode of the mechanics", "about 5.4 Hz, weakly damped",
        f"{frequency:.2f} Hz, damping {damping:.3f}", "pole, 45 deg, piston force held",
        judged(is_about(frequency, 5.4, 0.1) and damping < WEAK),
    )  # fmt: skip


def _sag(machine: Machine) -> Number:
    plant = Plant(machine)
    sag = -plant.outputs(plant.initial(FORTY_FIVE)).tcp_deflection
    return Number(5, "static deflection of the TCP", "about 18 cm", f"{sag * 1e2:.1f} cm",
                  "at rest, 45 deg, empty, off the line of the first section",
                  judged(is_about(sag, 0.18, 0.01)))  # fmt: skip


def _rigid_on_oil(machine: Machine) -> Number:
    loaded = Plant(with_values(machine, RIGID | {"geometry.payload": PAYLOAD}))
    empty = Plant(with_values(machine, RIGID))
    ours, other = _slowest(loaded, SEVENTY_FIVE), _slowest(empty, FORTY_FIVE)
    return Number(
        6, "rigid mechanics on the oil", "about 0.5 Hz", f"{ours:.2f} Hz",
        "linearized at rest, section springs 1e12 N m/rad, 75 deg, 1500 kg",
        judged(is_about(ours, 0.5, 0.1)),
        f"posture and load are not stated; at 45 deg and empty {other:.2f} Hz",
    )  # fmt: skip


def _dominant_mode(machine: Machine) -> Number:
    ours = _slowest(Plant(machine), FORTY_FIVE)
    return Number(
        7, "dominant mode", "about 0.7 Hz", f"{ours:.2f} Hz", "linearized at rest, 45 deg, empty",
        judged(is_about(ours, 0.7, 0.1)),
    )  # fmt: skip


def _slowest(plant: Plant, angle: float) -> float:
    frequency, _ = linearize(plant, plant.initial(angle, REST_PRESSURE)).modes()
    return float(frequency[0])


def _dead_zone(machine: Machine) -> Number:
    plant = Plant(machine)
    state = plant.initial(FORTY_FIVE, REST_PRESSURE)

    def flows(spool: float) -> bool:
        x = state.copy()
        x[core.SPOOL] = spool
        shown = plant.outputs(x)
        return shown.flow_lifting != 0.0 or shown.flow_lowering != 0.0

    shut = [y for y in np.linspace(-0.5, 0.5, 1001) if not flows(float(y))]
    return Number(
        8, "valve: dead zone", "+-10 %", f"{min(shut):+.1%} to {max(shut):+.1%}",
        "positions of the spool in steps of 0.1 % at which no oil flows",
        judged(is_about(-min(shut), 0.1, 0.01) and is_about(max(shut), 0.1, 0.01)),
    )  # fmt: skip


def _bandwidth(machine: Machine) -> Number:
    plant = Plant(machine)
    answer = np.array([_spool_answer(plant, float(f)) for f in FULL_STROKE])
    quarter = float(np.interp(0.5 * math.pi, -np.unwrap(np.angle(answer)), FULL_STROKE))
    power = float(np.interp(-math.sqrt(0.5), -abs(answer), FULL_STROKE))
    return Number(
        8, "valve: bandwidth", "about 30 Hz at +-100 %", f"{quarter:.1f} Hz (-90 deg), {power:.1f}"
        " Hz (-3 dB)", "spool against y2 = sin(2 pi f t), full stroke, simulated",
        judged(is_about(quarter, 30.0, 10.0) and is_about(power, 30.0, 10.0)),
        "a linear spool: as slow at small strokes as in the paper's slowest case",
    )  # fmt: skip


def _spool_answer(plant: Plant, frequency: float) -> complex:
    """Return the spool's first harmonic over the command's of amplitude 1, once it repeats."""
    turns, per_turn = 10, round(1.0 / (frequency * SWEEP_TICK))
    tick = 1.0 / (frequency * per_turn)
    phase = 2.0 * math.pi * np.arange(turns * per_turn) / per_turn
    held = np.sin(phase + math.pi / per_turn)  # each value stands for the middle of its tick
    run = plant.simulate(plant.initial(FORTY_FIVE, REST_PRESSURE), held, tick)
    spool = run[:-1, Truth._fields.index("spool")][-per_turn:]
    return complex(2j * np.mean(spool * np.exp(-1j * phase[-per_turn:])))


def _linearity(machine: Machine) -> Number:
    said, met = [], False
    for curve in flow_curves(machine):
        stuck = [s for s in SUPPLIES if s >= NORMAL and math.isnan(curve.nonlinearity(s))]
        if stuck:
            said.append(f"{curve.load}: nothing flows at {', '.join(f'{s:g}' for s in stuck)} bar")
            continue
        met = met or max(curve.worst(), curve.spread()) <= LINEAR
        said.append(f"{curve.load}: off a line {curve.worst():.1%}, apart {curve.spread():.1%}")
    return Number(
        9, "Q(p0, y2)", "almost linear in y2 for 100-320 bar", "; ".join(said),
        "largest distance from the best line, and of the supplies' curves, of the largest flow",
        judged(met), "where the load leaves pressure for the valve, by the ideal pressure balance",
    )  # fmt: skip


def _logic_block(machine: Machine) -> Number:
    plant = Plant(machine)

    def time_constant(opening: float, pressure: float, towards: float) -> float:
        x = plant.initial(FORTY_FIVE, REST_PRESSURE)
        x[core.LOGIC], x[core.P_H], x[core.P_S] = opening, pressure, pressure
        return float((towards - opening) / plant.derivative(x, 0.0)[core.LOGIC])

    threshold = machine.logic_block.threshold
    opening = time_constant(0.0, 1.01 * threshold, 1.0)
    closing = time_constant(1.0, 0.99 * threshold, 0.0)
    return Number(
        10, "logic block", "opens very fast, closes with about 0.3 s, threshold",
        f"{opening * 1e3:.0f} ms, {closing:.2f} s, {threshold / BAR:.0f} bar",
        "rate of the block 1 % above and below the threshold; the pilot chamber is a parameter",
        judged(is_about(closing, 0.3, 0.1) and opening < 0.1 * closing),
    )  # fmt: skip


def _steps(steps: StepResponses) -> Iterator[Number]:
    here, elsewhere = ANGLES[0], ANGLES[1:]
    lifting, lowering = steps.of(here, LIFTING), steps.of(here, LOWERING)
    most = max(r.mode.damping for r in lifting + lowering)
    yield Number(
        11, "step responses: weakly damped", "weakly damped", f"damping up to {most:.3f}",
        f"fit to the tip's angular velocity from {here:g} deg, below {WEAK:g}; valve with even"
        " edges", judged(most < WEAK),
    )  # fmt: skip
    yield _falling(steps, lifting, NARROW_RETURN)
    yield _falling(steps, lowering, BALANCE_IN_INLET)
    yield _interrupted(steps, lowering)
    pair = [steps.of(angle, LIFTING)[0].mode for angle in (here, *elsewhere)]
    differ = all(abs(p.frequency / pair[0].frequency - 1.0) > APART for p in pair[1:])
    yield Number(
        11, "step responses: posture", "differ with it",
        "; ".join(f"{a:g} deg {m.frequency:.2f} Hz, {m.damping:.3f}"
                  for a, m in zip(ANGLES, pair, strict=True)),
        "smallest step, lifting; frequencies more than 5 % apart", judged(differ),
    )  # fmt: skip


def _falling(steps: StepResponses, responses: list[Response], lacking: Without) -> Number:
    direction = NAMES[responses[0].direction]
    falls = all(b.mode.damping < a.mode.damping for a, b in pairwise(responses))
    sizes = ", ".join(f"{r.size:g}" for r in responses)
    standard = steps.of(ANGLES[0], lacking.direction, STANDARD)
    return Number(
        11, f"step responses: damping, {direction}", "falls with the step", _dampings(responses),
        f"as above, y2 = {sizes}; linearized in the same motion"
        f" {', '.join(f'{r.linear:.3f}' for r in responses)}", judged(falls),
        "the open side's chamber leaks its swinging through an edge that is wide already at small"
        f" steps; {lacking.what}: {_dampings(steps.of(ANGLES[0], lacking.direction, lacking.name))}"
        f"; the standard machine: {_dampings(standard)}",
    )  # fmt: skip


def _interrupted(steps: StepResponses, lowering: list[Response]) -> Number:
    def said(responses: list[Response]) -> str:
        return ", ".join(f"{r.interruptions}" for r in responses)

    least, opened = lowering[-1], steps.of(ANGLES[0], LOWERING, BLOCK_OPEN.name)
    met = least.interruptions > 1 and least.least_flow < WHOLE and not opened[-1].interruptions
    return Number(
        11, "step responses: lowering interrupted", "cyclically, by the logic block",
        f"closes {said(lowering)} times; Q_H down to {least.least_flow:.0%} of its mean at full"
        f" step, lifting {steps.of(ANGLES[0], LIFTING)[-1].least_flow:.0%}",
        "logic block and flow in the same steps", judged(met),
        f"p_H swings down to {least.lowest / BAR:.0f} bar; with the block always open Q_H keeps"
        f" {opened[-1].least_flow:.0%}; with full pressure fed in it closes"
        f" {said(steps.of(ANGLES[0], LOWERING, FULL_SUPPLY.name))} times",
    )  # fmt: skip


def _dampings(responses: list[Response]) -> str:
    return ", ".join(f"{r.mode.damping:.3f}" for r in responses)


def _resolver(machine: Machine) -> Number:
    angles = FORTY_FIVE + np.linspace(0.0, 0.02, 2001)
    shown = np.unique([resolver(float(a), machine.sensors.resolver_step) for a in angles])
    step = float(np.diff(shown).min())
    arm = float(linkage.lever_arm(FORTY_FIVE, Plant(machine).record[0]))
    bits, tcp = math.log2(2.0 * math.pi / step), step * machine.geometry.boom_length
    return Number(
        12, "position resolver", "12 bit",
        f"{bits:.2f} bit of a turn: {tcp * 1e3:.1f} mm at the TCP, {step * arm * 1e3:.2f} mm"
        " of stroke", "steps of its reading about 45 deg", judged(math.isclose(bits, 12.0)),
    )  # fmt: skip

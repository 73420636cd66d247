"""Two ways to damp the machine (paper 3.1): a capillary line between the chambers, force feedback.

The line is the effect `internal_leakage`, chosen large enough to damp.
"""

import math
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from emir_analysis.design_pfc import DAMPED, OperatingPoint, steady_motion, velocity_model
from emir_analysis.report import new_figure
from emir_common.parameter_tree import with_values
from emir_control.force_loop import ForceLoop, ForceLoopInputs, ForceLoopParameters
from emir_msgs_py.topics import CONTROL_PERIOD
from emir_plant.parameters import Machine
from emir_plant.plant import REST_PRESSURE, Plant

Array = NDArray[np.float64]

SLOW = 2.0  # Hz, above the oil spring's mode and below the first bending mode
STANDSTILL = 10.0  # s
SWING, LIFTED = 8.0, 0.7  # s
LIFTING = OperatingPoint(velocity=0.025)
LITRES_PER_MINUTE = 6e4  # of 1 m^3/s

LEAKAGE = "effects.internal_leakage.coefficient"
UNDAMPED = ForceLoopParameters(gain=0.0)
WAYS = {
    "neither": (0.0, UNDAMPED),
    "capillary line, 2e-11 m^3/(s Pa)": (2e-11, UNDAMPED),
    "capillary line, 5e-11 m^3/(s Pa)": (5e-11, UNDAMPED),
    "capillary line, 1e-10 m^3/(s Pa)": (1e-10, UNDAMPED),
    "force feedback": (0.0, DAMPED),
}


@dataclass(frozen=True)
class DampingFigures:
    """What a way of damping gives and costs, at 45 deg, empty.

    damping: of critical, of the slow mode while lifting with 25 mm/s. sinking: m, of the TCP in
    10 s with the valve shut. at_rest: m^3/s through the line before it sinks. lifting: oil from
    the pump beyond what the piston displaces, as a share of that.
    """

    damping: float
    sinking: float
    at_rest: float
    lifting: float


def damping_figures(
    machine: Machine, leakage: float, force_loop: ForceLoopParameters
) -> DampingFigures:
    """Return the figures of a machine with a line of that coefficient, m^3/(s Pa), and loop."""
    machine = with_values(machine, {LEAKAGE: leakage})
    plant = Plant(machine)
    rest = plant.initial(LIFTING.angle, REST_PRESSURE)
    shown = plant.outputs(rest)
    later = plant.simulate(rest, np.zeros(2), STANDSTILL / 2.0, 2)[-1]
    moving = plant.outputs(steady_motion(plant, LIFTING)[0])
    displaced = machine.cylinder.area_lifting * moving.velocity
    return DampingFigures(
        damping=_slow_mode(machine, force_loop),
        sinking=machine.geometry.boom_length * float(shown.angle - later[0]),
        at_rest=leakage * (shown.pressure_lifting - shown.pressure_lowering),
        lifting=moving.flow_lifting / displaced - 1.0,
    )


def _slow_mode(machine: Machine, force_loop: ForceLoopParameters) -> float:
    """Return the least damping, of critical, of the oscillations below SLOW; 1 without any."""
    model = velocity_model(machine, LIFTING, "stroke", force_loop)
    poles = np.log(np.linalg.eigvals(model.A).astype(complex)) / model.period
    slow = [s for s in poles if s.imag > 0.0 and abs(s) < 2.0 * math.pi * SLOW]
    return min((float(-s.real / abs(s)) for s in slow), default=1.0)


def swing(machine: Machine, leakage: float, force_loop: ForceLoopParameters) -> Array:
    """Return the piston velocity, m/s, every control period: lift for 0.7 s, then stop."""
    plant, loop = Plant(with_values(machine, {LEAKAGE: leakage})), ForceLoop(force_loop)
    state = plant.initial(LIFTING.angle, REST_PRESSURE)
    shown, control, velocity = plant.outputs(state), None, []
    for time in np.arange(0.0, SWING, CONTROL_PERIOD):
        wanted = LIFTING.velocity if time < LIFTED else 0.0
        sensed = ForceLoopInputs(
            wanted, 0.0, shown.angle, shown.pressure_lifting, shown.pressure_lowering
        )
        control, out = loop.step(control or loop.initial(sensed), sensed, CONTROL_PERIOD)
        state, shown = plant.step(state, out.valve_command, CONTROL_PERIOD)
        velocity.append(shown.velocity)
    return np.array(velocity)


def picture(machine: Machine) -> Figure:
    """Return swing after a stop, sinking with the valve shut, and oil used, of all ways."""
    figure = new_figure(8.0)
    velocity, height, oil = figure.subplots(3, 1, height_ratios=(3, 2, 2))
    for k, (name, (leakage, force_loop)) in enumerate(WAYS.items()):
        found = swing(machine, leakage, force_loop)
        velocity.plot(np.arange(found.size) * CONTROL_PERIOD, found * 1e3, label=name, lw=1.2)
        plant = Plant(with_values(machine, {LEAKAGE: leakage}))
        rest = plant.initial(LIFTING.angle, REST_PRESSURE)
        angle = plant.simulate(rest, np.zeros(100), STANDSTILL / 100.0)[:, 0]
        drop = machine.geometry.boom_length * (angle - angle[0])
        height.plot(np.linspace(0.0, STANDSTILL, drop.size), drop * 1e2, lw=1.2)
        at_rest = damping_figures(machine, leakage, force_loop).at_rest
        oil.bar(k, at_rest * LITRES_PER_MINUTE)
    velocity.set(xlabel="time / s", ylabel="piston velocity / mm/s", title="lifted, then stopped")
    figure.legend(loc="outside upper center", ncols=3, frameon=False, fontsize="small")
    height.set(xlabel="time / s", ylabel="TCP / cm", title="valve shut")
    oil.set(ylabel="oil / l/min", title="through the line at rest", xticks=[])
    return figure


def as_text(machine: Machine) -> str:
    """Return the figures of all ways as a table, in the form of Markdown."""
    lines = [
        "| damped by | damping | TCP sinks in 10 s / cm | oil at rest / l/min | more oil lifting |",
        "| --- | ---: | ---: | ---: | ---: |",
    ]
    for name, (leakage, force_loop) in WAYS.items():
        f = damping_figures(machine, leakage, force_loop)
        lines.append(
            f"| {name} | {f.damping:.3f} | {f.sinking * 100.0:.1f}"
            f" | {f.at_rest * LITRES_PER_MINUTE:.1f} | {f.lifting * 100.0:.0f} % |"
        )
    return "\n".join(lines)

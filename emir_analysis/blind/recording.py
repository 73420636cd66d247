"""Runs of a machine and their recordings: sensors with noise and quantisation, MCAP files."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from emir_analysis.blind.machine import Array, Machine
from emir_analysis.blind.mcap_file import Sampled, write_signals
from emir_analysis.blind.numbers import Numbers
from emir_analysis.blind.operator import RANGE, Operator

Command = Callable[[float, Array], float]  # time, s, and state -> y2

SEEN_IN = {  # signals of the signal map in which one of a run is seen
    "angle": {"joint_angle", "piston_stroke"},
    "pressure_lifting": {"pressure_lifting"},
    "pressure_lowering": {"pressure_lowering"},
    "deflection": {"tip_deflection_angle"},
}


@dataclass(frozen=True)
class Run:
    """What was commanded and what the sensors show of it, without noise and quantisation.

    commands: (k,) one every command period. shown: (n,) of each sensor, one every sample.
    """

    commands: Array
    shown: dict[str, Array]


@dataclass(frozen=True)
class Start:
    """Where a run starts, at rest: boom angle, rad, and p_S, Pa."""

    angle: float
    p_s: float


def operated(machine: Machine, start: Start, operator: Operator, duration: float) -> Run:
    """Run a machine under an operator, who sees the stroke that the sensors show."""

    def command(time: float, state: Array) -> float:
        shown = machine.signals(state[None])["angle"][0]
        return operator.command(time, float(machine.stated_stroke(shown)))

    return _run(machine, start, command, duration)


def repeated(machine: Machine, start: Start, commands: Array) -> Run:
    """Run a machine under commands given before."""
    return _run(
        machine,
        start,
        lambda time, _: float(commands[round(time / machine.n.command_period)]),
        commands.size * machine.n.command_period,
    )


def _run(machine: Machine, start: Start, command: Command, duration: float) -> Run:
    held, sample = machine.n.command_period, 1.0 / machine.n.rate
    count = round(duration / held)
    samples = np.arange(int(count * held / sample)) * sample
    late = machine.delay()
    x = machine.start(start.angle, start.p_s)
    commands = np.zeros(count)
    states = np.empty((samples.size, x.size))
    for k in range(count):
        commands[k] = command(k * held, x)
        for a, b, acting in _pieces(commands, k, held, late):
            inside = (samples >= a - 1e-9) & (samples < b - 1e-9)
            times = np.unique(np.concatenate([[a], np.maximum(samples[inside], a), [b]]))
            found = machine.run(x, times, acting)
            states[inside] = found[np.searchsorted(times, np.maximum(samples[inside], a))]
            x = found[-1]
    return Run(commands, machine.signals(states))


def _pieces(
    commands: Array, k: int, held: float, late: float
) -> Iterator[tuple[float, float, float]]:
    """Yield the parts of a command period over which the command at the valve stays the same."""
    begin, end = k * held, (k + 1) * held
    whole = int(late / held)
    change = begin + late - whole * held
    older = commands[k - whole - 1] if k > whole else 0.0
    newer = commands[k - whole] if k >= whole else 0.0
    if change > begin + 1e-9:
        yield begin, change, float(older)
    yield max(begin, change), end, float(newer)


def spread_of_strokes(stated: Numbers) -> tuple[float, float]:
    """Return the strokes, m, between which an operator moves."""
    plain = Machine(stated)
    return float(plain.stated_stroke(RANGE[0])), float(plain.stated_stroke(RANGE[1]))


def write(path: Path, run: Run, machine: Machine, random: np.random.Generator) -> None:
    """Write a run as its sensors measure it, to one .mcap file."""
    n = machine.n
    size = run.shown["angle"].size
    sample, step = 1.0 / n.rate, n.resolver_span / 2**n.resolver_bits
    angle = np.round(run.shown["angle"] / step) * step
    pressure_noise = n.pressure_noise * random.standard_normal((2, size))
    gauge_noise = n.deflection_noise * random.standard_normal(size)
    write_signals(
        path,
        {
            "/joint_states": Sampled(sample, angle),
            "/cylinder": Sampled(sample, machine.stated_stroke(angle)),
            "/pressure_lifting": Sampled(sample, run.shown["pressure_lifting"] + pressure_noise[0]),
            "/pressure_lowering": Sampled(
                sample, run.shown["pressure_lowering"] + pressure_noise[1]
            ),
            "/boom_deflection": Sampled(sample, run.shown["deflection"] + gauge_noise),
            "/valve_command": Sampled(n.command_period, run.commands),
        },
    )

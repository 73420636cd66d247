"""Speed of joint 1's model at a relative error of 1e-4, beside LSODA and plain C.

Each contender takes the largest step, or the loosest tolerance, at which angle, tip angle,
pressures and spool stay within ERROR of their range over a run of lifting and lowering; the
reference is Runge-Kutta 4 at 10 us, which LSODA at its tightest confirms.
"""

import ctypes
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import odeint

from emir_analysis.bench.timing import Contender, Figure, durations, rates
from emir_common.parameter_tree import with_values
from emir_plant import core, integration, lanes
from emir_plant.core import LOGIC, MODES, P_H, P_S, SPOOL, Truth
from emir_plant.jit import compiled
from emir_plant.plant import REST_PRESSURE, Plant
from emir_plant.sheet import joint1

Array = NDArray[np.float64]
Run = Callable[[], Array]

ERROR = 1e-4
SAMPLE = 0.02  # s
PIECES = ((0.0, 0.2), (0.6, 1.0), (0.0, 1.0), (-0.6, 1.0), (0.0, 1.0), (0.15, 0.8))  # y2, s
AFFECTED = {"effects.external_load.mean": 500.0, "effects.internal_leakage.coefficient": 1e-12}
REFERENCE_STEP = 1e-5  # s
STEPS = tuple(SAMPLE / n for n in (3, 4, 5, 6, 8, 10, 20, 40, 80))  # s, of Runge-Kutta
TOLERANCES = tuple(10.0**-n for n in np.arange(2.0, 9.5, 0.5))  # relative, of LSODA
HYDRAULIC = LOGIC + 1  # states in front of those that only effects use
COLUMNS = [
    Truth._fields.index(name)
    for name in ("angle", "tip_angle", "pressure_lifting", "pressure_lowering", "spool")
]
C_FIELDS = (  # as in joint.c
    "area_lifting", "area_lowering", "volume_lifting_0", "volume_lowering_0", "beta",
    "relief_pressure", "relief_slope", "p0", "pT", "flow_nominal", "flow_ratio_lowering",
    "natural_frequency", "balance_pressure", "dead_zone", "damping", "k_pump_line", "k_block_in",
    "k_return_line", "k_block_out", "k_meter_out_lifting", "k_meter_out_lowering", "threshold",
    "time_constant_opening", "time_constant_closing", "pilot", "triangle_a", "triangle_b",
    "triangle_gamma0", "mode_joint", "mode_weight", "mode_stiffness", "mode_damping",
)  # fmt: skip


@compiled
def small_derivative(x: Array, command: float, parameters: NDArray[Any]) -> Array:
    """Return dx/dt, (15,), of the states that are left with every effect off."""
    full = np.zeros(x.size - HYDRAULIC + MODES)
    full[:HYDRAULIC], full[MODES:] = x[:HYDRAULIC], x[HYDRAULIC:]
    rate = core.derivative(full, command, parameters)
    return np.concatenate((rate[:HYDRAULIC], rate[MODES:]))


@dataclass(frozen=True)
class Task:
    """The run that everyone has to do: valve steps from rest at 45 deg, 5 s."""

    plant: Plant

    @cached_property
    def start(self) -> Array:
        """The state at the start."""
        return self.plant.initial(np.pi / 4, REST_PRESSURE)

    @cached_property
    def small_start(self) -> Array:
        """The same without the states that only effects use, (15,)."""
        return np.concatenate((self.start[:HYDRAULIC], self.start[MODES:]))

    @cached_property
    def commands(self) -> Array:
        """The command of every sample, (k,)."""
        return np.concatenate([np.full(round(s / SAMPLE), y2) for y2, s in PIECES])

    @property
    def duration(self) -> float:
        """Simulated time, s."""
        return self.commands.size * SAMPLE

    def ours(self, step: float) -> Array:
        """Return what the compiled core gives, (k + 1, 5)."""
        return self._ours(step)[:, COLUMNS]

    def _ours(self, step: float) -> Array:
        return integration.simulate(self.start, self.commands, SAMPLE, 1, self.plant.record, step)

    def lsoda(self, tolerance: float) -> Array:
        """Return what scipy's LSODA gives on the same right-hand side, (k + 1, 5)."""
        p, x = self.plant.record, self.small_start
        magnitude = np.ones_like(x)
        magnitude[[P_H, P_S]] = 1e7  # Pa; all else is of the order of one
        found = [x[None, :]]
        for command, seconds in PIECES:
            times = np.arange(round(seconds / SAMPLE) + 1) * SAMPLE

            def rate(x: Array, _time: float, command: float = command) -> Array:
                return small_derivative(x, command, p)

            piece: Array = odeint(  # type: ignore[call-overload]  # the stubs want one axis
                rate, x, times, rtol=tolerance, atol=tolerance * magnitude, mxstep=10_000
            )
            found.append(piece[1:])
            x = piece[-1]
        return self.shown(np.concatenate(found))

    def shown(self, states: Array) -> Array:
        """Return the compared columns, (k, 5), of states, (k, 15)."""
        p = self.plant.record[0]
        position = states[:, HYDRAULIC : HYDRAULIC + p["mode_joint"].size]
        tip = position @ p["mode_tip_angle"]
        return np.column_stack((position @ p["mode_joint"], tip, states[:, [P_H, P_S, SPOOL]]))


class PlainC:
    """joint.c, compiled and loaded."""

    def __init__(self, library: Path, plant: Plant) -> None:
        self._library = ctypes.CDLL(str(library))
        record = plant.record[0]
        self.machine = np.concatenate([np.ravel(record[name]) for name in C_FIELDS])

    def rates(self, x: Array, command: float) -> Array:
        """Return dx/dt, (15,)."""
        dx = np.empty_like(x)
        self._library.rates(
            _pointer(x), ctypes.c_double(command), _pointer(self.machine), _pointer(dx)
        )
        return dx

    def simulate(self, start: Array, commands: Array, step: float) -> Array:
        """Return states, (k + 1, 15), every SAMPLE, in steps of `step`, s."""
        states = np.empty((commands.size + 1, start.size))
        states[0] = start
        steps = round(SAMPLE / step)
        self._library.simulate(
            _pointer(states), _pointer(commands), commands.size, steps,
            ctypes.c_double(SAMPLE / steps), _pointer(self.machine),
        )  # fmt: skip
        return states


def _pointer(values: Array) -> Any:
    return values.ctypes.data_as(ctypes.c_void_p)


@contextmanager
def plain_c(plant: Plant) -> Iterator[PlainC | None]:
    """Compile joint.c for this processor; None without a C compiler."""
    compiler = shutil.which("cc")
    if compiler is None:
        yield None
        return
    source = files("emir_analysis.bench") / "joint.c"
    with tempfile.TemporaryDirectory(prefix="emir-") as folder, as_file(source) as file:
        library = Path(folder) / "joint.so"
        flags = ("-O3", "-march=native", "-shared", "-fPIC")
        subprocess.run(  # noqa: S603 (the compiler, on our own file)
            [compiler, *flags, str(file), "-o", str(library), "-lm"], check=True
        )
        yield PlainC(library, plant)


def joint_figures(seconds: float) -> Iterator[tuple[str, list[Figure]]]:
    """Yield titles and figures of joint 1; seconds: about what each contender gets."""
    task = Task(Plant(joint1()))
    with plain_c(task.plant) as c:
        yield f"Joint 1 at a relative error of {ERROR:g}, one core", _solvers(task, c, seconds)
        state = task.start
        title = "One step() of 1 ms from Python, outputs included"
        yield title, durations("step", lambda: task.plant.step(state, 0.5, 1e-3), seconds)
        title = f"Joints or runs at a time, steps of {integration.STEP * 1e3:g} ms"
        yield title, _growth(task, c, seconds)


def _solvers(task: Task, c: PlainC | None, seconds: float) -> list[Figure]:
    reference = task.ours(REFERENCE_STEP)
    step, error = _loosest(task.ours, STEPS, reference)
    found = [_contender("numba, Runge-Kutta 4", lambda: task._ours(step), task, step, error)]  # noqa: SLF001 (same module)
    if c is not None:

        def by_c(step: float) -> Array:
            return c.simulate(task.small_start, task.commands, step)

        c_step, error = _loosest(lambda h: task.shown(by_c(h)), STEPS, reference)
        name = "plain C without effects, Runge-Kutta 4"
        found.append(_contender(name, lambda: by_c(c_step), task, c_step, error))
    tolerance, error = _loosest(task.lsoda, TOLERANCES, reference)
    note = f"rtol {tolerance:.1e}, error {error:.1e}"
    run = Contender("scipy LSODA", lambda: task.lsoda(tolerance), task.duration, note)
    figures = rates([*found, run], "s/s", seconds)
    if c is None:
        figures.append(Figure("plain C", None, "s/s", note="no C compiler (cc) found"))
    return figures


def _contender(name: str, run: Run, task: Task, step: float, error: float) -> Contender:
    return Contender(name, run, task.duration, f"step {step * 1e3:.3g} ms, error {error:.1e}")


def _loosest(
    run: Callable[[float], Array], settings: Sequence[float], reference: Array
) -> tuple[float, float]:
    """Return the first setting, loosest first, that keeps the error, and its error."""
    span = np.ptp(reference, axis=0)
    for setting in settings:
        error = float((np.abs(run(setting) - reference) / span).max())
        if error <= ERROR:
            return setting, error
    raise ArithmeticError(f"no setting of {settings} reaches an error of {ERROR}")


def _growth(task: Task, c: PlainC | None, seconds: float) -> list[Figure]:
    """Return how the speed grows with the number of machines, on one core and on all.

    Beside plain C on one core, which does one after the other.
    """
    affected = Plant(with_values(task.plant.machine, AFFECTED))
    contenders = []
    if c is not None:

        def by_c() -> Array:
            return c.simulate(task.small_start, task.commands, integration.STEP)

        contenders.append(Contender("plain C without effects", by_c, task.duration))
    most = numba.config.NUMBA_NUM_THREADS  # type: ignore[attr-defined]
    for threads in dict.fromkeys((1, most)):
        on = f" on {threads} core{'s' if threads > 1 else ''}"
        many = [(f"{n}{on}", n, task.plant) for n in (1, 2, 4, 6, 8, 16, 32)]
        many += [(f"{n} with effects{on}", n, affected) for n in (1, 8, 16)]
        for name, number, plant in many:
            starts = np.tile(task.start, (number, 1))
            machines = np.tile(plant.record, number)
            run = _many(starts, task.commands, machines, threads)
            clock = time.perf_counter if threads > 1 else time.process_time
            contenders.append(Contender(name, run, number * task.duration, clock=clock))
    figures = rates(contenders, "s/s", seconds)
    numba.set_num_threads(most)
    return figures


def _many(starts: Array, commands: Array, machines: NDArray[Any], threads: int) -> Run:
    def run() -> Array:
        numba.set_num_threads(threads)
        return lanes.simulate_many(starts, commands, SAMPLE, 1, machines)

    return run

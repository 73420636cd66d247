"""Time of a controller's step, in a closed loop on the nonlinear machine.

The outer loops are timed with what they give to be plotted. Beside them the joint's predictive
control as a quadratic program (quadratic_program.py), on the same situations.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from emir_analysis.bench.quadratic_program import Problem, Query, by_do_mpc, by_osqp
from emir_analysis.bench.timing import Figure
from emir_analysis.closed_loop import ClosedLoop
from emir_analysis.yardstick import controllers
from emir_control import pfc_file
from emir_control.force_loop import ForceLoop, ForceLoopParameters
from emir_control.pfc_file import STROKE
from emir_control.trajectory import TrajectoryParameters, named
from emir_plant.plant import REST_PRESSURE, Plant
from emir_plant.sheet import joint1

DURATION = 10.0  # s: rest, a move, rest, and the greater part of the move back
Solve = Callable[[Query], float]


@dataclass(frozen=True)
class Timed:
    """A law whose steps are timed, s, and of which states and inputs are kept."""

    law: Any
    seconds: list[float] = field(default_factory=list)
    seen: list[tuple[Any, Any]] = field(default_factory=list)

    def step(self, state: Any, inputs: Any, dt: float) -> tuple[Any, Any]:
        """Return what the law's step returns."""
        begin = time.perf_counter()
        after, outputs = self.law.step(state, inputs, dt)
        self.seconds.append(time.perf_counter() - begin)
        self.seen.append((state, inputs))
        return after, outputs

    def initial(self, inputs: Any) -> Any:
        """Return the law's initial state."""
        return self.law.initial(inputs)


def control_figures(seconds: float) -> Iterator[tuple[str, list[Figure]]]:
    """Yield titles and figures; seconds: about what each solver of the program gets."""
    machine = joint1()
    timed = {name: Timed(loop) for name, loop in controllers(machine).items()}
    force = Timed(ForceLoop(ForceLoopParameters()))
    for law in timed.values():
        trajectory = named("lift-lower", TrajectoryParameters())
        loop = ClosedLoop(Plant(machine), trajectory, law, force)  # type: ignore[arg-type]
        loop.run(np.pi / 4, REST_PRESSURE, DURATION)
    laws = {"force_loop": force, **timed}
    figures = [figure for name, law in laws.items() for figure in _spread(name, law.seconds)]
    yield "A step of each controller, numpy", figures

    problem = Problem.of(pfc_file.load(pfc_file.default_file(STROKE), STROKE))
    queries = [problem.query(state, now) for state, now in timed["pfc"].seen if state is not None]
    found = []
    for name, make in (("OSQP, warm start", by_osqp), ("do-mpc, IPOPT", by_do_mpc)):
        try:
            solve = make(problem)
        except ImportError as error:
            note = f"{error.name} is not installed: pip install 'emir_ros[bench]'"
            found.append(Figure(name, None, "us", note=note))
            continue
        found += _spread(name, _solving(solve, queries, seconds))
    title = f"The joint's predictive control as a quadratic program, order {len(problem.A)}"
    yield f"{title}, {problem.horizon} steps, limits", found


def _solving(solve: Solve, queries: list[Query], seconds: float) -> list[float]:
    """Return the time of each solution, s, as many as there is time for."""
    taken: list[float] = []
    until = time.perf_counter() + seconds
    for query in queries:
        begin = time.perf_counter()
        solve(query)
        taken.append(time.perf_counter() - begin)
        if begin > until:
            break
    return taken[1:]  # the first one sets up


def _spread(name: str, seconds: list[float]) -> list[Figure]:
    values = np.quantile(seconds, [0.5, 0.99, 1.0]) * 1e6
    ends = ("median", "p99", "largest")
    return [Figure(f"{name}, {end}", float(v), "us") for end, v in zip(ends, values, strict=True)]

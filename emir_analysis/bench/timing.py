"""Timing of several ways to do the same: in turns, so that a machine's bad moment hits all."""

import json
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

TURNS = 9  # of each contender; medians are taken over them


@dataclass(frozen=True)
class Figure:
    """A measured number; a missing contender has no value and a note that says why.

    ratio: to the first of its kind, the median over turns taken together.
    """

    name: str
    value: float | None
    unit: str
    ratio: float | None = None
    note: str = ""


@dataclass(frozen=True)
class Contender:
    """Something to be timed. amount: what one call of `run` does, in `unit` of the comparison.

    clock: s; the processor's own, which others on the machine do not slow down, or the one on
    the wall for what uses several processors.
    """

    name: str
    run: Callable[[], object]
    amount: float
    note: str = ""
    clock: Callable[[], float] = time.process_time


def rates(contenders: Sequence[Contender], unit: str, seconds: float) -> list[Figure]:
    """Return amount per second of each, and its ratio to the first one's.

    seconds: to be spent on each contender. Everyone runs once before that, unmeasured.
    """
    each = seconds / TURNS
    for contender in contenders:
        contender.run()
    measured = [[_rate(contender, each) for contender in contenders] for _ in range(TURNS)]
    return [
        Figure(
            contender.name,
            statistics.median(turn[k] for turn in measured),
            unit,
            statistics.median(turn[k] / turn[0] for turn in measured),
            contender.note,
        )
        for k, contender in enumerate(contenders)
    ]


def _rate(contender: Contender, seconds: float) -> float:
    clock = contender.clock
    calls, begin = 0, clock()
    while calls == 0 or clock() - begin < seconds:
        contender.run()
        calls += 1
    return calls * contender.amount / (clock() - begin)


def durations(name: str, run: Callable[[], object], seconds: float) -> list[Figure]:
    """Return median and 99 % quantile of the time of one call, us."""
    run()
    times: list[float] = []
    until = time.perf_counter() + seconds
    while not times or time.perf_counter() < until:
        begin = time.perf_counter()
        run()
        times.append(time.perf_counter() - begin)
    median, late = np.quantile(times, [0.5, 0.99]) * 1e6
    return [Figure(f"{name}, median", median, "us"), Figure(f"{name}, p99", late, "us")]


def text(title: str, figures: Sequence[Figure]) -> str:
    """Return figures as lines under their title."""
    return "\n".join([title, *(_line(figure) for figure in figures)])


def _line(figure: Figure) -> str:
    value = "-" if figure.value is None else f"{figure.value:.4g} {figure.unit}"
    ratio = "" if figure.ratio is None else f"{figure.ratio:.2f} x"
    note = f"  {figure.note}" if figure.note else ""
    return f"  {figure.name:48s} {value:>16s} {ratio:>9s}{note}".rstrip()


def write_json(parts: dict[str, list[Figure]], file: Path) -> None:
    """Write figures by the title of their part."""
    content = {title: [asdict(figure) for figure in figures] for title, figures in parts.items()}
    file.write_text(json.dumps(content, indent=2) + "\n")

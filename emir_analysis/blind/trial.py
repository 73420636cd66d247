"""One machine: recorded, given to `emir diagnose`, its answer beside what was hidden."""

import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from emir_analysis.blind.hidden import Hidden
from emir_analysis.blind.machine import NotSolvedError
from emir_analysis.blind.numbers import (
    DATA_SHEET,
    Stated,
    data_sheet,
    read_numbers,
    signal_map,
)
from emir_analysis.blind.puzzle import Puzzle, kind_of, puzzle
from emir_analysis.blind.recording import write
from emir_analysis.blind.varied import varied
from emir_analysis.errors import InputError

PATIENCE = 3600.0  # s, for one diagnosis
SHEET, SIGNALS = "datasheet.yaml", "signals.yaml"  # beside a machine's recordings


@dataclass(frozen=True)
class Plan:
    """What makes a blind test repeatable.

    foreign: the source text of a module whose FOREIGN lists what no catalogue holds. duration:
    of each of a machine's two recordings, s. only: effects from which to draw; all when empty.
    varied: each machine is of a sheet of its own, with its own sampling and sensors.
    """

    seed: int
    duration: float
    foreign: str = ""
    only: tuple[str, ...] = ()
    varied: bool = False


@dataclass(frozen=True)
class Outcome:
    """What was hidden in a machine and what the diagnosis said of it.

    errors: free-run RMS on the judge recording over the sensor noise, by stage (as stated,
    re-fitted, with the effects) and signal. failure: what went wrong; then there is no verdict.
    """

    machine: int
    kind: str
    hidden: list[str]
    sizes: dict[str, float]
    size: float
    verdict: str
    named: list[str]
    rivals: list[str]
    statement: str
    errors: dict[str, dict[str, float]]
    seconds: float
    failure: str = ""


def foreign_effects(source: str) -> tuple[type[Hidden], ...]:
    """Return what a module's source text lists as FOREIGN. Raises InputError without that."""
    if not source:
        return ()
    module = ModuleType("foreign")
    try:
        exec(source, module.__dict__)  # noqa: S102 (the user's own file, sent to the workers)
    except Exception as error:  # noqa: BLE001 (whatever that file does)
        raise InputError(f"the foreign effects' file: {error}") from None
    found = getattr(module, "FOREIGN", None)
    if not isinstance(found, tuple) or not found:
        raise InputError("the foreign effects' file has no tuple FOREIGN")
    return found


def trial(plan: Plan, number: int, threads: int, keep: Path | None = None) -> Outcome:
    """Build machine `number`, record it and have it diagnosed with so many threads.

    keep: folder in which recordings and answers are left.
    """
    if keep is not None:
        folder = keep / f"machine{number:04d}"
        folder.mkdir(parents=True, exist_ok=True)
        return _trial(plan, number, threads, folder)
    with tempfile.TemporaryDirectory(prefix="emir-blind-") as temporary:
        return _trial(plan, number, threads, Path(temporary))


def _trial(plan: Plan, number: int, threads: int, folder: Path) -> Outcome:
    foreign = foreign_effects(plan.foreign)
    stated = _stated(plan, number)
    (folder / SHEET).write_text(data_sheet(stated), encoding="utf-8")
    (folder / SIGNALS).write_text(signal_map(stated.missing), encoding="utf-8")
    try:
        made = puzzle(stated, plan.seed, number, foreign, plan.duration, plan.only)
    except NotSolvedError as error:
        return _without_answer(number, kind_of(number, foreign), f"not made: {error}")
    noise = np.random.default_rng((plan.seed, number, 1))
    for name, run in (("a", made.learn), ("b", made.judge)):
        write(folder / f"{name}.mcap", run, made.machine, noise)
    begin = time.monotonic()
    answer, failure = _diagnosed(folder, threads)
    return _outcome(made, number, answer, failure, time.monotonic() - begin)


def _stated(plan: Plan, number: int) -> Stated:
    """Return what the maker says of a machine."""
    stated = read_numbers(DATA_SHEET)
    if not plan.varied:
        return stated
    return varied(stated, np.random.default_rng((plan.seed, number, 2)))


def _diagnosed(folder: Path, threads: int) -> tuple[dict[str, Any], str]:
    """Return the answer of `emir diagnose`, or why there is none."""
    answer = folder / "answer.json"
    result = subprocess.run(  # noqa: S603 (the project's own command)
        [
            *(sys.executable, "-m", "emir_analysis.cli", "diagnose", str(folder / "a.mcap")),
            *("--datasheet", str(folder / SHEET), "--signals", str(folder / SIGNALS)),
            *("--judge", str(folder / "b.mcap"), "--json", str(answer)),
        ],
        capture_output=True,
        text=True,
        check=False,
        timeout=PATIENCE,
        env=os.environ | {"NUMBA_NUM_THREADS": str(threads), "OMP_NUM_THREADS": str(threads)},
    )
    if result.returncode != 0:
        last = (result.stderr.strip().splitlines() or ["no word"])[-1]
        return {}, f"exit code {result.returncode}: {last}"
    return json.loads(answer.read_text(encoding="utf-8")), ""


def _outcome(
    made: Puzzle, number: int, answer: dict[str, Any], failure: str, seconds: float
) -> Outcome:
    signals = answer.get("signals", {})
    stages = ("nominal", "refitted", "with_effect")
    return Outcome(
        machine=number,
        kind=made.kind,
        hidden=list(made.hidden),
        sizes=made.machine.sizes,
        size=made.size,
        verdict=answer.get("verdict", "failed"),
        named=[effect["name"] for effect in answer.get("effects", [])],
        rivals=[str(rival) for rival in answer.get("rivals", [])],
        statement=answer.get("statement", ""),
        errors={
            stage: {name: _ratio(s.get(stage), s["noise"]) for name, s in signals.items()}
            for stage in stages
        },
        seconds=round(seconds, 1),
        failure=failure,
    )


def _without_answer(number: int, kind: str, failure: str) -> Outcome:
    return Outcome(number, kind, [], {}, 0.0, "failed", [], [], "", {}, 0.0, failure)


def _ratio(error: float | None, noise: float) -> float:
    return float("inf") if error is None else round(error / noise, 3)

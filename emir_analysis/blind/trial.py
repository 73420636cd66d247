"""One machine: recorded, given to `emir diagnose`, its answer beside what was hidden."""

import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from emir_analysis.blind.family import JUDGE, LEARN, SHEET, SIGNALS, Secret, family
from emir_analysis.blind.machine import NotSolvedError
from emir_analysis.blind.plan import Plan, foreign_effects
from emir_analysis.blind.turns import kind_of

PATIENCE = 3600.0  # s, for one diagnosis


@dataclass(frozen=True)
class Outcome:
    """What was hidden in a machine and what the diagnosis said of it.

    errors: free-run RMS on the judge recording over the sensor noise, by stage (as stated,
    re-fitted, with the effects) and signal. intervals: of the machine's own numbers inside their
    tolerances, by dotted path of the data sheet: as built, low and high as they were told.
    failure: what went wrong; then there is no verdict.
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
    intervals: dict[str, list[float]] = field(default_factory=dict)


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
    sort = family(actuator=plan.actuator)
    try:
        secret = sort.made(plan, number, folder)
    except NotSolvedError as error:
        kind = kind_of(number, foreign_effects(plan.foreign, sort.base))
        return _without_answer(number, kind, f"not made: {error}")
    begin = time.monotonic()
    answer, failure = _diagnosed(folder, threads)
    return _outcome(secret, number, answer, failure, time.monotonic() - begin)


def _diagnosed(folder: Path, threads: int) -> tuple[dict[str, Any], str]:
    """Return the answer of `emir diagnose`, or why there is none."""
    answer = folder / "answer.json"
    command = [
        *(sys.executable, "-m", "emir_analysis.cli", "diagnose", str(folder / LEARN)),
        *("--datasheet", str(folder / SHEET), "--signals", str(folder / SIGNALS)),
        *("--judge", str(folder / JUDGE), "--json", str(answer)),
    ]
    try:
        result = subprocess.run(  # noqa: S603 (the project's own command)
            command,
            capture_output=True,
            text=True,
            check=False,
            timeout=PATIENCE,
            env=os.environ | {"NUMBA_NUM_THREADS": str(threads), "OMP_NUM_THREADS": str(threads)},
        )
    except subprocess.TimeoutExpired:
        return {}, f"no answer within {PATIENCE:g} s"
    if result.returncode != 0:
        last = (result.stderr.strip().splitlines() or ["no word"])[-1]
        return {}, f"exit code {result.returncode}: {last}"
    return json.loads(answer.read_text(encoding="utf-8")), ""


def _outcome(
    secret: Secret, number: int, answer: dict[str, Any], failure: str, seconds: float
) -> Outcome:
    signals = answer.get("signals", {})
    stages = ("nominal", "refitted", "with_effect")
    return Outcome(
        machine=number,
        kind=secret.kind,
        hidden=list(secret.hidden),
        sizes=secret.sizes,
        size=secret.size,
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
        intervals={
            path: [built, told["low"], told["high"]]
            for path, built in secret.built.items()
            if (told := answer.get("parameters", {}).get(path))
        },
    )


def _without_answer(number: int, kind: str, failure: str) -> Outcome:
    return Outcome(number, kind, [], {}, 0.0, "failed", [], [], "", {}, 0.0, failure)


def _ratio(error: float | None, noise: float) -> float:
    return float("inf") if error is None else round(error / noise, 3)

"""Many machines, on all cores or on a cluster; every outcome is on disk before the next."""

import json
import os
import signal
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import MISSING, asdict, fields
from hashlib import sha256
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from emir_analysis.blind.plan import Plan
from emir_analysis.blind.trial import Outcome, trial
from emir_analysis.errors import InputError

INTERRUPTED = 130  # exit code
PATIENCE = 10.0  # s, until a scheduler has to answer

Progress = Callable[[str], None]


def campaign(  # noqa: PLR0913 (who, what, where)
    plan: Plan,
    machines: int,
    log: Path,
    executor: Executor,
    progress: Progress,
    *,
    threads: int = 1,
    keep: Path | None = None,
) -> list[Outcome]:
    """Diagnose machines 0 ... machines - 1 of a plan, but those that the log already has.

    log: JSON lines, the plan and then one line per machine. Raises InputError for a log of
    another plan or when a worker dies.
    """
    done = {outcome.machine: outcome for outcome in read_log(log, plan)}
    missing = [number for number in range(machines) if number not in done]
    if len(missing) < machines:
        progress(f"{log} has {machines - len(missing)} of {machines} machines")
    with log.open("a", encoding="utf-8") as lines:
        if not log.stat().st_size:
            lines.write(json.dumps(_described(plan)) + "\n")
        futures = [executor.submit(_work, plan, number, threads, keep) for number in missing]
        try:
            for future in as_completed(futures):
                outcome = future.result()
                lines.write(json.dumps(asdict(outcome)) + "\n")
                lines.flush()
                done[outcome.machine] = outcome
                progress(f"{len(done):4d} of {machines}  {line(outcome)}")
        except BrokenExecutor:
            raise InputError(
                f"a worker died; {log} has what was done, the same command goes on"
            ) from None
        finally:
            for future in futures:
                future.cancel()
    return [done[number] for number in sorted(done) if number < machines]


def line(o: Outcome) -> str:
    """Return an outcome as one line."""
    hidden = " + ".join(o.hidden) or "nothing"
    answer = o.failure or f"{o.verdict} {' + '.join(o.named)}".strip()
    return f"machine {o.machine:4d}  {hidden} ({o.size:.2f}) -> {answer}  {o.seconds:.0f} s"


def read_log(log: Path, plan: Plan | None = None) -> list[Outcome]:
    """Return the outcomes of a log; a last line that was cut off counts as not there.

    Raises InputError for a log of another plan, or one that cannot be read.
    """
    if not log.exists():
        return []
    try:
        text = log.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{log}: {error}") from None
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        log.write_text(whole, encoding="utf-8")
    lines = whole.splitlines()
    known = {field.name for field in fields(Outcome)}
    try:
        if lines and plan is not None and not _is_of(plan, json.loads(lines[0])):
            raise InputError(f"{log}: of another seed, duration, set or kind; choose another file")
        found = [json.loads(line) for line in lines[1:]]
        return [Outcome(**{k: v for k, v in entry.items() if k in known}) for entry in found]
    except (json.JSONDecodeError, TypeError) as error:
        raise InputError(f"{log}: not a log of blind machines: {error}") from None


def _described(plan: Plan) -> dict[str, Any]:
    source = sha256(plan.foreign.encode()).hexdigest()[:12]
    return asdict(plan) | {"only": list(plan.only), "foreign": source}


def _is_of(plan: Plan, described: dict[str, Any]) -> bool:
    """Tell whether a log's first line describes a plan; what it does not know yet was not there."""
    later = {field.name: field.default for field in fields(Plan) if field.default is not MISSING}
    return later | described == _described(plan)


def _work(plan: Plan, number: int, threads: int, keep: Path | None) -> Outcome:
    try:
        return trial(plan, number, threads, keep)
    except SystemExit:  # by Ctrl-C, see below; what was temporary is gone
        os._exit(INTERRUPTED)


def _end_when_interrupted() -> None:
    """Let a process of this machine end at Ctrl-C without a word, even while it waits for work."""
    signal.signal(signal.SIGINT, lambda *_: sys.exit(INTERRUPTED))


@contextmanager
def workers(jobs: int, scheduler: str | None) -> Iterator[Executor]:
    """Yield who does the work: processes of this machine, or the cluster of a Dask scheduler.

    Raises InputError without Dask, or where no scheduler answers.
    """
    if scheduler is None:
        # not forked: there may be threads
        with ProcessPoolExecutor(jobs, get_context("spawn"), _end_when_interrupted) as executor:
            yield executor
        return
    try:
        from distributed import Client  # noqa: PLC0415 (an extra)
    except ImportError:
        raise InputError("--scheduler needs Dask: pip install 'emir_ros[cluster]'") from None
    connect: Any = Client  # untyped
    try:
        client = connect(scheduler, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(f"--scheduler {scheduler}: {error}") from None
    with client, client.get_executor() as executor:
        yield executor

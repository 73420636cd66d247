"""`emir blind`: machines with something hidden in them, and what `emir diagnose` makes of them."""

import argparse
import os
from collections.abc import Callable
from pathlib import Path

from emir_analysis.blind.campaign import campaign, workers
from emir_analysis.blind.hidden import CATALOGUE
from emir_analysis.blind.report import report
from emir_analysis.blind.trial import Plan, foreign_effects
from emir_analysis.errors import InputError

SHORTEST = 20.0  # s


def arguments(words: list[str]) -> argparse.Namespace:
    """Read the command's words."""
    parser = argparse.ArgumentParser(
        prog="emir blind", description="diagnose machines with something hidden in them"
    )
    parser.add_argument("--machines", type=int, default=20, metavar="N", help="how many")
    parser.add_argument("--seed", type=int, default=1, metavar="S", help="which")
    parser.add_argument("--jobs", type=int, metavar="J", help="at a time; all cores by default")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask cluster, host:port")
    parser.add_argument(
        "--foreign", type=Path, metavar="FILE", help="Python: effects that no catalogue holds"
    )
    parser.add_argument("--only", default="", metavar="NAME,NAME", help="draw from these effects")
    parser.add_argument(
        "--varied", action="store_true", help="each machine of another size, with other sensors"
    )
    parser.add_argument("--duration", type=float, default=60.0, metavar="S", help="of a recording")
    parser.add_argument(
        "--log", type=Path, metavar="FILE", help="one JSON line per machine; continued if there"
    )
    parser.add_argument("--keep", type=Path, metavar="DIR", help="leave the recordings there")
    return parser.parse_args(words)


def command(options: argparse.Namespace, progress: Callable[[str], None]) -> str:
    """Run the blind test; return its report. Raises InputError for what cannot be used."""
    source, only = _source(options.foreign), _only(options.only)
    plan = Plan(options.seed, options.duration, source, only, options.varied)
    foreign_effects(plan.foreign)
    if options.machines < 1:
        raise InputError(f"--machines {options.machines}: at least one")
    if options.seed < 0:
        raise InputError(f"--seed {options.seed}: not negative")
    if not plan.duration >= SHORTEST:
        raise InputError(f"--duration {plan.duration:g}: at least {SHORTEST:g} s")
    cores = os.cpu_count() or 1
    jobs = cores if options.jobs is None else options.jobs
    if jobs < 1:
        raise InputError(f"--jobs {jobs}: at least one")
    log = options.log or Path(f"blind-{plan.seed}.jsonl")
    threads = 1 if options.scheduler else max(1, cores // jobs)
    with workers(jobs, options.scheduler) as executor:
        outcomes = campaign(
            plan, options.machines, log, executor, progress, threads=threads, keep=options.keep
        )
    return report(outcomes)


def _source(file: Path | None) -> str:
    if file is None:
        return ""
    try:
        return file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"--foreign {file}: {error}") from None


def _only(text: str) -> tuple[str, ...]:
    names = tuple(name for name in text.split(",") if name)
    known = {effect.name for effect in CATALOGUE}
    for name in names:
        if name not in known:
            raise InputError(f"--only {name}: there are {', '.join(sorted(known))}")
    return names

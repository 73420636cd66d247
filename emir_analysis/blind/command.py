"""`emir blind`: machines with something hidden in them, and what `emir diagnose` makes of them."""

import argparse
import os
from collections.abc import Callable
from pathlib import Path

from emir_analysis.blind.campaign import campaign, workers
from emir_analysis.blind.family import ACTUATOR, BOOM, Family, family
from emir_analysis.blind.plan import Plan, foreign_effects
from emir_analysis.blind.report import report
from emir_analysis.errors import InputError
from emir_analysis.outputs import check_outputs, written


def arguments(words: list[str]) -> argparse.Namespace:
    """Read the command's words."""
    parser = argparse.ArgumentParser(
        prog="emir blind",
        description="Machines with something hidden in them, simulated by a second model: does"
        " `emir diagnose` find it? Prints rates, a table of what was taken for what, and errors."
        " An interrupted test goes on where it was, by the same command.",
    )
    parser.add_argument(
        "--machines", type=int, default=20, metavar="N", help="how many; default 20"
    )
    parser.add_argument(
        "--seed", type=int, default=1, metavar="S",
        help="which machines: the same number, the same machines; default 1",
    )  # fmt: skip
    parser.add_argument(
        "--jobs", type=int, metavar="J", help="machines at a time; default: as many as cores"
    )
    parser.add_argument(
        "--scheduler", metavar="ADDRESS",
        help="host:port of a Dask cluster that does the work (extra `cluster`)",
    )  # fmt: skip
    parser.add_argument(
        "--foreign", type=Path, metavar="FILE",
        help="Python file with effects that no catalogue holds, hidden, too",
    )  # fmt: skip
    parser.add_argument(
        "--only", default="", metavar="NAME,NAME", help="hide these effects alone; default: any"
    )
    parser.add_argument(
        "--varied", action="store_true", help="each machine of another size, with other sensors"
    )
    parser.add_argument(
        "--actuator", action="store_true", help="machines that are not EMIR, in normalised units"
    )
    usual = " or ".join(f"{sort.usual:g} {sort.unit}" for sort in (BOOM, ACTUATOR))
    parser.add_argument(
        "--duration", type=float, metavar="D",
        help=f"of a recording; default {usual} of an actuator",
    )  # fmt: skip
    parser.add_argument(
        "--log", type=Path, metavar="FILE",
        help="one JSON line for each machine; one that exists is continued. Default:"
        " blind-SEED.jsonl in the current folder",
    )  # fmt: skip
    parser.add_argument("--keep", type=Path, metavar="DIR", help="keep the recordings there")
    return parser.parse_args(words)


def command(options: argparse.Namespace, progress: Callable[[str], None]) -> str:
    """Run the blind test; return its report. Raises InputError for what cannot be used."""
    sort = family(actuator=options.actuator)
    if options.actuator and options.varied:
        raise InputError("--varied: every actuator is another one anyway; leave it out")
    plan = Plan(
        seed=options.seed,
        duration=_duration(options.duration, sort),
        foreign=_source(options.foreign),
        only=_only(options.only, sort),
        varied=options.varied,
        actuator=options.actuator,
    )
    foreign_effects(plan.foreign, sort.base)
    if options.machines < 1:
        raise InputError(f"--machines {options.machines}: at least one")
    if options.seed < 0:
        raise InputError(f"--seed {options.seed}: not negative")
    cores = os.cpu_count() or 1
    jobs = cores if options.jobs is None else options.jobs
    if jobs < 1:
        raise InputError(f"--jobs {jobs}: at least one")
    log = options.log or Path(f"blind-{plan.seed}.jsonl")
    check_outputs([log], None, [options.foreign])
    if options.keep is not None:
        with written(options.keep):
            options.keep.mkdir(parents=True, exist_ok=True)
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


def _duration(wanted: float | None, sort: Family) -> float:
    duration = sort.usual if wanted is None else wanted
    if not duration >= sort.shortest:
        raise InputError(f"--duration {duration:g}: at least {sort.shortest:g} {sort.unit}")
    if sort is ACTUATOR and not duration.is_integer():
        raise InputError(f"--duration {duration:g}: a whole number of {sort.unit}")
    return duration


def _only(text: str, sort: Family) -> tuple[str, ...]:
    names = tuple(name for name in text.split(",") if name)
    known = {effect.name for effect in sort.catalogue}
    for name in names:
        if name not in known:
            raise InputError(f"--only {name}: there are {', '.join(sorted(known))}")
    return names

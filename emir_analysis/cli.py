"""The `emir` command."""

import argparse
import math
import os
import sys
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from emir_analysis.errors import IncompleteError, InputError
from emir_analysis.unused_options import check_unused
from emir_common.quantity import ParameterError

USAGE = """usage: emir COMMAND ...

  run        run the graph of machine and controllers, record it, show its figures
  import     a CSV file as a recording, by a signal map
  info       what is in a recording, and whether it was finished
  bag        recover a recording that was cut off
  replay     a recording's inputs to its controller: does it give what was recorded?
  view       a recording or the running graph as a page in the browser: arm, pressures, valve
  analyze    figures and plots of recordings of the graph, one or several side by side
  compare    every controller on the same moves: lag, deflection of the TCP, smoothness
  limit      the smallest deflection of the TCP that any command could reach for a move
  yardstick  controllers against that limit, over random draws of the machine
  disturb    a push, a load dropped or picked up: what each controller makes of it
  design     a controller for a machine, and where it is stable
  linearize  linear design models of the machine, and how good they are
  figures    the paper's figures, drawn by this machine, and a table of its numbers
  diagnose   what a model lacks: the residual of a recording, traced to an effect
  urdf       the whole robot as URDF
  blind      machines with something hidden in them: does the diagnosis find it?
  bench      how fast machine, controllers and graph are, beside other programs

`emir COMMAND --help` tells more."""

HELP = ("--help", "-h")
TIME_LIMIT = 240.0  # s: four times what a diagnosis from 90 s takes, but for a few machines


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns the exit code. Errors of the user are one line each."""
    words = list(sys.argv[1:] if arguments is None else arguments) or [HELP[0]]
    commands: dict[str, Callable[[list[str]], int]] = {
        "run": _run,
        "import": _import,
        "info": _info,
        "bag": _bag,
        "replay": _replay,
        "view": _view,
        "analyze": _analyze,
        "compare": _compare,
        "limit": _limit,
        "yardstick": _yardstick,
        "disturb": _disturb,
        "design": _design,
        "linearize": _linearize,
        "figures": _figures,
        "diagnose": _diagnose,
        "urdf": _urdf,
        "blind": _blind,
        "bench": _bench,
    }
    if words[0] not in (*commands, *HELP):
        return _complain("emir", f"{words[0]!r}: the commands are {', '.join(commands)}")
    try:
        code = commands.get(words[0], _usage)(words[1:])
        sys.stdout.flush()  # here, not when Python ends, where nothing can be caught
    except (InputError, ParameterError) as error:
        return _complain(f"emir {words[0]}", str(error))
    except BrokenPipeError:  # whoever read our output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except KeyboardInterrupt:
        sys.stderr.write(f"emir {words[0]}: interrupted\n")
        return 130
    return code


def _usage(_: Sequence[str]) -> int:
    print(USAGE)
    return 0


def _complain(who: str, message: str) -> int:
    sys.stderr.write(f"{who}: {message}\n")
    return 1


def _run(words: list[str]) -> int:
    """Run the graph."""
    return _hand_over(["run", *words])


def _hand_over(words: list[str]) -> int:
    """Hand over to the one package that knows ROS, in this same process.

    -P: what lies in the current folder is not imported.
    """
    if find_spec("rclpy") is None:
        raise InputError("needs ROS 2: source a ROS 2 Jazzy, or pip install 'emir_ros[ros]'")
    os.execv(sys.executable, [sys.executable, "-P", "-m", "emir_ros.start", *words])  # noqa: S606


def _import(words: list[str]) -> int:
    from emir_analysis.import_command import command

    print(command(words))
    return 0


def _info(words: list[str]) -> int:
    from emir_analysis.info_command import command

    print(command(words))
    return 0


def _bag(words: list[str]) -> int:
    from emir_analysis.bag_command import command

    print(command(words, _progress))
    return 0


def _replay(words: list[str]) -> int:
    from emir_analysis.replay_command import command

    told, is_same = command(words)
    print(told)
    return 0 if is_same else 1


def _view(words: list[str]) -> int:
    from emir_analysis.view.command import command

    return command(words, lambda arguments: _hand_over(["view_node", *arguments]))


def _analyze(words: list[str]) -> int:
    from emir_analysis.analyze_command import command

    return _said(str, lambda: command(words))


def _compare(words: list[str]) -> int:
    from emir_analysis.compare_command import command

    return _said(str, lambda: command(words, _progress))


def _limit(words: list[str]) -> int:
    from emir_analysis.limit_command import command

    print(command(words))
    return 0


def _yardstick(words: list[str]) -> int:
    from emir_analysis.yardstick_command import command

    print(command(words, _progress))
    return 0


def _disturb(words: list[str]) -> int:
    from emir_analysis.disturb_command import command

    print(command(words, _progress))
    return 0


def _design(words: list[str]) -> int:
    from emir_analysis.design_command import command

    print(command(words, _progress))
    return 0


def _bench(words: list[str]) -> int:
    if words[:1] == ["graph"]:
        return _hand_over(["bench", *words[1:]])
    if words[:1] == ["diagnosis"]:
        from emir_analysis.bench import identification

        identification.command(words[1:], print)
        return 0
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy: one core is measured
    from emir_analysis.bench.command import PARTS, command

    parser = argparse.ArgumentParser(
        prog="emir bench",
        description="How fast all this is, beside other programs that do the same in the same run."
        " What is not installed is named.",
    )
    parser.add_argument(
        "what", choices=(*PARTS, "graph", "diagnosis"),
        help="plant: the machine's models; control: the controllers; graph: lock step, latency,"
        " jitter, recorder (needs ROS 2); diagnosis: general identification tools on the recordings"
        " of emir diagnose. The last two have options of their own: emir bench graph --help",
    )  # fmt: skip
    parser.add_argument(
        "--seconds", type=float, default=3.0, metavar="S",
        help="of plant and control: time for each program that is compared; default 3",
    )  # fmt: skip
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures")
    command(parser.parse_args(words), print)
    return 0


def _linearize(words: list[str]) -> int:
    from emir_analysis.linearize_command import command

    print(command(words, _progress))
    return 0


def _figures(words: list[str]) -> int:
    from emir_analysis.figures_command import command

    print(command(words, _progress))
    return 0


def _diagnose(words: list[str]) -> int:
    # before numpy: matrices here are small, and threads cost more than they gain
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from emir_analysis.diagnosis import command, summary
    from emir_plant.actuator import is_actuator

    o = _diagnose_parser().parse_args(words)
    if o.datasheet is not None and is_actuator(o.datasheet):
        return _diagnose_actuator(o)
    return _said(summary, lambda: command(
        o.bag, o.datasheet, o.signals, o.judge, o.json, o.html, _progress,
        model_out=o.model_out, predictions=o.predictions, time_limit=o.time_limit,
    ))  # fmt: skip


def _diagnose_actuator(o: argparse.Namespace) -> int:
    from emir_analysis.diagnosis import actuator

    if o.signals is None:
        raise InputError(f"{o.datasheet}: an actuator needs --signals")
    check_unused(o, {"time_limit": TIME_LIMIT}, "an actuator's search ends soon in any case")
    judges = o.judge or [None]
    if len(o.bag) > 1 or len(judges) > 1:
        raise InputError(
            f"{o.datasheet}: an actuator is diagnosed from one recording and judged on one"
        )
    return _said(actuator.summary, lambda: actuator.command(
        o.bag[0], o.datasheet, o.signals, judges[0], json=o.json, html=o.html,
        model_out=o.model_out, predictions=o.predictions, progress=_progress,
    ))  # fmt: skip


def _diagnose_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="emir diagnose",
        description="What a machine has that its data sheet lacks: nothing_missing, found (which"
        " effects), ambiguous (which ones, and what would tell them apart) or unexplained (which"
        " balance, how large, against what; another value in the data sheet that explains it, or"
        " what drifts).",
    )
    parser.add_argument(
        "bag", type=Path, nargs="+", metavar="BAG", help="recordings of one machine to learn from"
    )
    parser.add_argument(
        "--datasheet", type=Path, metavar="FILE",
        help="YAML of the machine, values and tolerances (default: EMIR's main joint)",
    )  # fmt: skip
    parser.add_argument(
        "--signals", type=Path, metavar="FILE",
        help="YAML: signal, topic, field, unit (default: the topics of `emir run`)",
    )  # fmt: skip
    parser.add_argument(
        "--judge", type=Path, nargs="+", action="extend", metavar="BAG",
        help="recordings to judge by, opened when all is fitted; default: those learned from",
    )  # fmt: skip
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the result")
    parser.add_argument("--html", type=Path, metavar="FILE", help="write a report with pictures")
    parser.add_argument(
        "--model-out", type=Path, metavar="FILE",
        help="write the machine as found: parameters of the plant node, with its effects",
    )  # fmt: skip
    parser.add_argument(
        "--predictions", type=Path, metavar="DIR", help="write the simulated runs as MCAP"
    )
    parser.add_argument(
        "--time-limit", type=_seconds, default=TIME_LIMIT, metavar="S",
        help="after which the search ends with the best that was found (default: %(default)g)",
    )  # fmt: skip
    return parser


def _seconds(word: str) -> float:
    """Return a time, s. Raises ArgumentTypeError unless it is one."""
    try:
        seconds = float(word)
    except ValueError:
        seconds = math.nan
    if not seconds > 0.0:
        raise argparse.ArgumentTypeError(f"{word}: not a time in seconds above 0")
    return seconds


def _said(summary: Callable[[Any], str], work: Callable[[], object]) -> int:
    """Print what some work has come to, also where not all of it could be read or written."""
    try:
        result = work()
    except IncompleteError as error:
        print(summary(error.result))
        raise
    print(summary(result))
    return 0


def _blind(words: list[str]) -> int:
    from emir_analysis.blind.command import arguments, command

    print(command(arguments(words), _progress))
    return 0


def _urdf(words: list[str]) -> int:
    from emir_analysis.urdf_command import command

    print(command(words))
    return 0


def _progress(line: str) -> None:
    sys.stderr.write(f"{line}\n")


if __name__ == "__main__":
    sys.exit(main())

"""The `emir` command."""

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from emir_analysis.errors import IncompleteError, InputError
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
    return _hand_over("emir_ros.start", ["run", *words])


def _hand_over(module: str, words: list[str]) -> int:
    """Hand over to the one package that knows ROS, in this same process.

    -P: what lies in the current folder is not imported.
    """
    if find_spec("rclpy") is None:
        raise InputError("needs ROS 2: source a ROS 2 Jazzy, or pip install 'emir_ros[ros]'")
    os.execv(sys.executable, [sys.executable, "-P", "-m", module, *words])  # noqa: S606


def _import(words: list[str]) -> int:
    from emir_analysis.import_command import import_csv

    parser = argparse.ArgumentParser(
        prog="emir import",
        description="A CSV file as a recording that every other command takes (rosbag2, MCAP), by a"
        " signal map. A blank cell is no sample.",
    )
    parser.add_argument("table", type=Path, metavar="CSV", help="its first line names the columns")
    parser.add_argument(
        "--signals", type=Path, required=True, metavar="FILE",
        help="signal map, YAML: of each signal column, topic, field, unit; the column of time",
    )  # fmt: skip
    parser.add_argument(
        "--out", type=Path, required=True, metavar="BAG", help="folder to write; must not exist"
    )
    parser.add_argument("--rows", metavar="A:B", help="from row A (the first is 0) up to before B")
    o = parser.parse_args(words)
    try:
        rows = None
        if o.rows is not None:
            first, behind = (int(n) if n else None for n in o.rows.split(":"))
            rows = slice(first, behind)
    except ValueError:
        raise InputError(f"--rows {o.rows}: not of the form A:B") from None
    made = import_csv(o.table, o.signals, o.out, rows)
    left = f"; {made.left_out} messages left out for blank cells" if made.left_out else ""
    print(f"{o.out}: {made.rows} rows, time {made.start:g} ... {made.end:g} {made.unit}{left}")
    return 0


def _info(words: list[str]) -> int:
    from emir_analysis.info import fields_text, info, parameters_text, text

    parser = argparse.ArgumentParser(
        prog="emir info",
        description="What is in a recording: how it was made, whether it was finished, its topics"
        " with type, number and rate of messages.",
    )
    parser.add_argument("bag", type=Path, metavar="BAG", help="any recording in MCAP")
    parser.add_argument(
        "--fields", action="store_true", help="instead: unit and meaning of every field"
    )
    parser.add_argument(
        "--parameters", action="store_true",
        help="instead: the nodes' parameters, as a ROS parameter file",
    )  # fmt: skip
    options = parser.parse_args(words)
    found = info(options.bag)
    if options.fields:
        print(fields_text(found))
    if options.parameters:
        print(parameters_text(found))
    if not (options.fields or options.parameters):
        print(text(found))
    return 0


def _bag(words: list[str]) -> int:
    from emir_analysis.recover import recover

    parser = argparse.ArgumentParser(prog="emir bag", description="Recover a recording.")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    about = "A complete recording of what can be read of one that was cut off or damaged"
    recovery = commands.add_parser("recover", help=about, description=about)
    recovery.add_argument("bag", type=Path, metavar="BAG", help="folder or .mcap file")
    recovery.add_argument(
        "--out", type=Path, required=True, metavar="DIR", help="folder to write; must not exist"
    )
    options = parser.parse_args(words)
    saved = recover(options.bag, options.out)
    for line in saved.damage:
        _progress(f"emir bag: {line}; what came before it is saved")
    print(f"{options.out}: {saved.messages} messages over {saved.duration_ns * 1e-9:.3f} s")
    return 0


def _replay(words: list[str]) -> int:
    import yaml

    from emir_analysis.recorded_orders import orders
    from emir_analysis.replay import NODES, replay, text
    from emir_analysis.stamped import same
    from emir_common.yaml_file import read_value

    parser = argparse.ArgumentParser(
        prog="emir replay",
        description="Give the recorded inputs to what one node computes, and compare its answers"
        " with the recorded ones, bit by bit. Exit code 1 where they differ.",
    )
    parser.add_argument(
        "bag", type=Path, metavar="BAG", help="a recording of the graph, made in lock step"
    )
    parser.add_argument("--node", required=True, metavar="NAME", help=f"one of {', '.join(NODES)}")
    parser.add_argument(
        "--set", action="append", default=[], metavar="PARAM=VALUE",
        help="with this parameter of the node: how far the answers are then from the recorded ones,"
        " the inputs being the same (open loop); may be repeated",
    )  # fmt: skip
    options = parser.parse_args(words)
    changed = {}
    for entry in options.set:
        name, equals, value = entry.partition("=")
        if not equals:
            raise InputError(f"--set {entry}: not of the form PARAM=VALUE")
        try:
            changed[name] = read_value(value)
        except yaml.YAMLError:
            raise InputError(f"--set {entry}: {value} is not a value") from None
    fields = replay(options.bag, options.node, changed)
    for order in orders(options.bag, f"{options.node}_node"):
        print(order.line)
    print(text(fields, changed))
    return 0 if changed or same(fields) else 1


def _view(words: list[str]) -> int:
    from emir_analysis.view.command import command

    return command(words, lambda arguments: _hand_over("emir_ros.start", ["view_node", *arguments]))


def _analyze(words: list[str]) -> int:
    from emir_analysis import run_report
    from emir_analysis.outputs import check_outputs, write_all

    parser = argparse.ArgumentParser(
        prog="emir analyze",
        description="Figures of recordings of the graph: tracking error, lag, deflection,"
        " pressures. Several recordings stand side by side.",
    )
    parser.add_argument(
        "bag", type=Path, nargs="+", metavar="BAG", help="recordings of the graph, of one model"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures")
    parser.add_argument(
        "--csv", type=Path, metavar="FILE", help="write the figures, one line for each recording"
    )
    parser.add_argument("--html", type=Path, metavar="FILE", help="write a page with plots")
    parser.add_argument(
        "--picture", type=Path, metavar="FILE",
        help="of the whole robot: draw the way of its TCP",
    )  # fmt: skip
    options = parser.parse_args(words)
    writes = [
        (options.json, run_report.write_json),
        (options.csv, run_report.write_csv),
        (options.html, run_report.write_report),
        (options.picture, run_report.write_path),
    ]
    check_outputs([file for file, _ in writes], None, options.bag)
    runs = [run_report.analyze(bag) for bag in options.bag]
    run_report.check_alike(runs)
    print(run_report.text(runs[0]) if len(runs) == 1 else run_report.comparison(runs))
    failed = write_all((file, partial(write, runs)) for file, write in writes)
    if failed:
        raise IncompleteError(runs, failed)
    return 0


def _compare(words: list[str]) -> int:
    from emir_analysis.compare_command import command, parser

    options = parser().parse_args(words)
    return _said(str, lambda: command(options, _progress))


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
        return _hand_over("emir_ros.start", ["bench", *words[1:]])
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
    from emir_analysis.paper_figures import FIGURES, draw

    everything = ",".join(map(str, FIGURES))
    parser = argparse.ArgumentParser(
        prog="emir figures",
        description="The paper's figures as this machine draws them, and a table (table.md,"
        " table.json) of the paper's numbers beside ours, measured anew.",
    )
    parser.add_argument(
        "--only", default=everything, metavar="N,N", help=f"these figures; default {everything}"
    )
    folder = parser.add_mutually_exclusive_group(required=True)
    folder.add_argument("folder", type=Path, nargs="?", metavar="DIR", help="where to write")
    folder.add_argument("--out", type=Path, metavar="DIR", help="the same, as an option")
    options = parser.parse_args(words)
    numbers = options.only.split(",")
    if not all(number.isdecimal() for number in numbers):
        raise InputError(f"--only {options.only}: not numbers with commas between")
    for file in draw([int(number) for number in numbers], options.folder or options.out, _progress):
        print(file)
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
        model_out=o.model_out, predictions=o.predictions,
    ))  # fmt: skip


def _diagnose_actuator(o: argparse.Namespace) -> int:
    from emir_analysis.diagnosis import actuator

    if o.signals is None:
        raise InputError(f"{o.datasheet}: an actuator needs --signals")
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
        " balance, how large, against what).",
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
    return parser


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
    from emir_analysis.urdf_command import command, parser

    print(command(parser().parse_args(words)))
    return 0


def _progress(line: str) -> None:
    sys.stderr.write(f"{line}\n")


if __name__ == "__main__":
    sys.exit(main())

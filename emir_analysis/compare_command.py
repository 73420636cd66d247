"""`emir compare`: every controller on the same moves, as one table and one picture."""

from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from emir_analysis import compare_grid, compare_results, damping, trade_off, yardstick
from emir_analysis.compare import Run, as_text, controllers, picture, repeated, select
from emir_analysis.compare_grid import NOMINAL, WHOLE, Case, grid
from emir_analysis.control_protocols import Stepping
from emir_analysis.errors import IncompleteError, InputError
from emir_analysis.outputs import check_outputs, check_picture, write_picture
from emir_analysis.paper_claims import order_of_merit
from emir_analysis.unused_options import check_unused
from emir_common.quantity import ParameterError
from emir_control.trajectory import TrajectoryParameters, named
from emir_plant.parameters import cautions
from emir_plant.plant import SimulationError
from emir_plant.sheet import joint1

NO_CSV = "--csv is of a grid: of more than one case"
DEFAULTS = {
    "angle": None, "payload": None, "size": None, "error": None, "trajectory": "lift-lower",
    "repeat": 1, "csv": None,
}  # fmt: skip
OF_CONTROLLERS = {"controllers": None, "pfc": None, "pfc_tip": None}
MODES = {  # and what they have no use for
    "damping": DEFAULTS | OF_CONTROLLERS | {"trade_off": False},
    "trade_off": DEFAULTS,
}

Progress = Callable[[str], None]


def _parser() -> ArgumentParser:
    about = (
        "Every controller on the same moves of the nonlinear machine. Without --angle, --payload,"
        " --size and --error: a grid of 36 cases (45 and 60 deg; 0, 750 and 1500 kg; 20 and"
        " 63.75 mm; three model errors). With any of these: a grid of what they name, the others"
        " at 45 deg, 0 kg, 63.75 mm, none. One case alone gives curves in place of a grid."
    )
    options = ArgumentParser(prog="emir compare", description=about)
    options.add_argument(
        "--angle", type=float, nargs="+", metavar="DEG", help="of the boom at the start"
    )
    options.add_argument(
        "--payload", type=float, nargs="+", metavar="KG",
        help="at the TCP; the controllers are not told how much it is",
    )  # fmt: skip
    options.add_argument(
        "--size", type=float, nargs="+", metavar="MM", help="of the move, stroke of the piston"
    )
    options.add_argument(
        "--error", nargs="+", metavar="NAME",
        help="how the machine differs from what the controllers know: none, 'oil -20%%',"
        " 'oil +20%%', 'return -30%%', 'return +30%%', 'friction 5 kN', 'hysteresis 1%%'",
    )  # fmt: skip
    options.add_argument(
        "--trajectory", default="lift-lower", metavar="NAME",
        help="lift-lower (default) or lower-lift",
    )  # fmt: skip
    options.add_argument(
        "--controllers", nargs="+", metavar="NAME",
        help="some of cascade, zv, zvd, lqg, mpc; 'pfc, WHAT' and 'pfc_tip, WHAT' with preview,"
        " velocity, constant or scheduled for WHAT; default: all",
    )  # fmt: skip
    options.add_argument(
        "--repeat", type=int, default=1, metavar="N",
        help="of one case: mean and deviation of N runs with other sensor noise; default 1",
    )  # fmt: skip
    options.add_argument(
        "--pfc", type=Path, metavar="FILE",
        help="design of pfc, made by emir design; default: that of the project",
    )  # fmt: skip
    options.add_argument("--pfc-tip", type=Path, metavar="FILE", help="the same of pfc_tip")
    options.add_argument("--picture", type=Path, metavar="FILE", help="draw what the table shows")
    options.add_argument(
        "--csv", type=Path, metavar="FILE", help="of a grid: write the figures of every move"
    )
    options.add_argument(
        "--trade-off", action="store_true",
        help="instead: bending over tracking error of the cascade, for 24 pairs of k_p and T,"
        " beside the other controllers",
    )  # fmt: skip
    options.add_argument(
        "--damping", action="store_true",
        help="instead: the machine damped by force feedback, and by a capillary line",
    )  # fmt: skip
    return options


def command(words: Sequence[str], progress: Progress) -> str:
    """Run, draw, return the tables.

    Raises InputError or ParameterError; IncompleteError, with the tables, where the machine cannot
    do some of the cases.
    """
    options = _parser().parse_args(words)
    check_outputs([options.picture, options.csv], None, [options.pfc, options.pfc_tip])
    check_picture(options.picture)
    for mode, usual in MODES.items():
        if getattr(options, mode):
            check_unused(options, usual, f"not with --{mode.replace('_', '-')}")
    if options.damping:
        if options.picture:
            write_picture(options.picture, damping.picture(joint1()))
        return damping.as_text(joint1())
    if options.trade_off:
        others = select(_known(options), options.controllers)
        others.pop("cascade", None)
        curve = trade_off.curve(joint1(), others, progress)
        if options.picture:
            write_picture(options.picture, trade_off.picture(curve))
        return trade_off.as_text(curve)
    chosen = select(_known(options), options.controllers)
    cases = _cases(options)
    if named(options.trajectory, TrajectoryParameters()).parameters.distance == 0.0:
        raise ParameterError(f"trajectory {options.trajectory!r}: nothing moves in it")
    if len(cases) > 1:
        return _grid(chosen, cases, options, progress)
    if options.csv:
        raise InputError(NO_CSV)
    return _one(chosen, cases[0], options, progress)


def _known(options: Namespace) -> dict[str, Stepping]:
    """Return every controller, those of `emir yardstick` made for this machine."""
    known, machine = controllers(options.pfc, options.pfc_tip), joint1()
    as_it_is = replace(
        yardstick.EVERYDAY,
        delay=0.0,
        hysteresis=0.0,
        supply=machine.supply.p0,
        threshold=machine.logic_block.threshold,
    )
    others = yardstick.controllers(machine, as_it_is)
    return known | {k: loop for k, loop in others.items() if f"{k}, preview" not in known}


def _cases(options: Namespace) -> list[Case]:
    """Return the whole grid, or what is asked for, the rest of it as usual."""
    given = {name: getattr(options, name) for name in NOMINAL}
    instead = NOMINAL if any(given.values()) else WHOLE
    if options.repeat < 1:
        raise ParameterError(f"repeat = {options.repeat}: at least 1")
    cases = grid({name: given[name] or instead[name] for name in NOMINAL})
    for case in cases:
        case.machine(joint1())  # what is out of range is told before any work
    return cases


def _grid(
    chosen: dict[str, Stepping], cases: list[Case], options: Namespace, progress: Progress
) -> str:
    if options.repeat > 1:
        raise InputError("--repeat is for one case: a grid varies enough")
    found, left_out = compare_grid.results(joint1(), chosen, cases, progress, options.trajectory)
    if options.picture:
        write_picture(options.picture, compare_results.picture(found))
    if options.csv:
        compare_results.write_csv(found, options.csv)
    count = len({result.case for result in found})
    table, claims = compare_results.as_text(found), order_of_merit(found)
    text = f"{count} cases; median / worst\n\n{table}\n\n{claims}".rstrip()
    if left_out:
        told = f"{len(left_out)} of {len(cases)} cases left out; the first: {left_out[0]}"
        raise IncompleteError(text, [InputError(told)])
    return text


def _one(chosen: dict[str, Stepping], case: Case, options: Namespace, progress: Progress) -> str:
    """Return the table of one case."""
    title = str(case)
    machine = case.machine(joint1())
    given = TrajectoryParameters(distance=case.size * 1e-3)
    trajectory = named(options.trajectory, given)
    for line in cautions(machine):
        progress(line)
    runs: dict[str, list[Run]] = {}
    try:
        for name, outer in chosen.items():
            progress(f"{title}: {name}")
            runs[name] = list(repeated(machine, trajectory, outer, case.start, options.repeat))
    except SimulationError as error:
        raise InputError(f"{title}: {error}") from None
    if options.picture:
        write_picture(options.picture, picture({name: found[0] for name, found in runs.items()}))
    return f"{title}\n\n{as_text(runs)}"

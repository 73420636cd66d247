"""`emir limit`: the smallest dynamic deflection of the TCP that any command could reach."""

import math
from argparse import ArgumentParser
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from emir_analysis.limit import PAPER_MOVE, Move, least, turn
from emir_analysis.outputs import check_outputs, check_picture, write_picture
from emir_analysis.report import new_figure
from emir_common.parameter_tree import with_values
from emir_control.least_bending import STEP, Motion
from emir_plant.sheet import joint1


def command(words: Sequence[str]) -> str:
    """Return the figures as text, draw the motion. Raises InputError or ParameterError."""
    options = _parser().parse_args(words)
    check_outputs([options.picture], None, [])
    check_picture(options.picture)
    machine = with_values(joint1(), {"geometry.payload": options.payload})
    move = Move(math.radians(options.angle), options.stroke * 1e-3, options.duration)
    found = least(machine, move)
    if options.picture:
        arm = move.stroke / turn(machine, move)
        write_picture(options.picture, picture(found, arm))
    return (
        f"{options.angle:g} deg, {options.payload:g} kg, {options.stroke:g} mm in"
        f" {options.duration:g} s: no command bends the boom by less than"
        f" {found.largest * 100.0:.2f} cm"
    )


def _parser() -> ArgumentParser:
    parser = ArgumentParser(
        prog="emir limit",
        description="The smallest dynamic deflection of the TCP that any command could reach for a"
        " move: a linear program over the joint's acceleration (docs/limit.md).",
    )
    parser.add_argument(
        "--angle", type=float, default=45.0, metavar="DEG",
        help="of the boom at the start; default 45",
    )  # fmt: skip
    parser.add_argument(
        "--payload", type=float, default=0.0, metavar="KG", help="at the TCP; default 0"
    )
    parser.add_argument(
        "--stroke", type=float, default=PAPER_MOVE.distance * 1e3, metavar="MM",
        help="of the piston, lifting positive; default 63.75",
    )  # fmt: skip
    parser.add_argument(
        "--duration", type=float, default=PAPER_MOVE.duration, metavar="S",
        help="of the move; default 3.3",
    )  # fmt: skip
    parser.add_argument(
        "--picture", type=Path, metavar="FILE", help="draw the motion that reaches it"
    )
    return parser


def picture(motion: Motion, arm: float) -> Figure:
    """Return piston velocity and dynamic deflection over time. arm: m, piston per joint."""
    figure = new_figure(5.0)
    velocity, deflection = figure.subplots(2, 1, sharex=True)
    time = STEP * np.arange(len(motion.rate))
    velocity.plot(time, motion.rate * arm * 1e3, lw=1.0)
    velocity.set_ylabel("piston velocity / mm/s")
    deflection.plot(time, motion.deflection * 1e2)
    deflection.set_ylabel("dynamic deflection of the TCP / cm")
    deflection.set_xlabel("time / s")
    for axes in (velocity, deflection):
        axes.grid(visible=True, alpha=0.3)
    return figure

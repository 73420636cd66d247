"""`emir yardstick`: controllers against what the boom allows, over random draws of the machine."""

import dataclasses
import json
import math
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from emir_analysis.compare import select
from emir_analysis.outputs import check_outputs, check_picture, write_picture, write_text
from emir_analysis.report import new_figure
from emir_analysis.yardstick import (
    AIM_HARD,
    AIM_RATIO,
    EVERYDAY,
    HARD,
    Draw,
    Score,
    controllers,
    draws,
    score,
    smallest,
)
from emir_common.quantity import ParameterError
from emir_plant.sheet import joint1

Progress = Callable[[str], None]
Scores = dict[str, list[Score]]

FIGURES = (  # field, title, factor to the unit shown
    ("ratio", "R", 1.0),
    ("settled", "1 s after / cm", 100.0),
    ("position", "TCP error / cm", 100.0),
    ("taken", "time 2-98 % / s", 1.0),
)
SHOWN = 5.0  # largest R in the picture


def command(words: Sequence[str], progress: Progress) -> str:
    """Draw, run, write, return the table. Raises InputError or ParameterError."""
    options = _parser().parse_args(words)
    check_outputs([options.picture, options.json], None, [])
    check_picture(options.picture)
    if options.draws < 1:
        raise ParameterError(f"draws = {options.draws}: at least 1")
    if options.seed < 0:
        raise ParameterError(f"seed = {options.seed}: 0 or more")
    among = dataclasses.replace(HARD if options.hard else EVERYDAY, supply=options.supply * 1e5)
    aim = AIM_HARD if options.hard else AIM_RATIO
    machine = joint1()
    loops = select(controllers(machine, among), options.controllers)
    scores: Scores = {name: [] for name in loops}
    done: list[tuple[Draw, float]] = []
    for draw in draws(machine, options.draws, options.seed, among):
        limit = smallest(draw)
        done.append((draw, limit))
        for name, outer in loops.items():
            scores[name].append(score(draw, outer, limit, among))
        shown = ", ".join(f"{name} {found[-1].ratio:.2f}" for name, found in scores.items())
        progress(f"draw {len(done)} of {options.draws}: R of {shown}")
    if options.picture:
        write_picture(options.picture, picture(scores, done, aim))
    if options.json:
        _write(options.json, as_numbers(scores, done, options))
    return as_text(scores, aim)


def _parser() -> ArgumentParser:
    parser = ArgumentParser(
        prog="emir yardstick",
        description="Controllers against the limit, over random draws of the machine: R is the"
        " largest dynamic deflection in a run over the smallest that any command could reach for"
        " the same move (docs/limit.md).",
    )
    parser.add_argument(
        "--draws", type=int, default=20, metavar="N", help="how many machines; default 20"
    )
    parser.add_argument(
        "--seed", type=int, default=0, metavar="K",
        help="which machines: the same number, the same machines; default 0",
    )  # fmt: skip
    parser.add_argument(
        "--controllers", nargs="+", metavar="NAME",
        help="some of cascade, zv, zvd, pfc, pfc_tip, mpc, lqg; default: all",
    )  # fmt: skip
    parser.add_argument(
        "--supply", type=float, default=EVERYDAY.supply / 1e5, metavar="BAR",
        help=f"pump pressure, default {EVERYDAY.supply / 1e5:g}; 200 do not lift 1500 kg at 30 deg",
    )  # fmt: skip
    parser.add_argument(
        "--hard", action="store_true",
        help="draw hard cases alone: empty, 60-75 deg, lowering, logic block at 80 bar",
    )  # fmt: skip
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every draw's figures")
    parser.add_argument("--picture", type=Path, metavar="FILE", help="draw R of every machine")
    return parser


def as_text(scores: Scores, aim: float) -> str:
    """Return a table in the form of Markdown: median and largest, share of draws that meet."""
    titles = [f"{title}, {what}" for _, title, _ in FIGURES[:3] for what in ("median", "largest")]
    head = ["controller", *titles, FIGURES[3][1], f"R <= {aim:g}", "aim met"]
    lines = ["| " + " | ".join(head) + " |", "| --- |" + " ---: |" * (len(head) - 1)]
    for name, found in scores.items():
        cells = [name]
        for field, _, factor in FIGURES[:3]:
            values = [getattr(each, field) * factor for each in found]
            cells += [_number(float(np.median(values))), _number(max(values))]
        cells.append(_number(float(np.median([each.taken for each in found]))))
        cells.append(f"{sum(each.ratio <= aim for each in found)} of {len(found)}")
        cells.append(f"{sum(each.meets(aim) for each in found)} of {len(found)}")
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _number(value: float) -> str:
    return f"{value:.2f}" if math.isfinite(value) else "-"


def as_numbers(
    scores: Scores, done: Sequence[tuple[Draw, float]], options: Namespace
) -> dict[str, Any]:
    """Return every draw with its figures, SI units."""
    rows = []
    for k, (draw, limit) in enumerate(done):
        m = draw.machine
        rows.append({
            "angle": draw.angle, "stroke": draw.stroke, "payload": m.geometry.payload,
            "beta": m.cylinder.beta, "friction": m.effects.coulomb_friction.force,
            "k_meter_out_lifting": m.resistances.k_meter_out_lifting,
            "k_meter_out_lowering": m.resistances.k_meter_out_lowering,
            "smallest_deflection": limit,
            "scores": {name: _finite(found[k]) for name, found in scores.items()},
        })  # fmt: skip
    return {"seed": options.seed, "hard": options.hard, "supply": options.supply, "draws": rows}


def _finite(found: Score) -> dict[str, float | None]:
    """Return a score's figures; None where there is none, as JSON knows no infinity."""
    items = dataclasses.asdict(found).items()
    return {name: value if math.isfinite(value) else None for name, value in items}


def picture(scores: Scores, done: Sequence[tuple[Draw, float]], aim: float) -> Figure:
    """Return R of every draw: sorted, and the last controller's over the stiffness of the oil."""
    figure = new_figure(4.2)
    ordered, spread = figure.subplots(1, 2)
    for name, found in scores.items():
        values = sorted(min(each.ratio, SHOWN) for each in found)
        ordered.plot(np.arange(1, len(values) + 1), values, marker=".", label=name)
    ordered.axhline(aim, color="0.5", ls="--", lw=1.0)
    ordered.set_xlabel("draws, sorted")
    ordered.set_ylabel(f"R (above {SHOWN:g} shown as {SHOWN:g})")
    ordered.legend(frameon=False, fontsize="small")
    name, found = list(scores.items())[-1]
    for sign, marker, title in ((1, "^", "lifting"), (-1, "v", "lowering")):
        kept = [k for k, (draw, _) in enumerate(done) if draw.stroke * sign > 0.0]
        spread.scatter(
            [done[k][0].machine.cylinder.beta / 1e6 for k in kept],
            [min(found[k].ratio, SHOWN) for k in kept], marker=marker, s=16, label=title,
        )  # fmt: skip
    spread.axhline(aim, color="0.5", ls="--", lw=1.0)
    spread.set_xlabel("stiffness of the oil, beta / MPa")
    spread.set_ylabel(f"R of {name}")
    spread.legend(frameon=False, fontsize="small")
    for axes in (ordered, spread):
        axes.grid(visible=True, alpha=0.3)
    return figure


def _write(file: Path, content: dict[str, Any]) -> None:
    write_text(file, json.dumps(content, indent=1) + "\n")

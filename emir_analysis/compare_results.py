"""What the controllers made of a grid: a table of medians and worst values, a picture, a file."""

import csv
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from emir_analysis.compare_grid import Result
from emir_analysis.outputs import written
from emir_analysis.report import new_figure

COLUMNS: tuple[tuple[str, Callable[[Result], float]], ...] = (
    ("error rms / mm", lambda r: r.figures.error_rms * 1e3),
    ("error peak / mm", lambda r: r.figures.error * 1e3),
    ("lag / s", lambda r: r.figures.lag),
    ("bending / cm", lambda r: r.figures.bending * 1e2),
    ("1 s after / cm", lambda r: r.figures.settled * 1e2),
    ("settling / s", lambda r: r.figures.settling),
    ("dv/dt / mm/s2", lambda r: r.figures.roughness * 1e3),
    ("valve travel", lambda r: r.figures.travel),
    ("oil / l", lambda r: r.figures.oil * 1e3),
    ("gain margin", lambda r: r.margin),
)
BIG_IS_GOOD = ("gain margin",)


def as_text(found: Sequence[Result]) -> str:
    """Return median and worst of each controller and direction, in the form of Markdown."""
    lines = ["| controller | move | " + " | ".join(title for title, _ in COLUMNS) + " |"]
    lines.append("| --- | --- |" + " ---: |" * len(COLUMNS))
    for (name, way), group in _grouped(found):
        cells = [_cell(title, [value(r) for r in group]) for title, value in COLUMNS]
        lines.append(f"| {name} | {way} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _grouped(found: Sequence[Result]) -> Iterator[tuple[tuple[str, str], list[Result]]]:
    for name in dict.fromkeys(r.controller for r in found):
        for way in ("lift", "lower"):
            yield (
                (name, way),
                [r for r in found if (r.controller, r.direction) == (name, way)],
            )


def _cell(title: str, values: Sequence[float]) -> str:
    """Return median and worst."""
    there = [value for value in values if not math.isnan(value)] or [math.nan]
    worst = min(there) if title in BIG_IS_GOOD else max(there, key=abs)
    return f"{_number(float(np.median(there)))} / {_number(worst)}"


def _number(value: float) -> str:
    return f"{value:.2f}" if math.isfinite(value) else "-"


def picture(found: Sequence[Result]) -> Figure:
    """Return each figure of every move: a column a controller, a colour a payload."""
    shown = [c for c in COLUMNS if not c[0].startswith(("lag", "oil"))]
    figure = new_figure(11.0)
    panels = figure.subplots(4, 2, sharex=True).ravel()
    names = list(dict.fromkeys(r.controller for r in found))
    payloads = sorted({r.case.payload for r in found})
    for axis, (title, value) in zip(panels, shown, strict=True):
        for k, payload in enumerate(payloads):
            for way, marker in (("lift", "^"), ("lower", "v")):
                group = [r for r in found if (r.case.payload, r.direction) == (payload, way)]
                places = [names.index(r.controller) + 0.22 * (k - 1) for r in group]
                axis.scatter(
                    places, [value(r) for r in group], s=14, marker=marker, color=f"C{k}",
                    alpha=0.7, linewidths=0, label=f"{payload:g} kg, {way}",
                )  # fmt: skip
        axis.set(ylabel=title, yscale="log")
        axis.grid(visible=True, axis="y", alpha=0.3)
    for axis in panels[-2:]:
        axis.set_xticks(range(len(names)), names, rotation=30, ha="right", fontsize="small")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside upper center", ncols=3, frameon=False, fontsize="small"
    )
    return figure


def write_csv(found: Sequence[Result], file: Path) -> None:
    """Write every move, one line each, SI units. Raises InputError where that is not possible."""
    rows = [
        {
            "controller": r.controller,
            **{f"case_{name}": value for name, value in asdict(r.case).items()},
            "move": r.direction,
        }
        | asdict(r.figures)
        | {"bending": r.figures.bending, "gain_margin": r.margin}
        for r in found
    ]
    with written(file), file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)

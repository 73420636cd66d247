"""A report as one self-contained HTML file: text, tables, pictures, plots; nothing to download."""

import base64
import html
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import plotly.graph_objects as go
import plotly.io
from matplotlib.figure import Figure

from emir_analysis.outputs import write_text

WIDTH = 9.0  # inch, of every picture, so that their letters have one size

_STYLE = """
:root { color-scheme: light; --ink: #1d2733; --soft: #5b6875; --line: #dfe4e9; --mark: #0b6bb5; }
body { margin: 0; background: #f3f5f7; color: var(--ink);
       font: 16px/1.5 system-ui, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif; }
main { max-width: 60rem; margin: 2rem auto; padding: 1.5rem 2.5rem 2.5rem; background: #fff;
       border: 1px solid var(--line); border-radius: 10px; }
h1 { font-size: 1.7rem; line-height: 1.25; margin: 0.5rem 0 1rem; }
h2 { font-size: 1.15rem; margin: 2.2rem 0 0.6rem; padding-top: 0.9rem;
     border-top: 1px solid var(--line); }
p { margin: 0.5rem 0; max-width: 46rem; white-space: pre-line; }
p.lead { padding: 0.8rem 1.1rem; max-width: none; font-size: 1.05rem; background: #eef5fb;
         border-left: 4px solid var(--mark); border-radius: 4px; }
figure { margin: 1rem 0; overflow-x: auto; }
figure img { width: 100%; height: auto; }
figcaption { color: var(--soft); font-size: 0.92rem; }
table { border-collapse: collapse; font-size: 0.94rem; font-variant-numeric: tabular-nums; }
th, td { padding: 0.3rem 0.8rem; text-align: left; border-bottom: 1px solid var(--line); }
th { color: var(--soft); font-weight: 600; border-bottom-color: #aab4be; }
td.number, th.number { text-align: right; }
"""


@dataclass(frozen=True)
class Heading:
    """The title of a section."""

    text: str


@dataclass(frozen=True)
class Text:
    """A paragraph; line breaks are kept. lead: set off as the report's main statement."""

    text: str
    lead: bool = False


@dataclass(frozen=True)
class Table:
    """Rows of cells under their column names; floats with three digits, NaN as nothing."""

    columns: Sequence[str]
    rows: Sequence[Sequence[str | float]]
    caption: str = ""


@dataclass(frozen=True)
class Picture:
    """A matplotlib figure (made by `new_figure`) and what it shows."""

    figure: Figure
    caption: str = ""


@dataclass(frozen=True)
class Plot:
    """A plotly figure: whoever reads it can zoom, pan and read off values."""

    figure: go.Figure
    caption: str = ""


Block = Heading | Text | Table | Picture | Plot


def new_figure(height: float) -> Figure:
    """Return an empty figure of the report's width and the given height, inch."""
    return Figure(figsize=(WIDTH, height), layout="constrained")


def write_html(path: Path, title: str, blocks: Sequence[Block]) -> None:
    """Write the blocks under the title as one HTML file.

    Raises InputError when the file cannot be written.
    """
    plots = [block for block in blocks if isinstance(block, Plot)]
    body = "\n".join(
        _plot(block, plots.index(block)) if isinstance(block, Plot) else _html(block)
        for block in blocks
    )
    page = (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{html.escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n"
        f"<body><main>\n<h1>{html.escape(title)}</h1>\n{body}\n</main></body>\n</html>\n"
    )
    write_text(path, page)


def _html(block: Heading | Text | Table | Picture) -> str:
    match block:
        case Heading(text):
            return f"<h2>{html.escape(text)}</h2>"
        case Text(text, lead):
            return f"<p{' class=lead' if lead else ''}>{html.escape(text)}</p>"
        case Table():
            return _table(block)
        case Picture():
            return _picture(block)


def _table(table: Table) -> str:
    numeric = [
        any(isinstance(row[k], float | int) for row in table.rows)
        for k in range(len(table.columns))
    ]

    def line(cells: Sequence[str | float], tag: str) -> str:
        return "".join(
            f"<{tag}{' class=number' if number else ''}>{html.escape(_cell(cell))}</{tag}>"
            for cell, number in zip(cells, numeric, strict=True)
        )

    rows = "\n".join(f"<tr>{line(row, 'td')}</tr>" for row in table.rows)
    caption = f"<figcaption>{html.escape(table.caption)}</figcaption>" if table.caption else ""
    return (
        f"<figure><table>\n<thead><tr>{line(table.columns, 'th')}</tr></thead>\n"
        f"<tbody>\n{rows}\n</tbody></table>{caption}</figure>"
    )


def _cell(cell: str | float) -> str:
    if not isinstance(cell, float):
        return str(cell)
    return "" if math.isnan(cell) else f"{cell:.3g}"


def _picture(picture: Picture) -> str:
    image = io.BytesIO()
    picture.figure.savefig(image, format="png", dpi=140)
    data = base64.b64encode(image.getvalue()).decode("ascii")
    caption = html.escape(picture.caption)
    return (
        f'<figure><img alt="{caption}" src="data:image/png;base64,{data}">'
        f"<figcaption>{caption}</figcaption></figure>"
    )


def _plot(plot: Plot, number: int) -> str:
    """Return a plot; the first brings plotly's code, which draws all of them."""
    drawn = plotly.io.to_html(
        plot.figure,
        full_html=False,
        include_plotlyjs=number == 0,
        div_id=f"plot{number}",
        config={"displaylogo": False, "responsive": True},
    )
    return f"<figure>{drawn}<figcaption>{html.escape(plot.caption)}</figcaption></figure>"

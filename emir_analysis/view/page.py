"""The page: a machine in 3D, readings, plots over time. `viser` serves it and draws."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import viser
from viser import uplot

MOST_POINTS = 1000  # of a plot's line: a screen has not many more
FAINT = "#b7c0c8"
MARGIN = 0.05  # of a plot's height, above and below its lines


@dataclass(frozen=True)
class Chart:
    """A plot over time: a title and fields of a frame with label, factor and colour."""

    title: str
    lines: tuple[tuple[str, str, float, str], ...]


class Subject(Protocol):
    """A machine that can be shown. Its frames are named tuples of floats; nan: not known."""

    @property
    def charts(self) -> tuple[Chart, ...]:
        """Return its plots."""

    @property
    def reach(self) -> float:
        """Return how far it stretches, m."""

    def readings(self, frame: Any) -> list[tuple[str, float, str, int]]:
        """Return what is shown in numbers: name, value, unit, digits."""

    def draw(self, scene: viser.SceneApi, frame: Any, bending: float) -> None:
        """Draw the machine, its bending so many times as large."""


class Page:
    """Scene and plots of one machine on a viser server."""

    def __init__(self, server: viser.ViserServer, subject: Subject, title: str) -> None:
        self._subject = subject
        server.gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
        server.gui.main_panel.dock_right()
        server.gui.set_panel_label(title)
        scene, reach = server.scene, subject.reach
        scene.set_up_direction("+z")
        server.initial_camera.position = (0.45 * reach, -1.2 * reach, 0.45 * reach)
        server.initial_camera.look_at = (0.42 * reach, 0.0, 0.3 * reach)
        scene.add_grid("/ground", 60.0, 60.0, plane="xy", cell_size=1.0, section_size=5.0,
                       position=(0.0, 0.0, -1.6))  # fmt: skip
        self._scene = scene
        self._note = server.gui.add_markdown("", visible=False)
        self._readings = server.gui.add_markdown("")
        self.bending = server.gui.add_slider("bending drawn times", 1, 20, 1, 5)
        self._charts = [self._add_chart(server, chart) for chart in subject.charts]

    @property
    def readings(self) -> str:
        """Return the numbers that are shown, as Markdown."""
        return self._readings.content

    @property
    def note(self) -> str:
        """Return what is said above the numbers, as Markdown."""
        return self._note.content

    def say(self, note: str) -> None:
        """Say something above the numbers, in Markdown, or nothing."""
        if note != self._note.content:
            self._note.content, self._note.visible = note, bool(note)

    def show(self, frame: Any) -> None:
        """Draw the machine as it is in the frame."""
        self._readings.content = table(self._subject.readings(frame))
        self._subject.draw(self._scene, frame, self.bending.value)

    def plot(self, history: Sequence[Any], now: float) -> None:
        """Draw the history over time; what is later than `now`, s, is faint."""
        chosen = history[:: 1 + len(history) // MOST_POINTS]
        fields = history[0]._fields
        columns = {name: np.array([getattr(frame, name) for frame in chosen]) for name in fields}
        past = columns["time"] <= now
        for handle, chart in zip(self._charts, self._subject.charts, strict=True):
            data = [columns["time"]]
            for name, _, factor, _ in chart.lines:
                value = columns[name] * factor
                data += [value, np.where(past, value, np.nan)]
            shown = (float(data[0][0]), float(data[0][-1]))
            scales = {
                "x": uplot.Scale(time=False, range=shown),
                "y": uplot.Scale(range=span(data[1::2])),
            }
            if scales != handle.scales:  # with another range the plot is begun anew
                handle.scales = scales
            handle.data = tuple(data)

    def _add_chart(self, server: viser.ViserServer, chart: Chart) -> viser.GuiUplotHandle:
        series = [uplot.Series(label="t / s")]
        for _, label, _, color in chart.lines:
            series.append(uplot.Series(label=f"{label} (all)", stroke=FAINT, width=1))
            series.append(uplot.Series(label=label, stroke=color, width=2))
        empty = tuple(np.array([0.0, 1.0]) for _ in series)
        return server.gui.add_uplot(
            empty, tuple(series), title=chart.title, aspect=2.2,
            scales={"x": uplot.Scale(time=False)}, legend=uplot.Legend(show=False),
        )  # fmt: skip


def span(lines: Sequence[np.ndarray]) -> tuple[float, float]:
    """Return what of the vertical axis lines, (n,) each, take with their margin.

    uPlot itself would find none where one of them begins with a nan.
    """
    known = np.concatenate(lines)
    known = known[np.isfinite(known)]
    if not known.size:
        return 0.0, 1.0
    low, high = float(known.min()), float(known.max())
    room = MARGIN * (high - low) or 1.0
    return low - room, high + room


def table(readings: Sequence[tuple[str, float, str, int]]) -> str:
    """Return name, value, unit as a table in Markdown, a dash for what is not known."""
    lines = ["| | | |", "|---|---:|---|"]
    for name, value, unit, digits in readings:
        shown = "-" if np.isnan(value) else f"{value:.{digits}f}"
        lines.append(f"| {name} | {shown} | {unit} |")
    return "\n".join(lines)

"""The page: the arm in 3D, readings, plots over time. `viser` serves it and draws."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import viser
from viser import uplot

from emir_analysis.view.arm import Outline, centreline, cylinder
from emir_analysis.view.frames import Frame

MOST_POINTS = 1000  # of a plot's line: a screen has not many more
BOOM, STRAIGHT, CYLINDER = (209, 98, 43), (160, 168, 176), (11, 107, 181)
OPEN, SHUT = (46, 139, 87), (194, 24, 91)
FAINT = "#b7c0c8"


@dataclass(frozen=True)
class Chart:
    """A plot over time: a title and fields of Frame with label, factor and colour."""

    title: str
    lines: tuple[tuple[str, str, float, str], ...]


CHARTS = (
    Chart("stroke / mm", (
        ("reference_stroke", "h_d", 1e3, "#8a939c"), ("stroke", "h", 1e3, "#0b6bb5"),
    )),
    Chart("pressure / bar", (
        ("pressure_lifting", "lifting", 1e-5, "#0b6bb5"),
        ("pressure_lowering", "lowering", 1e-5, "#d1622b"),
    )),
    Chart("valve, logic block / %", (
        ("valve_command", "valve", 100.0, "#2e8b57"),
        ("logic_block", "logic block", 100.0, "#8e44ad"),
    )),
    Chart("TCP deflection / cm", (("tcp_deflection", "deflection", 100.0, "#d1622b"),)),
)  # fmt: skip


class Page:
    """Scene and plots of one machine on a viser server."""

    def __init__(self, server: viser.ViserServer, outline: Outline, title: str) -> None:
        self._outline = outline
        server.gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
        server.gui.main_panel.dock_right()
        server.gui.set_panel_label(title)
        scene, reach = server.scene, outline.boom
        scene.set_up_direction("+z")
        server.initial_camera.position = (0.45 * reach, -1.2 * reach, 0.45 * reach)
        server.initial_camera.look_at = (0.42 * reach, 0.0, 0.3 * reach)
        scene.add_grid("/ground", 60.0, 60.0, plane="xy", cell_size=1.0, section_size=5.0,
                       position=(0.0, 0.0, -1.6))  # fmt: skip
        self._scene = scene
        self._readings = server.gui.add_markdown("")
        self.bending = server.gui.add_slider("bending drawn times", 1, 20, 1, 5)
        self._charts = [self._add_chart(server, chart) for chart in CHARTS]

    @property
    def readings(self) -> str:
        """Return the numbers that are shown, as Markdown."""
        return self._readings.content

    def show(self, frame: Frame) -> None:
        """Draw the machine as it is in the frame."""
        self._readings.content = readings(frame)
        if np.isnan(frame.angle):
            return
        bent = 0.0 if np.isnan(frame.tcp_deflection) else frame.tcp_deflection
        points = centreline(self._outline, frame.angle, bent * self.bending.value)
        straight = centreline(self._outline, frame.angle, 0.0)[[0, -1]]
        foot, eye = cylinder(self._outline, frame.angle)
        line = self._scene.add_line_segments
        pairs = np.stack([points[:-1], points[1:]], axis=1)
        line("/boom", pairs.astype(np.float32), BOOM, thickness=0.35)
        line("/straight", straight[None].astype(np.float32), STRAIGHT, thickness=0.06)
        line("/cylinder", np.stack([foot, eye])[None].astype(np.float32), CYLINDER, thickness=0.3)
        is_open = np.isnan(frame.logic_block) or frame.logic_block > 0.5  # noqa: PLR2004 (half)
        self._scene.add_icosphere(
            "/logic_block", radius=0.3, color=OPEN if is_open else SHUT, position=tuple(foot)
        )
        self._scene.add_icosphere("/tcp", radius=0.3, color=BOOM, position=tuple(points[-1]))

    def plot(self, history: Sequence[Frame], now: float) -> None:
        """Draw the history over time; what is later than `now`, s, is faint."""
        chosen = history[:: 1 + len(history) // MOST_POINTS]
        columns = {
            name: np.array([getattr(frame, name) for frame in chosen]) for name in Frame._fields
        }
        past = columns["time"] <= now
        for handle, chart in zip(self._charts, CHARTS, strict=True):
            data = [columns["time"]]
            for name, _, factor, _ in chart.lines:
                value = columns[name] * factor
                data += [value, np.where(past, value, np.nan)]
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


def readings(frame: Frame) -> str:
    """Return the numbers of a frame as a table in Markdown, a dash for what is not known."""
    rows = (
        ("time", frame.time, 1.0, "s", 2),
        ("joint angle", np.degrees(frame.angle), 1.0, "deg", 2),
        ("stroke", frame.stroke, 1e3, "mm", 1),
        ("wanted", frame.reference_stroke, 1e3, "mm", 1),
        ("valve", frame.valve_command, 100.0, "%", 1),
        ("lifting chamber", frame.pressure_lifting, 1e-5, "bar", 1),
        ("lowering chamber", frame.pressure_lowering, 1e-5, "bar", 1),
        ("logic block open", frame.logic_block, 100.0, "%", 0),
        ("TCP deflection", frame.tcp_deflection, 100.0, "cm", 2),
    )
    lines = ["| | | |", "|---|---:|---|"]
    for name, value, factor, unit, digits in rows:
        shown = "-" if np.isnan(value) else f"{value * factor:.{digits}f}"
        lines.append(f"| {name} | {shown} | {unit} |")
    return "\n".join(lines)

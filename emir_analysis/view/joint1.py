"""Joint 1 on the page: boom, cylinder, logic block."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import viser

from emir_analysis.view.arm import Outline, centreline, cylinder
from emir_analysis.view.frames import Frame
from emir_analysis.view.page import Chart

BOOM, STRAIGHT, CYLINDER = (209, 98, 43), (160, 168, 176), (11, 107, 181)
OPEN, SHUT = (46, 139, 87), (194, 24, 91)
HALF_OPEN = 0.5


@dataclass(frozen=True)
class Joint1:
    """The main joint with the stretched boom."""

    charts: ClassVar[tuple[Chart, ...]] = (
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

    outline: Outline

    @property
    def reach(self) -> float:
        """Return how far it stretches, m."""
        return self.outline.boom

    def readings(self, frame: Frame) -> list[tuple[str, float, str, int]]:
        """Return what is shown in numbers: name, value, unit, digits."""
        return [
            ("time", frame.time, "s", 2),
            ("joint angle", float(np.degrees(frame.angle)), "deg", 2),
            ("stroke", frame.stroke * 1e3, "mm", 1),
            ("wanted", frame.reference_stroke * 1e3, "mm", 1),
            ("valve", frame.valve_command * 100.0, "%", 1),
            ("lifting chamber", frame.pressure_lifting * 1e-5, "bar", 1),
            ("lowering chamber", frame.pressure_lowering * 1e-5, "bar", 1),
            ("logic block open", frame.logic_block * 100.0, "%", 0),
            ("TCP deflection", frame.tcp_deflection * 100.0, "cm", 2),
        ]

    def draw(self, scene: viser.SceneApi, frame: Frame, bending: float) -> None:
        """Draw boom and cylinder, the boom's bending so many times as large."""
        if np.isnan(frame.angle):
            return
        bent = 0.0 if np.isnan(frame.tcp_deflection) else frame.tcp_deflection
        points = centreline(self.outline, frame.angle, bent * bending)
        straight = centreline(self.outline, frame.angle, 0.0)[[0, -1]]
        foot, eye = cylinder(self.outline, frame.angle)
        polyline(scene, "/boom", points, BOOM, 0.35)
        polyline(scene, "/straight", straight, STRAIGHT, 0.06)
        polyline(scene, "/cylinder", np.stack([foot, eye]), CYLINDER, 0.3)
        is_open = np.isnan(frame.logic_block) or frame.logic_block > HALF_OPEN
        ball(scene, "/logic_block", foot, OPEN if is_open else SHUT)
        ball(scene, "/tcp", points[-1], BOOM)


Color = tuple[int, int, int]


def polyline(
    scene: viser.SceneApi, name: str, points: np.ndarray, color: Color, width: float
) -> None:
    """Draw a line through points, (n, 3), m; width in m."""
    pairs = np.stack([points[:-1], points[1:]], axis=1).astype(np.float32)
    scene.add_line_segments(name, pairs, color, thickness=width)


def ball(scene: viser.SceneApi, name: str, place: np.ndarray, color: Color) -> None:
    """Draw a ball at a place, (3,), m."""
    x, y, z = map(float, place)
    scene.add_icosphere(name, radius=0.3, color=color, position=(x, y, z))

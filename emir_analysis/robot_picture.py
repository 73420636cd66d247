"""The way of the robot's TCP as a picture: planned, measured, and how far apart over time."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from emir_analysis.report import new_figure
from emir_analysis.robot_metrics import path_error, reference, tcp, tcp_error, tilt
from emir_analysis.run_plots import COLORS, WANTED
from emir_analysis.signals import Recording

Array = NDArray[np.float64]

LAYOUT = "sa;ee;tt"  # side, above; error; tilt
LEAST_WAY = 0.1  # m, that has a direction
HEIGHTS = (2.4, 1.5, 1.1)


def path_picture(runs: Mapping[str, Recording]) -> Figure:
    """Return the TCP's way from the side and from above, and its errors, of runs by name."""
    figure = new_figure(7.5)
    axes = figure.subplot_mosaic(LAYOUT, height_ratios=HEIGHTS)
    for k, (name, run) in enumerate(runs.items()):
        color, label = COLORS[k % len(COLORS)], f"{name}: " if len(runs) > 1 else ""
        start, ahead = reference(run)[0, :2], _ahead(reference(run))

        def side(places: Array, start: Array = start, ahead: Array = ahead) -> tuple[Array, Array]:
            return (places[:, :2] - start) @ ahead, places[:, 2]

        for view, seen in (("s", side), ("a", _above)):
            planned, way = f"{label}planned", seen(reference(run))
            axes[view].plot(*way, "--", color=WANTED, linewidth=2.5, label=planned)
            axes[view].plot(*seen(tcp(run)), color=color, label=f"{label}measured")
            axes[view].plot(*seen(reference(run)[:1]), "o", color=WANTED)
        time = run["tcp_reference_x"].time
        axes["e"].plot(time, 1e2 * path_error(run), color=color, label=f"{label}off the path")
        off = f"{label}off the reference"
        axes["e"].plot(time, 1e2 * tcp_error(run), ":", color=color, label=off)
        axes["t"].plot(time, 1e3 * tilt(run), color=color)
    _name(axes)
    return figure


def _above(places: Array) -> tuple[Array, Array]:
    return places[:, 0], places[:, 1]


def _ahead(places: Array) -> Array:
    """Return the horizontal direction, (2,), in which the way leads; outwards without."""
    far = places[np.argmax(np.linalg.norm(places - places[0], axis=1)), :2] - places[0, :2]
    way = far if np.linalg.norm(far) > LEAST_WAY else places[0, :2]
    return np.asarray(way / max(float(np.linalg.norm(way)), LEAST_WAY))


def _name(axes: Mapping[str, Axes]) -> None:
    axes["s"].set(xlabel="along the way / m", ylabel="up / m", title="from the side")
    axes["a"].set(xlabel="x, forward / m", ylabel="y, left / m", title="from above")
    for view in "sa":
        axes[view].set_aspect("equal", adjustable="datalim")
    axes["s"].legend(fontsize="small")
    axes["e"].set(ylabel="error / cm", ylim=(0.0, None))
    axes["e"].sharex(axes["t"])
    axes["e"].legend(fontsize="small")
    axes["t"].set(ylabel="orientation / mrad", xlabel="time / s", ylim=(0.0, None))
    for each in axes.values():
        each.grid(visible=True, alpha=0.4)

"""Pictures of a run of the whole robot."""

import numpy as np
from matplotlib.figure import Figure

from emir_analysis.report import new_figure
from emir_analysis.robot_metrics import (
    best,
    deflection,
    joint_error,
    path_error,
    rotation,
    tcp_error,
)
from emir_analysis.signals import Recording
from emir_msgs_py.robot_topics import JOINTS


def tcp_picture(run: Recording) -> Figure:
    """Return how well the TCP follows and how it is bent."""
    figure = new_figure(7.0)
    follows, bent, turned = figure.subplots(3, 1, sharex=True)
    times = run["tcp_reference_x"].time
    follows.plot(times, tcp_error(run) * 1e2, label="from the reference, lag included")
    follows.plot(times, path_error(run) * 1e2, label="from the path")
    follows.set_ylabel("TCP error / cm")
    moving = run["deflection_x"].time
    for axis, values, angles in zip("xyz", deflection(run), rotation(run), strict=True):
        bent.plot(moving, values * 1e2, label=axis)
        turned.plot(moving, np.degrees(angles), label=f"about {axis}")
    bent.set_ylabel("deflection / cm")
    turned.set_ylabel("rotation / deg")
    return _finished(figure)


def joints_picture(run: Recording) -> Figure:
    """Return error and chamber pressures of every joint."""
    figure = new_figure(11.0)
    for (error, pressure), joint in zip(figure.subplots(6, 2, sharex=True), JOINTS, strict=True):
        reference = run[f"{joint}_reference_stroke"]
        error.plot(reference.time, joint_error(run, joint) * 1e3)
        error.set_ylabel(f"{joint} / {'mrad' if reference.unit == 'rad' else 'mm'}")
        for side in ("lifting", "lowering"):
            signal = run[best(run, joint, f"pressure_{side}")]
            pressure.plot(signal.time, signal.value * 1e-5, label=side)
        pressure.set_ylabel("bar")
    figure.axes[0].set_title("stroke less reference", fontsize="medium")
    figure.axes[1].set_title("chamber pressures", fontsize="medium")
    figure.axes[-2].set_xlabel("time / s")
    return _finished(figure)


def _finished(figure: Figure) -> Figure:
    for axes in figure.axes:
        axes.grid(visible=True, alpha=0.3)
        if len(axes.lines) > 1:
            axes.legend(loc="upper right", frameon=False, fontsize="small", ncols=3)
    figure.axes[-1].set_xlabel("time / s")
    return figure

"""The plots of runs of the whole robot."""

from collections.abc import Mapping

import numpy as np

from emir_analysis.report import Block, Picture, Plot
from emir_analysis.robot_metrics import joint_error, path_error, tcp_error
from emir_analysis.robot_picture import path_picture
from emir_analysis.run_plots import Line, Row, plot
from emir_analysis.signals import Recording, Signal
from emir_msgs_py.robot_topics import JOINTS

DASHES = ("solid", "dash", "dot")
DEGREES = float(np.degrees(1.0))
TCP = (
    Row("TCP error / cm", (
        Line(("tcp_error",), "from the reference, with its lag", 1e2, "dot"),
        Line(("path_error",), "from the path", 1e2),
    )),
    Row("deflection / cm", tuple(
        Line((f"deflection_{axis}",), f"deflection {axis}", 1e2, dash)
        for axis, dash in zip("xyz", DASHES, strict=True)
    )),
    Row("rotation / deg", tuple(
        Line((f"deflection_about_{axis}",), f"turned about {axis}", DEGREES, dash)
        for axis, dash in zip("xyz", DASHES, strict=True)
    )),
)  # fmt: skip
ERRORS = tuple(
    Row(f"{joint} / {'mrad' if joint == 'base' else 'mm'}", (
        Line((f"{joint}_error",), f"{joint}, stroke less reference", 1e3),
    ))
    for joint in JOINTS
)  # fmt: skip
PRESSURES = tuple(
    Row(f"{joint} / bar", (
        Line((f"{joint}_true_pressure_lifting", f"{joint}_pressure_lifting"),
             f"{joint}, lifting chamber", 1e-5),
        Line((f"{joint}_true_pressure_lowering", f"{joint}_pressure_lowering"),
             f"{joint}, lowering chamber", 1e-5, "dash"),
    ))
    for joint in JOINTS
)  # fmt: skip


def robot_plots(runs: Mapping[str, Recording]) -> list[Block]:
    """Return the plots of runs by name."""
    derived = {name: with_errors(run) for name, run in runs.items()}
    return [
        Picture(path_picture(runs), "The way of the TCP, and how far it is off."),
        Plot(plot(TCP, derived), "The TCP: error, deflection and turn by bending."),
        Plot(plot(ERRORS, derived), "How each joint follows."),
        Plot(plot(PRESSURES, derived), "Chamber pressures."),
    ]


def with_errors(run: Recording) -> Recording:
    """Return the recording with the errors of TCP and joints as signals."""
    times = run["tcp_reference_x"].time
    new = {"tcp_error": (tcp_error(run), "m"), "path_error": (path_error(run), "m")}
    new |= {f"{j}_error": (joint_error(run, j), run[f"{j}_reference_stroke"].unit) for j in JOINTS}
    errors = {name: Signal(name, times, value, unit) for name, (value, unit) in new.items()}
    return Recording(run.signals | errors, run.start_ns)


def headline(shown: Mapping[str, str]) -> str:
    """Return what there is to say first, from the figures as shown by name."""
    return (
        f"The TCP stays within {shown['tcp_path_error_peak']} of its path and ends"
        f" {shown['tcp_error_end']} and {shown['tcp_tilt_end']} from its reference."
    )

"""Figures of a run of the whole robot: of each joint, of the TCP, of the supply."""

import numpy as np
import scipy
from numpy.typing import NDArray

from emir_analysis.metrics import Metric
from emir_analysis.root_mean_square import rms
from emir_analysis.run_signals import at
from emir_analysis.signals import Recording
from emir_msgs_py.robot_topics import JOINTS

Array = NDArray[np.float64]

DENSER = 20  # points of the path for each reference of the recording
END = 1.0  # s, over which the end of a recording is averaged


def robot_metrics(run: Recording) -> list[Metric]:
    """Return all figures of a run of the whole robot."""
    return [*(m for joint in JOINTS for m in _joint_metrics(run, joint)), *_robot_metrics(run)]


def _joint_metrics(run: Recording, joint: str) -> list[Metric]:
    error = joint_error(run, joint)
    unit = run[f"{joint}_reference_stroke"].unit
    highest = max(
        float(run[best(run, joint, f"pressure_{side}")].value.max())
        for side in ("lifting", "lowering")
    )
    travel = float(np.sum(np.abs(np.diff(run[f"{joint}_valve_command"].value))))
    return [
        Metric(f"{joint}_error_rms", rms(error), unit, "Stroke against reference."),
        Metric(f"{joint}_error_peak", float(np.abs(error).max()), unit, "The same, largest."),
        Metric(f"{joint}_pressure_peak", highest, "Pa", "Highest pressure in either chamber."),
        Metric(f"{joint}_valve_travel", travel, "1", "Way of the valve command, in full strokes."),
    ]


def _robot_metrics(run: Recording) -> list[Metric]:
    bent, turned = np.linalg.norm(deflection(run), axis=0), np.linalg.norm(rotation(run), axis=0)
    path, end, turned_off = path_error(run), end_error(run), tilt(run)
    figures: list[tuple[str, float, str, str]] = [
        ("tcp_deflection_start", float(bent[0]), "m", "TCP off the rigid robot, at the start."),
        ("tcp_deflection_peak", float(bent.max()), "m", "The same, largest."),
        ("tcp_rotation_start", float(turned[0]), "rad", "Turn of the TCP by bending, likewise."),
        ("tcp_rotation_peak", float(turned.max()), "rad", "The same, largest."),
        ("tcp_path_error_rms", rms(path), "m", "Distance of the TCP from the reference's path."),
        ("tcp_path_error_peak", float(path.max()), "m", "The same, largest."),
        ("tcp_error_peak", float(tcp_error(run).max()), "m", "TCP off its reference, with lag."),
        ("tcp_error_end", end, "m", "The same, mean of the last second."),
        ("tcp_tilt_end", float(np.mean(turned_off[_last(run)])), "rad",
         "Orientation of the TCP against its reference, likewise."),
        ("tcp_tilt_peak", float(turned_off.max()), "rad", "The same, largest."),
    ]  # fmt: skip
    supply = run["supply_pressure"].value if "supply_pressure" in run.signals else None
    lowest = None if supply is None else float(supply.min())
    pump = Metric("supply_pressure_lowest", lowest, "Pa", "Pressure at the pump.")
    return [*(Metric(*figure) for figure in figures), pump]


def best(run: Recording, joint: str, quantity: str) -> str:
    """Return the joint's signal of a quantity: the true one, if recorded."""
    true = f"{joint}_true_{quantity}"
    return true if true in run.signals else f"{joint}_{quantity}"


def joint_error(run: Recording, joint: str) -> Array:
    """Return a piston's stroke less its reference, at the times of the latter, m; base rad."""
    reference = run[f"{joint}_reference_stroke"]
    return at(run, best(run, joint, "stroke"), reference.time) - reference.value


def deflection(run: Recording) -> Array:
    """Return the TCP's deflection, (3, n), m."""
    return np.array([run[f"deflection_{axis}"].value for axis in "xyz"])


def rotation(run: Recording) -> Array:
    """Return the TCP's turn by bending, (3, n), rad."""
    return np.array([run[f"deflection_about_{axis}"].value for axis in "xyz"])


def reference(run: Recording) -> Array:
    """Return the TCP's reference, (n, 3), m."""
    return np.stack([run[f"tcp_reference_{axis}"].value for axis in "xyz"], axis=1)


def tcp_error(run: Recording) -> Array:
    """Return the TCP's distance from its reference, (n,), m, at the times of the latter."""
    return np.asarray(np.linalg.norm(tcp(run) - reference(run), axis=1))


def path_error(run: Recording) -> Array:
    """Return the TCP's distance from the whole path of its reference, (n,), m."""
    points = reference(run)
    fine = np.linspace(0.0, len(points) - 1.0, DENSER * len(points))
    between = [np.interp(fine, np.arange(len(points)), column) for column in points.T]
    distance, _ = scipy.spatial.cKDTree(np.stack(between, axis=1)).query(tcp(run))
    return np.asarray(distance)


def end_error(run: Recording) -> float:
    """Return the distance of the TCP's mean place from its reference in the last second, m."""
    last = _last(run)
    return float(np.linalg.norm((tcp(run) - reference(run))[last].mean(axis=0)))


def tilt(run: Recording) -> Array:
    """Return the angle between the TCP's orientation and its reference, (n,), rad."""
    times = _times(run)
    measured = np.stack([at(run, f"tcp_q{axis}", times) for axis in "xyzw"], axis=1)
    wanted = np.stack([run[f"tcp_reference_q{axis}"].value for axis in "xyzw"], axis=1)
    cosine = np.abs(np.sum(measured * wanted, axis=1)) / np.linalg.norm(measured, axis=1)
    return np.asarray(2.0 * np.arccos(np.clip(cosine, 0.0, 1.0)))


def _last(run: Recording) -> NDArray[np.bool_]:
    times = _times(run)
    return np.asarray(times >= times[-1] - END)


def _times(run: Recording) -> Array:
    return run["tcp_reference_x"].time


def tcp(run: Recording) -> Array:
    """Return where the TCP is at the times of its reference, (n, 3), m."""
    return np.stack([at(run, f"tcp_{axis}", _times(run)) for axis in "xyz"], axis=1)

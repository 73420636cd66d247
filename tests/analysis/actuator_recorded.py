"""Recordings of an actuator for the tests: its equations written a second time, for scipy."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]
Flow = Callable[[float, float], float]  # (spool, pressure) -> flow

NOISE = 0.02
GAIN, LAG, FREQUENCY, FRICTION = 1.5, 2.0, 0.3, 0.6

SIGNALS = """\
valve_opening: {topic: /actuator/opening, field: data, unit: "1"}
oil_pressure: {topic: /actuator/pressure, field: data, unit: "1"}
"""

SHEET = f"""\
machine: actuator
time_unit: sample
valve:
  gain: {{value: 1.0, range: [0.1, 10.0]}}
  time_constant: {{value: 3.0, range: [0.2, 15.0]}}
load:
  frequency: {{value: 0.25, range: [0.1, 1.0]}}
  viscous_friction: {{value: 0.5, range: [0.0, 5.0]}}
sensor:
  pressure_noise: {{value: {NOISE}}}
"""


def moves(samples: int, seed: int) -> Array:
    """Return a valve opening: shut for 20 samples, then ramps to random openings."""
    random = np.random.default_rng(seed)
    knots = np.arange(20, samples + 60, 12)
    return np.interp(
        np.arange(samples), knots, np.append(0.0, random.uniform(-1.0, 1.0, knots.size - 1))
    )


def pressure(opening: Array, flow: Flow) -> Array:
    """Return the pressure at the samples of an actuator whose valve gives a flow."""
    samples = np.arange(opening.size, dtype=float)

    def slope(t: float, x: Array) -> list[float]:
        spool, oil, velocity = x
        command = float(np.interp(t, samples, opening))
        return [
            (command - spool) / LAG,
            flow(spool, oil) - velocity,
            FREQUENCY**2 * (oil - FRICTION * velocity),
        ]

    start = [opening[0], 0.0, 0.0]
    run = solve_ivp(slope, (0.0, samples[-1]), start, t_eval=samples, max_step=0.5, rtol=1e-7)
    return np.asarray(run.y[1])


def write(bag: Path, opening: Array, oil: Array, begin: int = 0, seconds: int = 1) -> None:
    """Write both signals as Float64, a sample every `seconds` from `begin`, s."""
    store = get_typestore(Stores.ROS2_JAZZY)
    kind = "std_msgs/msg/Float64"
    with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for topic, values in (("opening", opening), ("pressure", oil)):
            connection = writer.add_connection(f"/actuator/{topic}", kind, typestore=store)
            for k, value in enumerate(values):
                data = store.serialize_cdr(store.types[kind](float(value)), kind)
                writer.write(connection, (begin + k * seconds) * 10**9, data)


def record(folder: Path, flow: Flow, samples: int = 600, cut: int = 320) -> tuple[Path, Path]:
    """Write one run as two recordings, the second going on where the first ends."""
    opening = moves(samples, 1)
    oil = pressure(opening, flow)
    oil += NOISE * np.random.default_rng(2).standard_normal(samples)
    write(folder / "a", opening[:cut], oil[:cut])
    write(folder / "b", opening[cut:], oil[cut:], cut)
    return folder / "a", folder / "b"

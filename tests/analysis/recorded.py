"""Recordings for the tests, made without the code that is tested.

The machine's right-hand side is integrated by scipy with a tight tolerance, effects are written
here a second time, the sensors too, and `rosbags` writes the files.
"""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from scipy.integrate import solve_ivp

from emir_plant import core
from emir_plant.parameters import Geometry, Machine
from emir_plant.plant import Plant

Array = NDArray[np.float64]

START = 1_700_000_000_000_000_000  # ns
COMMAND_PERIOD, SAMPLE_PERIOD = 0.032, 0.01  # s
STEP = np.pi / 2.0 / 4096  # rad, of a 12-bit resolver over a quarter turn

SIGNAL_MAP = """\
joint_angle: {topic: /rig/joint_states, field: "position[0]", unit: rad}
piston_stroke: {topic: /rig/cylinder, field: "position[0]", unit: m}
valve_command: {topic: /rig/valve_command, field: "position[0]", unit: "1"}
pressure_lifting: {topic: /rig/pressure_lifting, field: fluid_pressure, unit: Pa}
pressure_lowering: {topic: /rig/pressure_lowering, field: fluid_pressure, unit: Pa}
tip_deflection_angle: {topic: /rig/boom_deflection, field: "position[0]", unit: rad}
"""

DATA_SHEET = """\
geometry:
  boom_length: {value: 22.5, unit: m}
  boom_mass: {value: 5000.0, unit: kg}
  section_spring: {value: 1.839e+8, unit: N m/rad}
  triangle_a: {value: 2.0, unit: m}
  triangle_b: {value: 0.65, unit: m}
  triangle_gamma0: {value: 0.7, unit: rad}
  modal_frequency: {tol: 0.02}
cylinder:
  area_lifting: {value: 0.0616, unit: m^2}
  area_lowering: {value: 0.0302, unit: m^2}
  volume_lifting_0: {value: 0.02, unit: m^3}
  volume_lowering_0: {value: 0.0387, unit: m^3}
  beta: {value: 5.0e+8, unit: Pa, tol: 0.15}
supply:
  p0: {value: 200.0e+5, unit: Pa}
  pT: {value: 2.0e+5, unit: Pa}
valve:
  flow_nominal: {value: 3.33e-3, unit: m^3/s, tol: 0.03}
  flow_ratio_lowering: {value: 0.54, unit: "1"}
  natural_frequency: {value: 188.5, unit: rad/s}
  balance_pressure: {value: 8.0e+5, unit: Pa}
resistances:
  k_pump_line: {value: 3.6e+10, unit: Pa s^2/m^6}
  k_block_in: {value: 2.7e+10, unit: Pa s^2/m^6}
  k_return_line: {value: 2.7e+10, unit: Pa s^2/m^6}
  k_block_out: {value: 2.7e+10, unit: Pa s^2/m^6}
  k_meter_out_lifting: {value: 1.13e+12, unit: Pa s^2/m^6}
  k_meter_out_lowering: {value: 1.35e+12, unit: Pa s^2/m^6, tol: 0.10}
logic_block:
  threshold: {value: 40.0e+5, unit: Pa}
  time_constant_opening: {value: 0.02, unit: s}
  time_constant_closing: {value: 0.3, unit: s}
sensors:
  resolver: {bits: 12, span: 1.5707963267948966, unit: rad}
  pressure_noise: {value: 0.2e+5, unit: Pa}
  deflection_noise: {value: 2.0e-5, unit: rad}
"""

Force = Callable[[float, float], float]  # (stroke, m, velocity, m/s) -> N against the motion
Load = Callable[[float], float]  # (time, s) -> N across the boom at the TCP, up positive


def moves(duration: float, seed: int) -> Array:
    """Return a valve command, one value every 32 ms: at rest for a second, then up and down."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, duration, COMMAND_PERIOD)
    command = np.zeros_like(time)
    begin, sign = 1.0, 1.0
    while begin < duration:
        length = random.uniform(2.0, 4.0)
        inside = (time >= begin) & (time < begin + length)
        ramp = np.minimum(1.0, np.minimum(time - begin, begin + length - time) / 0.4)
        command[inside] = (sign * random.uniform(0.3, 0.6) * ramp)[inside]
        begin += length + random.uniform(0.0, 0.5)
        sign = -sign
    return command


def cylinder(angle: float, geometry: Geometry) -> tuple[float, float]:
    """Return the piston's stroke and its lever arm, m, at a boom angle, rad."""
    a, b, at_zero = geometry.triangle_a, geometry.triangle_b, geometry.triangle_gamma0
    enclosed = angle + at_zero
    length = math.sqrt(a * a + b * b - 2.0 * a * b * math.cos(enclosed))
    stretched = math.sqrt(a * a + b * b - 2.0 * a * b * math.cos(at_zero))
    return length - stretched, a * b * math.sin(enclosed) / length


def simulate(
    machine: Machine,
    commands: Array,
    friction: Force | None = None,
    period: float = SAMPLE_PERIOD,
    load: Load | None = None,
) -> Array:
    """Return p_H, p_S, angle and tip angle, (n, 4), every period, s, from rest at 45 deg.

    friction and a load are added to the machine's own right-hand side.
    """
    plant = Plant(machine)
    joint, tip = plant.record[0]["mode_joint"], plant.record[0]["mode_tip_angle"]
    way = machine.geometry.boom_length * joint + plant.record[0]["mode_deflection"]  # of the TCP
    modes = joint.size
    position = slice(core.MODES, core.MODES + modes)
    rate = slice(core.MODES + modes, core.MODES + 2 * modes)

    def slope(time: float, x: Array, command: float) -> Array:
        dx = plant.derivative(x, command)
        if friction is not None:
            stroke, arm = cylinder(float(joint @ x[position]), machine.geometry)
            dx[rate] -= joint * arm * friction(stroke, arm * float(joint @ x[rate]))
        if load is not None:
            dx[rate] += way * load(time)
        return dx

    x = plant.initial(np.pi / 4.0, 25e5)
    samples = np.arange(0.0, commands.size * COMMAND_PERIOD, period)
    shown = []
    for k, command in enumerate(commands):
        begin, end = k * COMMAND_PERIOD, (k + 1) * COMMAND_PERIOD
        inside = samples[(samples > begin - 1e-9) & (samples < end - 1e-9)]
        run = solve_ivp(
            slope,
            (begin, end),
            x,
            method="DOP853",
            args=(command,),
            t_eval=np.append(np.maximum(inside, begin), end),
            rtol=1e-7,
            atol=1e-7,
        )
        shown.append(run.y[:, :-1])
        x = run.y[:, -1]
    states = np.concatenate(shown, axis=1)
    angles = [weights @ states[position] for weights in (joint, tip)]
    return np.column_stack([states[core.P_H], states[core.P_S], *angles])


def measured(
    machine: Machine, truth: Array, seed: int, period: float = SAMPLE_PERIOD
) -> dict[str, tuple[Array, Array]]:
    """Return time, s, and value of each sensor, as the sensors of the data sheet show the truth.

    period: s, between two rows of it.
    """
    noise = np.random.default_rng(seed).standard_normal((len(truth), 3))
    time = np.arange(len(truth)) * period
    angle = np.round(truth[:, 2] / STEP) * STEP
    strokes = np.array([cylinder(a, machine.geometry)[0] for a in angle])
    return {
        "joint_states": (time, angle),
        "cylinder": (time, strokes),
        "pressure_lifting": (time, truth[:, 0] + 0.2e5 * noise[:, 0]),
        "pressure_lowering": (time, truth[:, 1] + 0.2e5 * noise[:, 1]),
        "boom_deflection": (time, truth[:, 3] - truth[:, 2] + 2e-5 * noise[:, 2]),
    }


def write_bag(
    path: Path,
    topics: dict[str, tuple[Array, Array]],
    delay: float = 0.0,
    *,
    stamped_otherwise: bool = False,
) -> None:
    """Write time, s, and value of each topic /rig/NAME; recorded `delay` s after their stamps.

    stamped_otherwise: every 10 ms in the order given, whatever the stamps are.
    """
    store = get_typestore(Stores.ROS2_JAZZY)
    types = store.types
    header, stamp = types["std_msgs/msg/Header"], types["builtin_interfaces/msg/Time"]
    empty = np.array([], dtype=np.float64)
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for name, (times, values) in topics.items():
            kind = f"sensor_msgs/msg/{'FluidPressure' if 'pressure' in name else 'JointState'}"
            connection = writer.add_connection(f"/rig/{name}", kind, typestore=store)
            for number, (time, value) in enumerate(zip(times, values, strict=True)):
                ns = START + round(time * 1e9)
                head = header(stamp(ns // 10**9, ns % 10**9), "")
                if "pressure" in name:
                    message = types[kind](head, float(value), 0.0)
                else:
                    message = types[kind](head, ["joint"], np.array([value]), empty, empty)
                recorded = START + number * 10**7 if stamped_otherwise else ns
                recorded += round(delay * 1e9)
                writer.write(connection, recorded, store.serialize_cdr(message, kind))


def record_machine(
    path: Path, machine: Machine, duration: float, seed: int, friction: Force | None = None
) -> None:
    """Simulate a machine, read its sensors and write the recording."""
    commands = moves(duration, seed)
    truth = simulate(machine, commands, friction)
    times = np.arange(commands.size) * COMMAND_PERIOD
    write_bag(path, {"valve_command": (times, commands)} | measured(machine, truth, seed))

"""The closed loop without ROS: a plain loop over the same objects that the nodes hold.

It is what the graph has to agree with, value for value, when it runs in lock step.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from emir_analysis.control_protocols import Stepping
from emir_analysis.disturbance import LoadChange, reloaded
from emir_analysis.node_controls import (
    CascadeControl,
    ForceLoopControl,
    TrajectoryControl,
    plant_signals,
)
from emir_control.force_loop import ForceLoop, ForceLoopParameters
from emir_control.trajectory import AwayAndBack
from emir_msgs_py.topics import CONTROL_PERIOD, PLANT_PERIOD, TICKS
from emir_plant.plant import Plant
from emir_plant.sensors import measure

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ClosedLoop:
    """Machine, outer loop (paper 3.2 or 3.3) and force loop (paper 3.1).

    change: of the payload in mid-run.
    """

    plant: Plant
    trajectory: AwayAndBack
    outer: Stepping = field(default_factory=CascadeControl)
    force_loop: ForceLoop = field(default_factory=lambda: ForceLoop(ForceLoopParameters()))
    change: LoadChange | None = None

    def run(self, angle: float, pressure_lowering: float, duration: float) -> dict[str, Array]:
        """Run from rest at a boom angle, rad, and a lowering pressure, Pa, for a duration, s.

        Returns every signal of the topic table by name: those of the plant with one value each
        plant period, those of the controllers with one each control period, both ends included.
        """
        plant = self.plant
        planned, damped = TrajectoryControl(self.trajectory), ForceLoopControl(self.force_loop)
        state = plant.initial(angle, pressure_lowering)
        truth = plant.outputs(state)
        changing = round(self.change.time / PLANT_PERIOD) if self.change else -1
        following = controlling = damping = None
        rows: dict[str, list[float]] = {}
        last = round(duration / CONTROL_PERIOD) * TICKS
        for tick in range(last + 1):
            if self.change and tick == changing:
                plant, state = reloaded(plant, state, self.change.payload)
                truth = plant.outputs(state)
            reading = measure(plant, truth, tick, state)
            _append(rows, plant_signals(reading, truth))
            if tick % TICKS == 0:
                measured = reading._asdict()
                following, signals = planned.step(following, measured, CONTROL_PERIOD)
                now = measured | signals
                controlling, wanted = self.outer.step(controlling, now, CONTROL_PERIOD)
                if "velocity_command" in wanted:
                    damping, valve = damped.step(damping, now | wanted, CONTROL_PERIOD)
                    signals |= valve
                signals |= wanted
                _append(rows, signals)
            if tick < last:
                state, truth = plant.step(state, signals["valve_command"], PLANT_PERIOD)
        return {name: np.array(values) for name, values in rows.items()}


def _append(rows: dict[str, list[float]], signals: dict[str, float]) -> None:
    for name, value in signals.items():
        rows.setdefault(name, []).append(value)

"""What knowing an effect is worth to a controller: designed before and after, on the machine."""

from dataclasses import dataclass

import numpy as np

from emir_analysis.compare import dynamic_deflection, figures, run
from emir_analysis.design_pfc import DesignTask, design_pfc
from emir_analysis.diagnosis.whole import Progress
from emir_analysis.node_controls import PfcControl
from emir_common.quantity import ParameterError
from emir_control.pfc import Pfc
from emir_control.trajectory import AwayAndBack, TrajectoryParameters
from emir_plant.parameters import Machine
from emir_plant.plant import SimulationError

START_ANGLE = float(np.pi / 4.0)  # rad, of the boom, as in the paper's moves


@dataclass(frozen=True)
class ControlResult:
    """Largest errors of a predictive controller on the paper's moves, lifting and lowering.

    tracking: m, stroke against reference. tcp: m, deflection of the TCP off the posture's sag.
    """

    tracking: float
    tcp: float


def before_and_after(
    stated: Machine, found: Machine, progress: Progress
) -> dict[str, ControlResult]:
    """Return the errors of controllers designed for either machine, both on the found one.

    A design that cannot be made or run is left out, and said so.
    """
    results = {}
    for name, machine in (("before", stated), ("after", found)):
        try:
            results[name] = _on(found, machine)
        except (ParameterError, SimulationError) as error:
            progress(f"no controller designed {name}: {error}")
    return results


def _on(machine: Machine, model: Machine) -> ControlResult:
    outer = PfcControl(Pfc(design_pfc(model, DesignTask())))
    signals = run(machine, AwayAndBack(TrajectoryParameters()), outer, START_ANGLE)
    moves = figures(signals)
    deflection = float(np.max(np.abs(dynamic_deflection(signals))))
    return ControlResult(tracking=max(move.error for move in moves), tcp=deflection)

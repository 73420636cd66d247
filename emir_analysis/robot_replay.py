"""A recording of the whole robot fed to its controllers, as `replay` does for joint 1."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from emir_analysis.control_protocols import NodeControl, Signals
from emir_analysis.errors import InputError
from emir_analysis.recorded_orders import Obedience, orders
from emir_analysis.robot_controls import (
    RobotCascadeControl,
    RobotForceLoopControl,
    RobotPfcControl,
    RobotTrajectoryControl,
)
from emir_analysis.robot_files import FILES, robot_of
from emir_analysis.robot_setup import (
    cascade_parameters,
    force_loops,
    path_parameters,
    pfc_parameters,
    trajectory_of,
)
from emir_analysis.stamped import FieldComparison, by_stamp, compared
from emir_common.parameter_tree import with_values
from emir_common.quantity import ParameterError
from emir_control.cascade import Cascade
from emir_control.pfc import Pfc
from emir_msgs_py.topics import CONTROL_PERIOD_NS, Topic
from emir_plant.robot import require_pinocchio

NODES = ("trajectory", "cascade", "pfc", "force_loop")
PLANT = "plant"


def replay_robot(
    bag: Path, node: str, values: Mapping[str, Any], changed: Mapping[str, Any]
) -> list[FieldComparison]:
    """Feed a lock-step recording to one of the robot's nodes and compare the outputs.

    values: the node's parameters by dotted name, over which those that are changed prevail. Raises
    InputError for another node or a recording not in lock step, ParameterError for a bad parameter.
    """
    if node == PLANT:
        require_pinocchio()
        from emir_analysis.robot_replay_plant import replay_robot_plant  # noqa: PLC0415

        return replay_robot_plant(bag, values, changed)
    if node not in NODES:
        raise InputError(
            f"--node {node}: of the whole robot there are {', '.join((*NODES, PLANT))}"
        )

    def made(given: Mapping[str, Any]) -> NodeControl:
        try:
            return _control(node, dict(given))
        except ParameterError as error:
            raise ParameterError(f"{node}: {error}") from None

    control = made({**values, **changed})
    period = control.outputs[0].period_ns
    slow = _recorded(bag, [t for t in control.inputs if t.every == "control"], CONTROL_PERIOD_NS)
    quick = _recorded(bag, [t for t in control.inputs if t.every == "plant"], period)
    outputs = by_stamp(bag, control.outputs, period)
    obedient = Obedience(made, values, changed, orders(bag, f"{node}_node"))
    rows = obedient.answers(_held(quick, slow), outputs, period * 1e-9)
    if not rows:
        raise InputError(f"{bag}: no period with all topics of {node}: not in lock step?")
    return compared(control.outputs, rows)


def _held(
    quick: Mapping[int, Signals], slow: Mapping[int, Signals]
) -> Iterator[tuple[int, Signals]]:
    """Yield all signals at each stamp of the quick ones, the slow ones held between theirs."""
    held: Signals = {}
    for stamp, signals in sorted(quick.items()):
        held |= slow.get(stamp, {}) | signals
        yield stamp, held


def _recorded(bag: Path, topics: list[Topic], period: int) -> dict[int, Signals]:
    return by_stamp(bag, topics, period) if topics else {}


def _control(node: str, values: dict[str, Any]) -> NodeControl:
    if node == "cascade":
        return RobotCascadeControl(Cascade(with_values(cascade_parameters(), values)))
    if node == "pfc":
        return RobotPfcControl(Pfc(with_values(pfc_parameters(), values)))
    sheet = robot_of(values)
    values = {name: value for name, value in values.items() if name not in FILES}
    if node == "force_loop":
        return RobotForceLoopControl(with_values(force_loops(sheet), values))
    name = values.pop("trajectory", "lift-lower")
    return RobotTrajectoryControl(trajectory_of(sheet, name, path_parameters(sheet), values))

"""A recording's inputs fed to one of its nodes, the answers compared with the recorded ones.

Open loop: what was recorded is fed whatever the controller answers. What the node was ordered or
had set during the run comes at its recorded period.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

from emir_analysis.control_protocols import NodeControl, Signals, Stepping
from emir_analysis.errors import InputError
from emir_analysis.graph_topics import graph_topics
from emir_analysis.machine_model import lqg_parameters
from emir_analysis.node_controls import (
    CascadeControl,
    ForceLoopControl,
    LqgControl,
    MpcControl,
    PfcControl,
    PfcTipControl,
    TrajectoryControl,
)
from emir_analysis.parameter_files import unpacked
from emir_analysis.recorded_orders import Obedience, orders
from emir_analysis.recorded_parameters import Values, recorded_nodes, recorded_parameters
from emir_analysis.replay_plant import replay_plant
from emir_analysis.robot_replay import PLANT, replay_robot
from emir_analysis.stamped import FieldComparison, by_stamp, compared
from emir_analysis.switching import Choosing, Ready, Selector, Switch
from emir_common.parameter_tree import with_values
from emir_common.quantity import ParameterError
from emir_control import pfc_file
from emir_control.cascade import Cascade, CascadeParameters
from emir_control.force_loop import ForceLoop, ForceLoopParameters
from emir_control.lqg import Lqg
from emir_control.mpc import Mpc
from emir_control.pfc import PfcParameters
from emir_control.scheduled_pfc import law_of
from emir_control.tip import Tip
from emir_control.trajectory import TrajectoryParameters, named
from emir_msgs_py.robot_topics import TCP_POSE
from emir_msgs_py.topics import (
    CONTROL_PERIOD,
    CONTROL_PERIOD_NS,
    OFFERED_COMMANDS,
    OUTER_LOOPS,
    SELECTOR_TERMS,
    VALVE_COMMAND,
    VELOCITY_COMMAND,
)
from emir_plant.sheet import joint1

NODES = (
    "trajectory", "cascade", "pfc", "pfc_tip", "lqg", "mpc", "selector", "force_loop", PLANT,
)  # fmt: skip


def replay(bag: Path, node: str, changed: Mapping[str, Any]) -> list[FieldComparison]:
    """Feed a lock-step recording to a node's controller and compare the outputs.

    node: of NODES. changed: parameters by dotted name, over those of the recorded run. Raises
    InputError for a recording without the node or its topics or not in lock step, ParameterError
    for a parameter that does not exist or is out of range.
    """
    if node not in NODES:
        raise InputError(f"--node {node}: there are {', '.join(NODES)}")
    name, there = f"{node}_node", recorded_nodes(bag)
    if there and name not in there:
        ran = ", ".join(known for known in NODES if f"{known}_node" in there)
        raise InputError(f"{bag}: {node} was not in this run; it has parameters of {ran}")
    kind = replay_robot if graph_topics(bag).full_name(TCP_POSE) else _replay_joint1
    with unpacked(bag, name, recorded_parameters(bag, name)) as values:
        return kind(bag, node, values, changed)


def _replay_joint1(
    bag: Path, node: str, values: Values, changed: Mapping[str, Any]
) -> list[FieldComparison]:
    if node == PLANT:
        return replay_plant(bag, values, changed)
    control = _control(node, {**values, **changed})
    inputs = by_stamp(bag, control.inputs, CONTROL_PERIOD_NS)
    there, answers = graph_topics(bag), control.outputs
    offered = OFFERED_COMMANDS.get(node)
    standby = offered is not None and there.full_name(offered) is not None

    def made(given: Values) -> Stepping:
        return Ready(node, _control(node, given)) if standby else _control(node, given)

    if offered and standby:  # one of several
        _add_applied(inputs, bag, CONTROL_PERIOD_NS)
        commands = VELOCITY_COMMAND, VALVE_COMMAND
        answers = tuple(offered if topic in commands else topic for topic in answers)
    elif node == "force_loop" and there.full_name(SELECTOR_TERMS):
        _add_applied(inputs, bag, 0)
    kept = tuple(topic for topic in answers if there.full_name(topic))
    outputs = by_stamp(bag, kept or answers, CONTROL_PERIOD_NS)
    obedient = Obedience(made, values, changed, orders(bag, f"{node}_node"))
    rows = obedient.answers(sorted(inputs.items()), outputs, CONTROL_PERIOD)
    if not rows:
        raise InputError(f"{bag}: no control period with all topics of {node}: not in lock step?")
    return compared(answers, rows)


def _add_applied(inputs: Mapping[int, Signals], bag: Path, later: int) -> None:
    """Add to a node's inputs, by stamp, what was applied, as it heard that `later`, ns."""
    for stamp, applied in by_stamp(bag, (SELECTOR_TERMS,), CONTROL_PERIOD_NS).items():
        inputs.get(stamp + later, {}).update(applied)


def text(fields: list[FieldComparison], changed: Mapping[str, Any]) -> str:
    """Return the comparison as lines of text."""
    lines = []
    if changed:
        given = ", ".join(f"{name} = {value}" for name, value in changed.items())
        lines.append(f"with {given}; open loop: what it is fed stays as recorded")
    wide = max(len(field.name) for field in fields)
    return "\n".join([*lines, *(f"  {field.name:{wide}}  {_line(field)}" for field in fields)])


def _line(field: FieldComparison) -> str:
    if not field.recorded.size:
        return "   not recorded"
    difference = f"largest difference {field.largest_difference:.3g} {field.unit}"
    return f"{field.equal:>6} of {field.recorded.size} equal, {difference}"


def _control(node: str, values: Values) -> NodeControl:
    try:
        return _CONTROLS[node](dict(values))
    except ParameterError as error:
        raise ParameterError(f"{node}: {error}") from None


def _cascade(values: Values) -> NodeControl:
    return CascadeControl(Cascade(with_values(CascadeParameters(), values)))


def _force_loop(values: Values) -> NodeControl:
    return ForceLoopControl(ForceLoop(with_values(ForceLoopParameters(), values)))


def _pfc(values: Values) -> NodeControl:
    return PfcControl(law_of(_design(pfc_file.STROKE, values)))


def _pfc_tip(values: Values) -> NodeControl:
    return PfcTipControl(Tip(law_of(_design(pfc_file.TIP_ANGLE, values))))


def _lqg(values: Values) -> NodeControl:
    return LqgControl(Lqg(with_values(lqg_parameters(joint1()), values)))


def _mpc(values: Values) -> NodeControl:
    return MpcControl(Mpc(with_values(lqg_parameters(joint1()), values)))


def _trajectory(values: Values) -> NodeControl:
    name = values.pop("trajectory", "lift-lower")
    return TrajectoryControl(named(name, with_values(TrajectoryParameters(), values)))


def _selector(values: Values) -> NodeControl:
    for name in ("controllers", "switch_times", "switch_to"):
        given = values.get(name, [])
        if not isinstance(given, list) or any(isinstance(entry, list | dict) for entry in given):
            raise ParameterError(f"{name} = {given!r}: not a list of numbers or names")
    names = values.pop("controllers", list(OUTER_LOOPS))
    times, switched = values.pop("switch_times", [0.0]), values.pop("switch_to", names[:1])
    first = values.pop("controller", switched[0] if switched else "")
    for name in values:
        raise ParameterError(f"{name}: there is no such parameter")
    if first not in names:
        raise ParameterError(f"controller {first!r}: running are {', '.join(map(str, names))}")
    if len(times) != len(switched):
        raise ParameterError("switch_times and switch_to differ in length")
    switches = [Switch(*pair) for pair in zip(times, switched, strict=True)]
    # cast: its inputs are those of the controllers that run
    return cast("NodeControl", Choosing(Selector(names, switches), first))


_CONTROLS = {
    "trajectory": _trajectory, "cascade": _cascade, "pfc": _pfc, "pfc_tip": _pfc_tip,
    "lqg": _lqg, "mpc": _mpc, "selector": _selector, "force_loop": _force_loop,
}  # fmt: skip


def _design(output: str, values: Values) -> PfcParameters:
    design = pfc_file.load(pfc_file.find(str(values.pop("model_file", "")), output), output)
    words = {name: values.pop(name) for name in ("form", "future") if name in values}
    return with_values(replace(design, **words), values)

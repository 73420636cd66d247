"""What each signal of the topic table means, in words; recordings carry it beside path and unit."""

from emir_msgs_py.robot_topics import JOINTS
from emir_msgs_py.topics import CYLINDER_PREVIEW, OUTER_LOOPS, VALVE_LOOPS, Topic

MEANINGS = {
    "angle": "joint angle alpha_1, measured by the resolver",
    "stroke": "piston stroke h_1, from the resolver's angle by the linkage",
    "force": "piston force from the measured pressures",
    "pressure_lifting": "pressure in the chamber whose oil lifts, absolute, measured",
    "pressure_lowering": "pressure in the chamber whose oil lowers, absolute, measured",
    "deflection": "angle by which the boom's tip is bent away from the joint's, measured",
    "true_angle": "joint angle alpha_1",
    "true_tip_angle": "inclination of the boom's tip, alpha_6",
    "true_stroke": "piston stroke h_1",
    "true_velocity": "piston velocity",
    "true_force": "force of the piston on the linkage",
    "true_pressure_lifting": "pressure in the chamber whose oil lifts, absolute",
    "true_pressure_lowering": "pressure in the chamber whose oil lowers, absolute",
    "flow_lifting": "oil flow into the lifting chamber, Q_H",
    "flow_lowering": "oil flow into the lowering chamber, Q_S",
    "spool": "position of the valve's spool y_2, -1 to 1",
    "logic_block": "opening of the logic block, 0 to 1",
    "tcp_deflection": "deflection of the tool centre point across the boom",
    "reference_stroke": "demanded piston stroke h_d",
    "reference_velocity": "demanded piston velocity dh_d/dt",
    "reference_force": "force of the piston that the demanded motion is expected to take",
    "expected_force": "force of the piston that the motion asked for is expected to take",
    "velocity_command": "piston velocity that the outer controller asks for",
    "valve_command": "commanded opening of the valve, -1 to 1",
    "feedforward": "share of the cascade's command from the demanded velocity",
    "feedback": "share of the cascade's command from the position error",
    "smoothed_reference": "demanded stroke behind the first-order lag T",
    "measured_force": "piston force from pressures, as the force loop sees it",
    "force_feedback": "velocity taken off the command by the force feedback",
    "wanted_velocity": "command less force feedback: what the prefilter turns into an opening",
    "saturated": "1 where the valve command is at its limit",
}
MEANINGS |= {
    name: f"demanded stroke {k} control periods ahead"
    for k, name in enumerate(CYLINDER_PREVIEW.fields, start=1)
}
PFC_MEANINGS = {
    "unlimited": "command before its limits",
    "reference_term": "share of the reference trajectory in the command",
    "model_term": "share of the internal model's state",
    "command_term": "share of the past commands",
    "error_term": "share of the extrapolated model error",
    "model_error": "measured output less the internal model's",
    "limited": "1 where the command is at its limit",
}
MEANINGS |= {
    f"{name}_{term}": text for name in ("pfc", "pfc_tip") for term, text in PFC_MEANINGS.items()
}
LQG_MEANINGS = {
    "planned": "velocity that both flows together shall give, as planned",
    "wanted": "the same with the feedback",
    "flow": "unknown flow, as the velocity that it gives, estimated",
    "force": "unknown force on the piston, friction for one, estimated",
    "payload": "payload at the TCP, read from the piston force at rest",
    "deflection": "the TCP's dynamic deflection off the plan, estimated",
    "limited": "1 where command or plan is held off an end of the stroke",
}
MEANINGS |= {f"{name}_{term}": text for name in VALVE_LOOPS for term, text in LQG_MEANINGS.items()}
MEANINGS |= {
    "move_since": "time since the start of the move under way, negative before the next one",
    "move_duration": "how long that move takes",
    "move_distance": "by how much it moves the piston, lifting positive",
}
MEANINGS |= {f"{name}_command": f"piston velocity that {name} asks for" for name in OUTER_LOOPS}
MEANINGS |= {f"{name}_active": f"1 while {name} drives the machine" for name in OUTER_LOOPS}
MEANINGS |= {
    f"{name}_ready": f"1 where {name} may take over: at rest, or early in a move"
    for name in VALVE_LOOPS
}
MEANINGS["applied_command"] = "piston velocity asked for by the controller that is chosen"
MEANINGS |= {
    "true_rate": "rate of the joint's angle",
    "supply_pressure": "pressure at the pump",
} | {f"deflection_{axis}": f"TCP's deflection along {axis}, by bending" for axis in "xyz"}
MEANINGS |= {f"deflection_about_{axis}": f"TCP's turn about {axis}, by bending" for axis in "xyz"}
for _pose, _text in (("tcp", "TCP"), ("tcp_reference", "demanded TCP")):
    MEANINGS |= {f"{_pose}_{axis}": f"{_text}, position, {axis}" for axis in "xyz"}
    MEANINGS |= {f"{_pose}_q{axis}": f"{_text}, quaternion, {axis}" for axis in "xyzw"}


def _meaning(signal: str) -> str:
    """Return a signal's meaning; of the robot's signals of one joint that of joint 1's own."""
    if signal in MEANINGS:
        return MEANINGS[signal]
    joint, _, quantity = signal.partition("_")
    if joint not in JOINTS:
        raise KeyError(signal)
    of = {"angle": "joint angle, measured by the resolver", "true_angle": "joint angle"}
    known = MEANINGS | of
    text = known.get(quantity) or known[quantity.removeprefix("true_")]
    return f"{joint}: {text.replace('h_1', 'h')}"


def field_table(topic: Topic) -> dict[str, dict[str, str]]:
    """Return {signal: {path, unit, meaning}} of a topic. Raises KeyError without a meaning."""
    return {
        signal: {"path": field.path, "unit": field.unit, "meaning": _meaning(signal)}
        for signal, field in topic.fields.items()
    }

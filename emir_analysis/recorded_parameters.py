"""The parameters of a recorded run's nodes: all, as the nodes told them, or those that were set."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from emir_analysis import bags
from emir_analysis.errors import InputError
from emir_analysis.info import DESCRIPTION, PARAMETERS

Values = dict[str, Any]

# parameters of nodes, not of what they hold
OF_EVERY_NODE = (
    "lockstep", "model", "input_timeout", "standby", "autostart", "use_sim_time",
    "start_type_description_service", "lag_limit",
)  # fmt: skip
OF_A_TOPIC = "qos_overrides."


def recorded_parameters(bag: Path, node: str) -> Values:
    """Return the parameters of what a node held, by dotted name.

    node: such as `cascade_node`. Older recordings know only what was set. Raises InputError for a
    description that cannot be read.
    """
    about = bags.metadata(bag)
    told, set_ = about.get(PARAMETERS, {}), about.get(DESCRIPTION, {})
    values = _json(bag, told[node]) if node in told else _as_set(bag, node, set_)
    return {
        name: value
        for name, value in values.items()
        if name not in OF_EVERY_NODE and not name.startswith(OF_A_TOPIC)
    }


def recorded_nodes(bag: Path) -> list[str]:
    """Return the names of the nodes that told their parameters; []: the recording is older."""
    return sorted(bags.metadata(bag).get(PARAMETERS, {}))


def _as_set(bag: Path, node: str, about: Mapping[str, str]) -> Values:
    nodes = _json(bag, about.get("parameters", "{}"))
    try:
        values = {**nodes.get("/**", {}), **nodes.get(node, {})}
    except TypeError:
        raise InputError(f"{bag}: metadata: parameters: not JSON of nodes") from None
    if node == "trajectory_node" and "trajectory" in about:  # of the command line, which prevails
        values["trajectory"] = about["trajectory"]
    return values


def _json(bag: Path, text: str) -> Values:
    try:
        values = json.loads(text)
    except ValueError:
        values = None
    if not isinstance(values, dict):
        raise InputError(f"{bag}: metadata: parameters: not JSON of nodes")
    return values

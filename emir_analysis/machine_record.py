"""What is special about a recorded machine, read off its node's parameters."""

from collections.abc import Mapping
from typing import Any

from emir_common.quantity import quantities
from emir_plant.effects import REGISTRY
from emir_plant.unnamed import UNNAMED

PLANT = "plant_node"
SEED = "sensors.seed"


def machine_record(parameters: Mapping[str, Any]) -> dict[str, str]:
    """Return the effects that are on, with their sizes, and the seed of the sensors' noise.

    And which curves of what has no name.

    parameters: of plant_node, by dotted name. Empty for a machine that is not ours.
    """
    if SEED not in parameters:
        return {}
    told = [
        f"{name} {_sizes(name, parameters)}"
        for name, kind in REGISTRY.items()
        if any(parameters.get(f"effects.{name}.{size}") for size in kind.sizes)
    ]
    told += [name for name in UNNAMED if parameters.get(f"{name}.over")]
    return {"effects": "; ".join(told) or "none", "seed": str(parameters[SEED])}


def _sizes(name: str, parameters: Mapping[str, Any]) -> str:
    kind = REGISTRY[name]
    given = {size: parameters.get(f"effects.{name}.{size}") for size in kind.sizes}
    units = {size: about.unit for size, about in quantities(kind).items()}
    return ", ".join(
        f"{size} = {value:g}" + ("" if units[size] == "1" else f" {units[size]}")
        for size, value in given.items()
        if value
    )

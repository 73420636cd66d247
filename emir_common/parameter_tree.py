"""Parameter dataclasses nested in one another, seen as a flat table of dotted paths."""

import dataclasses
from typing import Any, TypeVar

from emir_common.quantity import ParameterError, Quantity, quantities

Tree = TypeVar("Tree")


def declared(tree: Any) -> dict[str, tuple[Quantity, Any]]:
    """Return every quantity of a nested parameter dataclass by dotted path, with its value."""
    table = {name: (about, getattr(tree, name)) for name, about in quantities(tree).items()}
    for field in dataclasses.fields(tree):
        branch = getattr(tree, field.name)
        if dataclasses.is_dataclass(branch):
            table |= {f"{field.name}.{path}": entry for path, entry in declared(branch).items()}
    return table


def with_values(tree: Tree, values: dict[str, Any]) -> Tree:
    """Return the tree with some quantities replaced, given by dotted path.

    Raises ParameterError for a path that does not exist or a value out of range.
    """
    for path, value in values.items():
        tree = _replaced(tree, path.split("."), value, path)
    return tree


def _replaced(tree: Any, keys: list[str], value: Any, path: str) -> Any:
    name, *rest = keys
    known = {field.name for field in dataclasses.fields(tree)}
    if name not in known or (rest and not dataclasses.is_dataclass(getattr(tree, name))):
        raise ParameterError(f"{path}: there is no such parameter")
    if rest:
        new = _replaced(getattr(tree, name), rest, value, path)
    elif name not in quantities(tree):
        raise ParameterError(f"{path}: there is no such parameter")
    else:
        quantities(tree)[name].check(path, value)
        new = type(getattr(tree, name))(value)
    return dataclasses.replace(tree, **{name: new})

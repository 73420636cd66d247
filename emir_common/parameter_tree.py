"""Parameter dataclasses nested in one another, seen as a flat table of dotted paths."""

import dataclasses
from collections.abc import Mapping
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


def with_values(tree: Tree, values: Mapping[str, Any]) -> Tree:
    """Return the tree with some quantities replaced, given by dotted path.

    One number of a list is given by its place behind the list's path: `unnamed_force.friction.3`.

    Raises ParameterError for a path that does not exist or a value out of range or
    with a fraction where a whole number is wanted.
    """
    result: Tree = _replaced(tree, values, "")
    return result


def _replaced(tree: Any, values: Mapping[str, Any], prefix: str) -> Any:
    new: dict[str, Any] = {}
    branches: dict[str, dict[str, Any]] = {}
    for path, value in values.items():
        name, _, rest = path.partition(".")
        if rest:
            branches.setdefault(name, {})[rest] = value
        elif name in quantities(tree):
            quantities(tree)[name].check(prefix + name, value)
            kind = type(getattr(tree, name))
            if kind is int and value != int(value):
                raise ParameterError(f"{prefix}{name} = {value}: not a whole number")
            new[name] = kind(value)
        else:
            raise _unknown(tree, prefix, name)
    known = {field.name for field in dataclasses.fields(tree)}
    for name, rest_of_it in branches.items():
        branch = getattr(tree, name) if name in known else None
        if isinstance(branch, tuple):
            new[name] = _replaced_in_list(tree, name, rest_of_it, prefix)
            continue
        if not dataclasses.is_dataclass(branch):
            raise _unknown(tree, prefix, f"{name}.{next(iter(rest_of_it))}")
        new[name] = _replaced(branch, rest_of_it, f"{prefix}{name}.")
    return dataclasses.replace(tree, **new)


def _replaced_in_list(
    tree: Any, name: str, numbers: Mapping[str, Any], prefix: str
) -> tuple[float, ...]:
    """Return a list of numbers with some of them replaced, given by their place from 0 on."""
    replaced = list(getattr(tree, name))
    for place, number in numbers.items():
        if not place.isdecimal() or int(place) >= len(replaced):
            raise _unknown(tree, prefix, f"{name}.{place}")
        replaced[int(place)] = number
    quantities(tree)[name].check(prefix + name, replaced)
    return tuple(map(float, replaced))


def _unknown(tree: Any, prefix: str, name: str) -> ParameterError:
    """Return what says that a name is unknown, and which there are beside it."""
    known = [prefix + field.name for field in dataclasses.fields(tree)]
    return ParameterError(
        f"{prefix}{name}: there is no such parameter; there are {', '.join(known)}"
    )

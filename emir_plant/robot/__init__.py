"""The whole machine: base, five joints with their linkages, five elastic arms, one pump.

Importing a module that needs Pinocchio without it raises ModuleNotFoundError; the main joint
alone (`emir_plant.plant`) does without.
"""

from importlib.util import find_spec

from emir_common.quantity import ParameterError


def require_pinocchio() -> None:
    """Raise ParameterError, saying how to get it, where Pinocchio is missing."""
    if find_spec("pinocchio") is None:
        raise ParameterError("the whole robot needs Pinocchio: pip install 'emir_ros[robot]'")

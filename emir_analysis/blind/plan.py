"""What makes a blind test repeatable: its plan, and the foreign effects that come with it."""

from dataclasses import dataclass
from types import ModuleType
from typing import Any, TypeVar

from emir_analysis.errors import InputError

Base = TypeVar("Base")


@dataclass(frozen=True)
class Plan:
    """What makes a blind test repeatable.

    foreign: the source text of a module whose FOREIGN lists what no catalogue holds. duration:
    of each of a machine's two recordings, s, or samples of an actuator. only: effects from which
    to draw; all when empty. varied: each machine is of a sheet of its own, with its own sampling
    and sensors. actuator: machines that are not EMIR, in normalised units.
    """

    seed: int
    duration: float
    foreign: str = ""
    only: tuple[str, ...] = ()
    varied: bool = False
    actuator: bool = False


def foreign_effects(source: str, base: type[Base]) -> tuple[type[Base], ...]:
    """Return what a module's source text lists as FOREIGN, subclasses of `base`.

    Raises InputError without that.
    """
    if not source:
        return ()
    module = ModuleType("foreign")
    try:
        exec(source, module.__dict__)  # noqa: S102 (the user's own file, sent to the workers)
    except Exception as error:  # noqa: BLE001 (whatever that file does)
        raise InputError(f"the foreign effects' file: {error}") from None
    found: Any = getattr(module, "FOREIGN", None)
    if not isinstance(found, tuple) or not found:
        raise InputError("the foreign effects' file has no tuple FOREIGN")
    for effect in found:
        if not (isinstance(effect, type) and issubclass(effect, base)):
            name = getattr(effect, "__name__", repr(effect))
            raise InputError(
                f"the foreign effects' file: {name} is no {base.__module__}.{base.__name__}"
            )
    return found

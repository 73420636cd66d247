"""The machine's parameters as one flat record, the form in which the compiled core reads them."""

import dataclasses
from functools import cache
from operator import attrgetter
from typing import Any, get_type_hints

import numpy as np
from numpy.typing import NDArray

from emir_common.quantity import quantities
from emir_plant.boom import BoomModes, PointMass, boom_modes
from emir_plant.effects import REGISTRY
from emir_plant.linkage import third_side
from emir_plant.parameters import Geometry, Machine
from emir_plant.unnamed import UNNAMED

_UNNAMED = {f"{g}_{n}": q for g, kind in UNNAMED.items() for n, q in quantities(kind).items()}
CURVES = {name: about.count for name, about in _UNNAMED.items() if about.count}
EFFECT_FIELDS = (
    *(f"{effect}_{name}" for effect, kind in REGISTRY.items() for name in quantities(kind)),
    *(name for name, about in _UNNAMED.items() if not about.count),
)
EFFECT_SIZES = (
    *(f"{effect}_{size}" for effect, kind in REGISTRY.items() for size in kind.sizes),
    *(f"{group}_over" for group in UNNAMED),
)


def _paths() -> dict[str, str]:
    """Return the dotted path of each parameter in a machine by its field in the record."""
    found: dict[str, str] = {}
    for group, kind in get_type_hints(Machine).items():
        prefix = f"{group}_" if group in UNNAMED else ""
        found |= {prefix + name: f"{group}.{name}" for name in quantities(kind)}
    for effect, kind in REGISTRY.items():
        found |= {f"{effect}_{name}": f"effects.{effect}.{name}" for name in quantities(kind)}
    return found


_PATHS = _paths()
_read = attrgetter(*_PATHS.values())


def record(machine: Machine) -> NDArray[Any]:
    """Return a structured array of one element with every parameter as a field.

    Fields have the parameter's name; those of an effect, and of what has no name, carry the
    group's name in front. The boom's modes are added with the prefix `mode_`. One element, since
    numba reads an element of an array twenty times faster than a record by itself.
    """
    geometry, load = machine.geometry, machine.effects.payload
    # the modes do not know of this factor: machines that differ in it share them
    plain = dataclasses.replace(geometry, modal_frequency=1.0)
    modes = boom_modes(plain, PointMass(load.mass, load.place))
    values = dict(zip(_PATHS, _read(machine), strict=True)) | _modes(modes, geometry)
    values["length_stretched"] = third_side(
        geometry.triangle_a, geometry.triangle_b, geometry.triangle_gamma0
    )
    return np.array([tuple(values.values())], dtype=_layout(tuple(values), modes.joint.size))


@cache
def _layout(names: tuple[str, ...], modes: int) -> np.dtype[Any]:
    """Return the record's layout: modal quantities are arrays over the modes, curves lists."""
    shapes = {name: (count,) for name, count in CURVES.items()}
    return np.dtype(
        [(n, np.float64, (modes,) if n.startswith("mode_") else shapes.get(n, ())) for n in names]
    )


def _modes(modes: BoomModes, geometry: Geometry) -> dict[str, Any]:
    frequency = modes.frequency * geometry.modal_frequency
    return {
        "mode_stiffness": frequency**2,
        "mode_damping": 2.0 * geometry.modal_damping * frequency,
        "mode_joint": modes.joint,
        "mode_tip_angle": modes.tip_angle,
        "mode_weight": modes.weight,
        "mode_deflection": modes.deflection,
        "mode_tip": geometry.boom_length * modes.joint + modes.deflection,
        "residual_sag": modes.residual_sag,
        "residual_compliance": modes.residual_compliance,
    }

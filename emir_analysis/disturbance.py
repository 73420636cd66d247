"""What disturbs the machine in mid-run: a load dropped or picked up, a push at the TCP.

A push is a force at the TCP, the plant's effect `external_load`. A load that comes or goes makes
another machine of it: the run goes on with another plant, from a state in which

- the boom's shape and the joint's angle are what they were,
- when a load goes, it takes its own momentum along and the boom's motion is what it was,
- when a load comes, it was at rest across the boom: boom and load share the boom's momentum,
- pressures, spool, logic block, time and the memory of effects are what they were.

The new machine has as many modes as the old one: shape and motion are met as well as these allow.
The static share of the modes left out in the TCP's deflection follows the load at once.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from emir_common.parameter_tree import with_values
from emir_plant import core
from emir_plant.boom import boom_modes, rigid_arm_joints, section_model
from emir_plant.effects.external_load import ExternalLoad
from emir_plant.parameters import Machine
from emir_plant.plant import Plant

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LoadChange:
    """From a time, s, on the payload is another one, kg."""

    time: float
    payload: float


def push(machine: Machine, force: float, start: float, duration: float) -> Machine:
    """Return the machine with a push at the TCP, N up, from a start, s, for a duration, s."""
    load = ExternalLoad(force=force, start=start, duration=duration)
    return replace(machine, effects=replace(machine.effects, external_load=load))


def reloaded(plant: Plant, state: Array, payload: float) -> tuple[Plant, Array]:
    """Return the plant with another payload, kg, and the state in which its run goes on."""
    machine = plant.machine
    after = Plant(with_values(machine, {"geometry.payload": payload}))
    old, new = machine.geometry, after.machine.geometry
    before_modes, after_modes = boom_modes(old), boom_modes(new)
    join = np.linalg.pinv(rigid_arm_joints(old))
    shapes, others = join @ before_modes.shapes, join @ after_modes.shapes
    m = shapes.shape[1]
    position = state[core.MODES : core.MODES + m]
    rate = state[core.MODES + m : core.MODES + 2 * m]
    mass = section_model(new).mass
    carried = section_model(old).mass if payload > old.payload else mass
    changed = state.copy()
    changed[core.MODES : core.MODES + m] = _shape(shapes @ position, others, mass)
    changed[core.MODES + m : core.MODES + 2 * m] = others.T @ carried @ (shapes @ rate)
    return after, changed


def _shape(rotations: Array, shapes: Array, mass: Array) -> Array:
    """Return the modal coordinates of a shape: the joint's angle exact, the rest nearest."""
    q = shapes.T @ mass @ rotations
    miss = rotations[0] - shapes[0] @ q
    return np.asarray(q + shapes[0] * miss / (shapes[0] @ shapes[0]))

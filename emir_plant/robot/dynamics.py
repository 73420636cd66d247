"""Equations of motion in the independent coordinates: the linkages' loops closed by reduction.

The tree of `topology.py` has more coordinates z than the machine has freedoms q. The dependent
ones are functions of the joints' angles, so z' = G(q) q' and z'' = G q'' + G' q'; d'Alembert's
principle then gives mass G^T M G and bias G^T rnea(z, z', G' q') with Pinocchio's M and rnea.
Weight and inertia of cylinders, pistons, levers and thrust bars are in it without a further
degree of freedom, exactly.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from emir_plant.robot import kinematics, linkage, reduction
from emir_plant.robot.kinematics import Tree
from emir_plant.robot.parameters import JOINTS, Robot
from emir_plant.robot.reach import Reach, reach, record
from emir_plant.robot.stiffness import cut_damping, cut_stiffness
from emir_plant.robot.topology import TCP, Topology, topology

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Mechanics:
    """The robot's mechanics: n = 96 coordinates q, base and joints, rad, and the cuts' six each.

    Holds Pinocchio's scratch memory: not for two threads at a time.
    """

    robot: Robot

    @cached_property
    def topology(self) -> Topology:
        """The tree and its indices."""
        return topology(self.robot)

    @cached_property
    def linkages(self) -> NDArray[Any]:
        """The linkages as the compiled functions read them, (5,)."""
        return np.concatenate([record(shape) for shape in self.robot.linkages])

    @cached_property
    def reaches(self) -> tuple[Reach, ...]:
        """What each of joints 1-5 reaches."""
        return tuple(reach(shape) for shape in self.robot.linkages)

    @cached_property
    def _data(self) -> Any:
        return self.topology.model.createData()

    @cached_property
    def tree(self) -> Tree:
        """The tree as the compiled functions read it."""
        return kinematics.tree(self.topology)

    @cached_property
    def tcp_place(self) -> tuple[int, Array]:
        """The TCP's joint in `tree` and its place in that joint's frame, (3,), m."""
        model = self.topology.model
        frame = model.frames[model.getFrameId(TCP)]
        return frame.parentJoint - 1, frame.placement.translation.copy()

    @property
    def size(self) -> int:
        """The number of degrees of freedom."""
        return int(self.topology.independent.size)

    @cached_property
    def stiffness(self) -> Array:
        """The springs of the cuts in all coordinates, (n, n)."""
        return self._spread(cut_stiffness(self.robot.arm, self.robot.main.geometry))

    @cached_property
    def damping(self) -> Array:
        """The dampers of the cuts in all coordinates, (n, n)."""
        return self._spread(cut_damping(self.robot.arm, self.robot.main.geometry))

    def _spread(self, block: Array) -> Array:
        whole = np.zeros((self.size, self.size))
        for cut in self.topology.cuts:
            whole[np.ix_(cut, cut)] = block
        return whole

    def expand(self, q: Array, v: Array) -> tuple[Array, Array, Array, Array]:
        """Return the tree's coordinates z, rates G v and G' v, (114,), and slopes (18,)."""
        t = self.topology
        return reduction.expand(q, v, t.independent, t.joints, t.parts, self.linkages)

    def mass(self, q: Array) -> Array:
        """Return the mass matrix, (n, n), at the coordinates q, (n,)."""
        return self.mass_and_bias(q, np.zeros_like(q))[0]

    def bias(self, q: Array, v: Array) -> Array:
        """Return the generalised forces, (n,), that gravity and velocities ask of the drives."""
        return self.posture_and_bias(q, v)[1]

    def posture_and_bias(self, q: Array, v: Array) -> tuple[tuple[Array, Array], Array]:
        """Return the tree's coordinates and the parts' slopes (see `expand`), and the bias."""
        t = self.topology
        z, rate, rest, slopes = self.expand(q, v)
        tree = pin.rnea(t.model, self._data, z, rate, rest)
        force = reduction.reduced_force(tree, t.independent, t.joints, t.parts, slopes)
        return (z, slopes), force

    def mass_and_bias(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Return both at once, in one pass over the linkages."""
        t = self.topology
        (z, slopes), force = self.posture_and_bias(q, v)
        tree = pin.crba(t.model, self._data, z, pin.Convention.WORLD)
        return reduction.reduced_mass(tree, t.independent, t.joints, t.parts, slopes), force

    def acceleration(self, q: Array, v: Array, torques: Array) -> Array:
        """Return q'', (n,), under the joints' torques, (6,), N m."""
        mass, force = self.mass_and_bias(q, v)
        load = -force - self.stiffness @ q - self.damping @ v
        load[self.topology.joints] += torques
        return np.asarray(np.linalg.solve(mass, load))

    def energy(self, q: Array, v: Array) -> tuple[float, float, float]:
        """Return kinetic energy, that of gravity (0 on the ground) and of the springs, J."""
        z, rate, _, _ = self.expand(q, v)
        t = self.topology
        kinetic = pin.computeKineticEnergy(t.model, self._data, z, rate)
        weight = pin.computePotentialEnergy(t.model, self._data, z)
        return kinetic, weight, 0.5 * float(q @ self.stiffness @ q)

    def tcp(self, q: Array) -> tuple[Array, Array]:
        """Return the TCP's position r_6, (3,) m, and orientation, (3, 3), columns x_6, y_6, z_6."""
        places, axes = self.tips(q)
        return places[0], axes[0]

    def tips(self, q: Array) -> tuple[Array, Array]:
        """Return the TCP's position, (2, 3), m, and axes, (2, 3, 3): as it is, and unbent."""
        return kinematics.tips(q, self.topology.joints, self.tree, self.tcp_place)

    def ratios(self, q: Array) -> Array:
        """Return dh/dalpha of joints 1-5, (5,), m."""
        angles = q[self.topology.joints[1:]]
        return np.array([linkage.ratio(angles[i], self.linkages[i]) for i in range(JOINTS)])

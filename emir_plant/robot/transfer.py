"""Transfer functions (2)-(4) of joint 1 in any posture of the whole robot, joints 2-5 locked.

As `emir_plant.transfer` does for the stretched boom: the rigid and four bending modes of the
boom's plane, with the weight's and the linkage's change with alpha_1 added.
"""

import numpy as np
import scipy
from numpy.typing import NDArray

from emir_plant.robot import linkage
from emir_plant.robot.dynamics import Mechanics
from emir_plant.robot.posture import rest, weight_stiffness
from emir_plant.transfer import Mechanics as JointMechanics

Array = NDArray[np.float64]

PITCH = 4  # place of the rotation about y among a cut's coordinates
COUPLED = 0.3  # share of the rigid mode, below which a mode hardly answers to joint 1


def joint_mechanics(mechanics: Mechanics, joints: Array, kept: int = 5) -> JointMechanics:
    """Return joint 1's mechanics about rest at the six joint angles, rad, base first.

    kept: modes, the rigid one included. Raises PostureError outside a linkage's reach.
    """
    held = rest(mechanics, joints)
    q, t = held.coordinates, mechanics.topology
    free = np.setdiff1d(np.arange(q.size), np.delete(t.joints, 1))
    block = np.ix_(free, free)
    squares, shapes = scipy.linalg.eigh(mechanics.stiffness[block], mechanics.mass(q)[block])
    whole = np.zeros((q.size, free.size))
    whole[free] = shapes
    joint = whole[t.joints[1]]
    # out are modes across the boom's plane, which do not turn joint 1 at all, and along it
    chosen = np.flatnonzero(np.abs(joint) > COUPLED * abs(joint[0]))[:kept]
    whole, joint, squares = whole[:, chosen], joint[chosen], squares[chosen]
    squares[0] = 0.0  # the rigid mode, but for rounding
    angle = joints[1]
    of = mechanics.linkages[0]
    follower = joint * held.forces[0] * linkage.ratio_slope(angle, of)
    follower -= whole.T @ weight_stiffness(mechanics, q)[:, t.joints[1]]
    return JointMechanics(
        damping=mechanics.robot.arm.damping_time * squares,
        stiffness=squares,
        joint=joint,
        tip=joint - whole[t.cuts[:, PITCH]].sum(axis=0),  # pitch turns down
        follower=follower,
        arm=linkage.ratio(angle, of),
    )

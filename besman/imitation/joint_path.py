"""The joint movement of a Cartesian plan: inverse kinematics after the rollout.

The pose is solved for at equal steps, each from the one before, and from the plan's own joint
angles at the start: one branch, no jumps but those the poses force. A quintic spline through the
joint angles, at rest at both ends, gives velocities and accelerations.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.interpolate import make_interp_spline

from besman.frames import quaternion_to_rotation
from besman.imitation.cartesian_dmp import roll_out_poses
from besman.imitation.dmp import N_NODES, DmpBasis
from besman.records import CartesianPlan
from besman.robot.ik_kernel import follow_paths
from besman.robot.inverse_kinematics import IkWeights, joint_box
from besman.robot.model import Robot

FloatArray = npt.NDArray[np.float64]

N_POSES = 126  # every fourth node of a DMP
_ROUNDS, _TOLERANCE = 60, 1e-12


@lru_cache(maxsize=1)
def spline_map() -> DmpBasis:
    """Give the quintic spline through `N_POSES` equal steps, at rest at its ends, as matrices.

    Returns
    -------
    DmpBasis
        Arrays of shape (N_NODES, N_POSES), to be multiplied with the values at the steps.
    """
    steps = np.linspace(0.0, 1.0, N_POSES)
    rest = [(1, np.zeros(N_POSES)), (2, np.zeros(N_POSES))]
    spline = make_interp_spline(steps, np.eye(N_POSES), k=5, bc_type=(rest, rest))
    nodes = np.linspace(0.0, 1.0, N_NODES)
    arrays = [spline(nodes), spline.derivative()(nodes), spline.derivative(2)(nodes)]
    for array in arrays:
        array.setflags(write=False)
    return DmpBasis(*arrays)


def plan_poses(plan: CartesianPlan) -> FloatArray:
    """Return the poses that a plan asks for at `N_POSES` equal steps, shape (N_POSES, 4, 4)."""
    path = roll_out_poses(plan.weights, plan.start, plan.goal, 1.0, np.linspace(0, 1, N_POSES))
    poses = np.zeros((N_POSES, 4, 4))
    poses[:, :3, :3] = quaternion_to_rotation(path[:, 3:])
    poses[:, :3, 3] = path[:, :3]
    poses[:, 3, 3] = 1.0
    return poses


def ik_weights(plan: CartesianPlan) -> IkWeights:
    """Return what counts how much where the arm cannot have position and orientation."""
    return IkWeights(orientation=plan.orientation_weight_m_rad)


def joint_steps(plan: CartesianPlan, robot: Robot) -> tuple[FloatArray, FloatArray]:
    """Solve for the joints at `N_POSES` equal steps.

    Parameters
    ----------
    plan : CartesianPlan
    robot : Robot
        The plan's, with its tool.

    Returns
    -------
    positions : array, shape (N_POSES, n)
        rad, within the arm's limits.
    errors : array, shape (N_POSES, 2)
        Position (m) and orientation (rad) between the poses asked for and those reached.
    """
    chain = robot.chain
    low, high = joint_box(robot)
    # What the pose at the start leaves open is settled by the plan's own joint angles.
    joints = np.array(plan.joints)
    found, errors = follow_paths(
        chain.placements,
        chain.axes,
        chain.tip,
        low,
        high,
        joints,
        ik_weights(plan).as_array(),
        plan.free_spin,
        plan_poses(plan)[None],
        joints[None],
        0,
        _ROUNDS,
        _TOLERANCE,
    )
    return found[0, 0], errors[0, 0]


def joint_nodes(plan: CartesianPlan, robot: Robot) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the joint movement at the `N_NODES` nodes of normalised time.

    Parameters
    ----------
    plan : CartesianPlan
    robot : Robot
        The plan's, with its tool.

    Returns
    -------
    positions, velocities, accelerations : array, shape (N_NODES, n)
        rad, and derivatives with respect to normalised time.
    """
    steps, _ = joint_steps(plan, robot)
    spline = spline_map()
    return spline.position @ steps, spline.velocity @ steps, spline.acceleration @ steps

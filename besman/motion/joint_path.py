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

from besman.geometry.frames import quaternion_to_rotation
from besman.motion.cartesian_dmp import roll_out_poses
from besman.motion.dmp import interpolate
from besman.motion.forcing import count_nodes
from besman.records import CartesianPlan
from besman.robot.ik_kernel import follow_paths
from besman.robot.inverse_kinematics import IkWeights, joint_box
from besman.robot.model import Robot

FloatArray = npt.NDArray[np.float64]

_NODES_A_STEP = 4
# With more steps than this the spline is solved for anew; a matrix would grow with the square.
_DENSE_POSES = 126
_ROUNDS, _TOLERANCE = 60, 1e-12


def count_poses(plan: CartesianPlan) -> int:
    """Return at how many equal steps a plan's poses are solved for: they follow its weights."""
    return (count_nodes(plan.weights.shape[1]) - 1) // _NODES_A_STEP + 1


@lru_cache(maxsize=8)
def _spline_map(n_poses: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Give `lay_spline` as matrices, shape (N, n_poses), to be multiplied with the steps."""
    q, v, a = lay_spline(np.eye(n_poses))
    for array in (q, v, a):
        array.setflags(write=False)
    return q, v, a


def lay_spline(steps: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Lay the quintic spline through equal steps, at rest at its ends.

    Parameters
    ----------
    steps : array, shape (P, n)

    Returns
    -------
    positions, velocities, accelerations : array, shape (4 (P - 1) + 1, n)
    """
    n_poses, n = steps.shape
    rest = [(1, np.zeros(n)), (2, np.zeros(n))]
    places = np.linspace(0.0, 1.0, n_poses)
    spline = make_interp_spline(places, steps, k=5, bc_type=(rest, rest))
    nodes = np.linspace(0.0, 1.0, _NODES_A_STEP * (n_poses - 1) + 1)
    return spline(nodes), spline.derivative()(nodes), spline.derivative(2)(nodes)


def plan_poses(plan: CartesianPlan) -> FloatArray:
    """Return the poses that a plan asks for at `count_poses` equal steps, shape (P, 4, 4)."""
    at = np.linspace(0, 1, count_poses(plan))
    path = roll_out_poses(plan.weights, plan.start, plan.goal, 1.0, at)
    poses = np.zeros((len(at), 4, 4))
    poses[:, :3, :3] = quaternion_to_rotation(path[:, 3:])
    poses[:, :3, 3] = path[:, :3]
    poses[:, 3, 3] = 1.0
    return poses


def ik_weights(plan: CartesianPlan) -> IkWeights:
    """Return what counts how much where the arm cannot have position and orientation."""
    return IkWeights(orientation=plan.orientation_weight_m_rad)


def joint_steps(plan: CartesianPlan, robot: Robot) -> tuple[FloatArray, FloatArray]:
    """Solve for the joints at `count_poses` equal steps.

    Parameters
    ----------
    plan : CartesianPlan
    robot : Robot
        The plan's, with its tool.

    Returns
    -------
    positions : array, shape (P, n)
        rad, within the arm's limits.
    errors : array, shape (P, 2)
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
    """Return the joint movement at the nodes of normalised time.

    Parameters
    ----------
    plan : CartesianPlan
    robot : Robot
        The plan's, with its tool.

    Returns
    -------
    positions, velocities, accelerations : array, shape (N, n)
        rad, and derivatives with respect to normalised time.
    """
    steps, _ = joint_steps(plan, robot)
    if len(steps) > _DENSE_POSES:
        return lay_spline(steps)
    q, v, a = _spline_map(len(steps))
    return q @ steps, v @ steps, a @ steps


def greatest_rates(
    positions: FloatArray, velocities: FloatArray, accelerations: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return values among which are the greatest velocities and accelerations between nodes.

    Where a joint has to turn sharply, the acceleration swings within a step. It is a cubic
    polynomial there, so its extremes are known; the velocity is looked at in four times as many
    places as there are nodes.

    Parameters
    ----------
    positions, velocities, accelerations : array, shape (N, n)
        As `joint_nodes` gives them.

    Returns
    -------
    velocities, accelerations : array, shape (..., n)
    """
    fine = np.linspace(0.0, 1.0, 4 * (len(positions) - 1) + 1)
    _, speeds, _ = interpolate(positions, velocities, accelerations, fine)
    # Values of every step's cubic at 0, 1/4, 1/2 and 1, then its coefficients.
    at = np.array([0, 1, 2, _NODES_A_STEP])
    first = np.arange(0, len(positions) - 1, _NODES_A_STEP)
    values = accelerations[first + at[:, None]]
    powers = np.vander(at / _NODES_A_STEP, 4, increasing=True)
    c0, c1, c2, c3 = np.tensordot(np.linalg.inv(powers), values, axes=1)
    root = np.sqrt(np.maximum(c2**2 - 3.0 * c1 * c3, 0.0))
    # Both roots of 3 c3 u^2 + 2 c2 u + c1, without cancellation.
    q = -(c2 + np.where(c2 < 0.0, -root, root))
    tiny = np.finfo(np.float64).tiny
    extremes = [
        np.clip(above / np.where(np.abs(below) > tiny, below, np.inf), 0.0, 1.0)
        for above, below in ((q, 3.0 * c3), (c1, q))
    ]
    peaks = [c0 + u * (c1 + u * (c2 + u * c3)) for u in extremes]
    return speeds, np.concatenate([accelerations, *peaks])

r"""DMPs of the tool's pose as linear maps.

The position follows the transformation system of `besman.motion.dmp`, and so does the rotation
vector r = 2 log(q g*) that turns the goal's orientation g into the tool's, along the axes of the
world; it ends at zero. In these six coordinates the pose is linear in start and weights, and the
orientation comes by the exponential map: q = exp(r / 2) g.

Eq. 16 of [1]_ writes the same spring for the angular velocity in place of r'. Both agree where
the tool turns about one axis; else the spring of [1]_ is not linear, and its goal is reached
differently about every axis (see [2]_, whose formulation this is, with the forcing term of [3]_).

References
----------
.. [1] A. Ude, B. Nemec, T. Petric, J. Morimoto: Orientation in Cartesian space dynamic movement
   primitives. ICRA 2014, DOI 10.1109/ICRA.2014.6907291.
.. [2] L. Koutras, Z. Doulgeri: A correct formulation for the orientation dynamic movement
   primitives for robot control in the Cartesian space. CoRL 2019, PMLR 100.
.. [3] P. Pastor, H. Hoffmann, T. Asfour, S. Schaal: Learning and generalization of motor skills by
   learning from demonstration. ICRA 2009, eq. 5, DOI 10.1109/ROBOT.2009.5152385.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.geometry.quaternions import (
    conjugate,
    from_rotation_vector,
    make_continuous,
    multiply,
    rotation_vector,
)
from besman.motion.dmp import roll_out
from besman.motion.dmp_fit import fit_weights, goal_response

FloatArray = npt.NDArray[np.float64]


def pose_coordinates(poses: npt.ArrayLike, goal: npt.ArrayLike) -> FloatArray:
    """Express poses by their position and the rotation vector from the goal's orientation.

    Parameters
    ----------
    poses, goal : array, shape (..., 7)
        Position (m) and unit quaternion wxyz; the signs say which way round the tool turns.

    Returns
    -------
    array, shape (..., 6)
        m, rad; along the axes of the world.
    """
    poses, goal = np.asarray(poses, dtype=np.float64), np.asarray(goal, dtype=np.float64)
    turned = rotation_vector(multiply(poses[..., 3:], conjugate(goal[..., 3:])))
    return np.concatenate([np.broadcast_to(poses[..., :3], turned.shape), turned], axis=-1)


def roll_out_poses(
    weights: npt.ArrayLike,
    start: npt.ArrayLike,
    goal: npt.ArrayLike,
    duration: npt.ArrayLike,
    time: npt.ArrayLike,
) -> FloatArray:
    """Compute the poses of one or many DMPs.

    Parameters
    ----------
    weights : array, shape (..., 6, K)
        Of the forcing terms.
    start, goal : array, shape (..., 7)
        Position (m) and unit quaternion wxyz.
    duration : array, shape (...)
        Seconds.
    time : array, shape (T,)
        Seconds from the start; after the duration the tool stands where the movement ended.

    Returns
    -------
    array, shape (..., T, 7)
        Position (m) and unit quaternion wxyz.
    """
    goal = np.asarray(goal, dtype=np.float64)
    first, last = pose_coordinates(start, goal), pose_coordinates(goal, goal)
    coordinates, _, _ = roll_out(weights, first, last, duration, time)
    turned = multiply(from_rotation_vector(coordinates[..., 3:]), goal[..., None, 3:])
    return np.concatenate([coordinates[..., :3], turned], axis=-1)


def fit_poses(
    time: npt.ArrayLike, poses: npt.ArrayLike, n_weights: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fit a DMP to a path of poses by least squares; it starts and ends at rest.

    Parameters
    ----------
    time : array, shape (T,)
        Seconds from 0, rising.
    poses : array, shape (T, 7)
        Position (m) and unit quaternion wxyz, of either sign.
    n_weights : int
        Weights per coordinate, at least 5.

    Returns
    -------
    weights : array, shape (6, n_weights)
    start, goal : array, shape (7,)
        The first and the last pose; their signs say which way round the tool turned.
    """
    path = np.array(poses, dtype=np.float64)
    path[:, 3:] = make_continuous(path[:, 3:])
    weights = fit_weights(time, pose_coordinates(path, path[-1]), n_weights)
    return weights, path[0], path[-1]


def move_ends(
    weights: npt.ArrayLike,
    ends: tuple[npt.ArrayLike, npt.ArrayLike],
    new_ends: tuple[npt.ArrayLike, npt.ArrayLike],
) -> FloatArray:
    """Change the weights with start and goal such that a movement at rest at its ends stays so.

    Parameters
    ----------
    weights : array, shape (6, K)
        Of the movement as it is.
    ends, new_ends : tuple of two arrays, shape (7,)
        Start and goal, before and after.

    Returns
    -------
    array, shape (6, K)
    """
    weights = np.asarray(weights, dtype=np.float64)
    way = [
        pose_coordinates(goal, goal) - pose_coordinates(start, goal)
        for start, goal in (ends, new_ends)
    ]
    return weights + np.outer(way[1] - way[0], goal_response(weights.shape[1]))


def same_turn(goal: npt.ArrayLike, like: npt.ArrayLike) -> FloatArray:
    """Choose the sign of a pose's quaternion so that it is the nearer one to another pose's.

    Parameters
    ----------
    goal, like : array, shape (7,)
        Position (m) and unit quaternion wxyz.

    Returns
    -------
    array, shape (7,)
    """
    pose = np.array(goal, dtype=np.float64)
    if pose[3:] @ np.asarray(like)[3:] < 0.0:
        pose[3:] *= -1.0
    return pose

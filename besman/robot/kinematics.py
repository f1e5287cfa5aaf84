"""Forward kinematics and Jacobians of many configurations at once."""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

from besman.exceptions import RobotError
from besman.robot.model import Chain

FloatArray = npt.NDArray[np.float64]


def forward_kinematics(chain: Chain, positions: npt.ArrayLike) -> FloatArray:
    """Compute the pose of the tool centre point.

    Parameters
    ----------
    chain : Chain
        The arm.
    positions : array, shape (..., n)
        Joint angles, rad.

    Returns
    -------
    array, shape (..., 4, 4)
        Poses in the robot's world frame (floor below the base), metres.

    Raises
    ------
    RobotError
        If the last axis is not n long.
    """
    rows, shape = as_rows(chain, positions)
    poses = _forward(chain.placements, chain.axes, chain.tip, rows)
    return poses.reshape(*shape, 4, 4)


def jacobian(chain: Chain, positions: npt.ArrayLike) -> FloatArray:
    """Compute the geometric Jacobian of the tool centre point.

    Parameters
    ----------
    chain : Chain
        The arm.
    positions : array, shape (..., n)
        Joint angles, rad.

    Returns
    -------
    array, shape (..., 6, n)
        Rows: linear velocity (m/s), then angular velocity (rad/s), along the world's axes.

    Raises
    ------
    RobotError
        If the last axis is not n long.
    """
    rows, shape = as_rows(chain, positions)
    jacobians = _jacobians(chain.placements, chain.axes, chain.tip, rows)
    return jacobians.reshape(*shape, 6, len(chain.axes))


def manipulability(chain: Chain, positions: npt.ArrayLike) -> FloatArray:
    """Compute the manipulability sqrt(det(J J')), zero in singular configurations.

    Parameters
    ----------
    chain : Chain
        The arm.
    positions : array, shape (..., n)
        Joint angles, rad.

    Returns
    -------
    array, shape (...)
        Metres cubed (three linear rows, three angular ones).

    References
    ----------
    T. Yoshikawa: Manipulability of robotic mechanisms, 1985, equation 6.
    doi:10.1177/027836498500400201
    """
    matrices = jacobian(chain, positions)
    squares = np.linalg.det(matrices @ np.swapaxes(matrices, -1, -2))
    return np.asarray(np.sqrt(np.maximum(squares, 0.0)), dtype=np.float64)


def as_rows(chain: Chain, positions: npt.ArrayLike) -> tuple[FloatArray, tuple[int, ...]]:
    """Return configurations as rows, shape (B, n), and the shape of the leading axes.

    Raises
    ------
    RobotError
        If the last axis is not n long.
    """
    array = np.asarray(positions, dtype=np.float64)
    n = len(chain.axes)
    if array.ndim == 0 or array.shape[-1] != n:
        raise RobotError(f"joint angles must have shape (..., {n}), got {array.shape}")
    return np.ascontiguousarray(array.reshape(-1, n)), array.shape[:-1]


@numba.njit(cache=True, nogil=True)
def fill_frames(
    placements: FloatArray,
    axes: FloatArray,
    angles: FloatArray,
    rotations: FloatArray,
    origins: FloatArray,
) -> None:
    """Write the pose of every joint's frame, turned by its angle, into the last two arrays.

    Parameters
    ----------
    placements, axes : array
        As in `Chain`.
    angles : array, shape (n,)
        rad.
    rotations : array, shape (n, 3, 3)
        Written: joint2world.
    origins : array, shape (n, 3)
        Written: metres in the world.
    """
    base = np.eye(3)
    position = np.zeros(3)
    turn = np.empty((3, 3))
    for joint in range(len(angles)):
        if joint > 0:
            base = rotations[joint - 1]
            position = origins[joint - 1]
        x, y, z = axes[joint, 0], axes[joint, 1], axes[joint, 2]
        c, s = np.cos(angles[joint]), np.sin(angles[joint])
        v = 1.0 - c
        turn[0, 0], turn[0, 1], turn[0, 2] = c + x * x * v, x * y * v - z * s, x * z * v + y * s
        turn[1, 0], turn[1, 1], turn[1, 2] = x * y * v + z * s, c + y * y * v, y * z * v - x * s
        turn[2, 0], turn[2, 1], turn[2, 2] = x * z * v - y * s, y * z * v + x * s, c + z * z * v
        for row in range(3):
            p0 = base[row, 0] * placements[joint, 0, 0] + base[row, 1] * placements[joint, 1, 0]
            p0 += base[row, 2] * placements[joint, 2, 0]
            p1 = base[row, 0] * placements[joint, 0, 1] + base[row, 1] * placements[joint, 1, 1]
            p1 += base[row, 2] * placements[joint, 2, 1]
            p2 = base[row, 0] * placements[joint, 0, 2] + base[row, 1] * placements[joint, 1, 2]
            p2 += base[row, 2] * placements[joint, 2, 2]
            shift = base[row, 0] * placements[joint, 0, 3] + base[row, 1] * placements[joint, 1, 3]
            shift += base[row, 2] * placements[joint, 2, 3]
            origins[joint, row] = position[row] + shift
            for column in range(3):
                rotations[joint, row, column] = (
                    p0 * turn[0, column] + p1 * turn[1, column] + p2 * turn[2, column]
                )


@numba.njit(cache=True, nogil=True)
def fill_tip(
    tip: FloatArray,
    last_rotation: FloatArray,
    last_origin: FloatArray,
    rotation: FloatArray,
    origin: FloatArray,
) -> None:
    """Write the pose of the tool centre point into the last two arrays."""
    for row in range(3):
        a, b, c = last_rotation[row, 0], last_rotation[row, 1], last_rotation[row, 2]
        for column in range(3):
            rotation[row, column] = a * tip[0, column] + b * tip[1, column] + c * tip[2, column]
        origin[row] = last_origin[row] + a * tip[0, 3] + b * tip[1, 3] + c * tip[2, 3]


@numba.njit(cache=True, nogil=True)
def fill_jacobian(
    axes: FloatArray,
    rotations: FloatArray,
    origins: FloatArray,
    point: FloatArray,
    result: FloatArray,
) -> None:
    """Write the geometric Jacobian of a point of the last body into `result`, shape (6, n)."""
    for joint in range(len(axes)):
        axis = np.empty(3)
        for row in range(3):
            axis[row] = (
                rotations[joint, row, 0] * axes[joint, 0]
                + rotations[joint, row, 1] * axes[joint, 1]
                + rotations[joint, row, 2] * axes[joint, 2]
            )
        x = point[0] - origins[joint, 0]
        y = point[1] - origins[joint, 1]
        z = point[2] - origins[joint, 2]
        result[0, joint] = axis[1] * z - axis[2] * y
        result[1, joint] = axis[2] * x - axis[0] * z
        result[2, joint] = axis[0] * y - axis[1] * x
        result[3:, joint] = axis


@numba.njit(cache=True, nogil=True)
def _forward(
    placements: FloatArray, axes: FloatArray, tip: FloatArray, rows: FloatArray
) -> FloatArray:
    """Compute the poses of the tool centre point, shape (B, 4, 4)."""
    n = len(axes)
    rotations, origins = np.empty((n, 3, 3)), np.empty((n, 3))
    poses = np.zeros((len(rows), 4, 4))
    rotation, origin = np.empty((3, 3)), np.empty(3)
    for index in range(len(rows)):
        fill_frames(placements, axes, rows[index], rotations, origins)
        fill_tip(tip, rotations[n - 1], origins[n - 1], rotation, origin)
        poses[index, :3, :3] = rotation
        poses[index, :3, 3] = origin
        poses[index, 3, 3] = 1.0
    return poses


@numba.njit(cache=True, nogil=True)
def _jacobians(
    placements: FloatArray, axes: FloatArray, tip: FloatArray, rows: FloatArray
) -> FloatArray:
    """Compute the Jacobians of the tool centre point, shape (B, 6, n)."""
    n = len(axes)
    rotations, origins = np.empty((n, 3, 3)), np.empty((n, 3))
    rotation, origin = np.empty((3, 3)), np.empty(3)
    result = np.empty((len(rows), 6, n))
    for index in range(len(rows)):
        fill_frames(placements, axes, rows[index], rotations, origins)
        fill_tip(tip, rotations[n - 1], origins[n - 1], rotation, origin)
        fill_jacobian(axes, rotations, origins, origin, result[index])
    return result

"""Forward kinematics and Jacobians of many configurations at once."""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

from besman.exceptions import RobotError
from besman.robot.parts import Chain

FloatArray = npt.NDArray[np.float64]

# Kernels write loops out: array expressions would multiply the time to compile them.
compiled = numba.njit(cache=True, nogil=True, error_model="numpy")


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
    poses, _ = _tip_motion(chain.placements, chain.axes, chain.tip, rows)
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
    _, jacobians = _tip_motion(chain.placements, chain.axes, chain.tip, rows)
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
    # Always a fresh, writable copy: a read-only array would be another type to the compiler.
    return np.array(array.reshape(-1, n), order="C"), array.shape[:-1]


@compiled
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
    for joint in range(len(angles)):
        x, y, z = axes[joint, 0], axes[joint, 1], axes[joint, 2]
        c, s = np.cos(angles[joint]), np.sin(angles[joint])
        v = 1.0 - c
        place = placements[joint]
        for row in range(3):
            p0, p1, p2, shift = place[row, 0], place[row, 1], place[row, 2], place[row, 3]
            if joint > 0:
                before = rotations[joint - 1]
                a, b, d = before[row, 0], before[row, 1], before[row, 2]
                p0 = a * place[0, 0] + b * place[1, 0] + d * place[2, 0]
                p1 = a * place[0, 1] + b * place[1, 1] + d * place[2, 1]
                p2 = a * place[0, 2] + b * place[1, 2] + d * place[2, 2]
                shift = a * place[0, 3] + b * place[1, 3] + d * place[2, 3]
                shift += origins[joint - 1, row]
            origins[joint, row] = shift
            # The columns of Rodrigues' rotation about the axis.
            rotations[joint, row, 0] = (
                p0 * (c + x * x * v) + p1 * (x * y * v + z * s) + p2 * (x * z * v - y * s)
            )
            rotations[joint, row, 1] = (
                p0 * (x * y * v - z * s) + p1 * (c + y * y * v) + p2 * (y * z * v + x * s)
            )
            rotations[joint, row, 2] = (
                p0 * (x * z * v + y * s) + p1 * (y * z * v - x * s) + p2 * (c + z * z * v)
            )


@compiled
def fill_tip(tip: FloatArray, rotations: FloatArray, origins: FloatArray, pose: FloatArray) -> None:
    """Write the pose of the tool centre point (4, 4), upper three rows, from the joints' frames."""
    last = len(origins) - 1
    for row in range(3):
        a, b, d = rotations[last, row, 0], rotations[last, row, 1], rotations[last, row, 2]
        for column in range(4):
            pose[row, column] = a * tip[0, column] + b * tip[1, column] + d * tip[2, column]
        pose[row, 3] += origins[last, row]


@compiled
def fill_jacobian(
    axes: FloatArray,
    rotations: FloatArray,
    origins: FloatArray,
    pose: FloatArray,
    result: FloatArray,
) -> None:
    """Write the geometric Jacobian (6, n) of the tool centre point at `pose` into `result`."""
    for joint in range(len(axes)):
        for row in range(3):
            result[3 + row, joint] = (
                rotations[joint, row, 0] * axes[joint, 0]
                + rotations[joint, row, 1] * axes[joint, 1]
                + rotations[joint, row, 2] * axes[joint, 2]
            )
        a, b, d = result[3, joint], result[4, joint], result[5, joint]
        x = pose[0, 3] - origins[joint, 0]
        y = pose[1, 3] - origins[joint, 1]
        z = pose[2, 3] - origins[joint, 2]
        result[0, joint] = b * z - d * y
        result[1, joint] = d * x - a * z
        result[2, joint] = a * y - b * x


@compiled
def _tip_motion(
    placements: FloatArray, axes: FloatArray, tip: FloatArray, rows: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Compute poses (B, 4, 4) and Jacobians (B, 6, n) of the tool centre point."""
    n = len(axes)
    rotations, origins = np.empty((n, 3, 3)), np.empty((n, 3))
    poses, jacobians = np.zeros((len(rows), 4, 4)), np.empty((len(rows), 6, n))
    for index in range(len(rows)):
        fill_frames(placements, axes, rows[index], rotations, origins)
        fill_tip(tip, rotations, origins, poses[index])
        fill_jacobian(axes, rotations, origins, poses[index], jacobians[index])
        poses[index, 3, 3] = 1.0
    return poses, jacobians

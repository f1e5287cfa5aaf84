"""Quaternions (w, x, y, z) in batches. A sign is kept: q and -q turn different ways round."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


def multiply(first: npt.ArrayLike, second: npt.ArrayLike) -> FloatArray:
    """Multiply quaternions, shape (..., 4): the rotation `second`, then `first`."""
    a, b = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    scalar = a[..., :1] * b[..., :1] - np.sum(a[..., 1:] * b[..., 1:], axis=-1, keepdims=True)
    vector = a[..., :1] * b[..., 1:] + b[..., :1] * a[..., 1:] + np.cross(a[..., 1:], b[..., 1:])
    return np.concatenate([scalar, vector], axis=-1)


def conjugate(quaternion: npt.ArrayLike) -> FloatArray:
    """Return the inverse rotation of unit quaternions, shape (..., 4)."""
    inverse: FloatArray = np.asarray(quaternion, dtype=np.float64) * np.array(
        [1.0, -1.0, -1.0, -1.0]
    )
    return inverse


def rotation_vector(quaternion: npt.ArrayLike) -> FloatArray:
    """Return twice the logarithm of unit quaternions.

    Parameters
    ----------
    quaternion : array, shape (..., 4)

    Returns
    -------
    array, shape (..., 3)
        Axis times angle, rad; the angle is 0 to 2 pi, beyond pi where w is negative.
    """
    array = np.asarray(quaternion, dtype=np.float64)
    w, vector = array[..., :1], array[..., 1:]
    sine = np.linalg.norm(vector, axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, w)
    # Below the threshold sin(x) / x is 1 to the last digit.
    return vector * np.where(sine > 1e-9, angle / np.maximum(sine, 1e-9), 2.0)


def from_rotation_vector(vector: npt.ArrayLike) -> FloatArray:
    """Return the unit quaternions (..., 4) of rotation vectors (..., 3), rad."""
    half = 0.5 * np.asarray(vector, dtype=np.float64)
    angle = np.linalg.norm(half, axis=-1, keepdims=True)
    return np.concatenate([np.cos(angle), half * np.sinc(angle / np.pi)], axis=-1)


def make_continuous(quaternions: npt.ArrayLike) -> FloatArray:
    """Choose the signs of a sequence, shape (T, 4), so that none turns by more than pi a step."""
    array = np.array(quaternions, dtype=np.float64)
    turns = np.sign(np.sum(array[1:] * array[:-1], axis=1))
    array[1:] *= np.cumprod(np.where(turns < 0, -1.0, 1.0))[:, None]
    return array

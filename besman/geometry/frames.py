"""Frames that are defined by markers: the person's back and hand."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.exceptions import LabellingError

FloatArray = npt.NDArray[np.float64]

# Marker clusters are centimetres wide; below this the direction is noise.
_SMALLEST_BASE_M = 1e-3


def back_frame(
    back_top: npt.ArrayLike, back_left: npt.ArrayLike, back_right: npt.ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Heading frame of a person: x forward, y left, z up against gravity.

    The back may lean; the frame does not, so that gravity stays gravity.

    Parameters
    ----------
    back_top, back_left, back_right : array, shape (..., 3)
        Markers on the back, metres in the laboratory frame (z up).

    Returns
    -------
    rotation : array, shape (..., 3, 3)
        back2lab: the columns are the axes of the back frame in the laboratory frame.
    origin : array, shape (..., 3)
        Centroid of the three markers, metres in the laboratory frame.

    Raises
    ------
    LabellingError
        If the left and the right marker lie on top of each other, or one of them is not seen.
    """
    top, left, right = _markers("back", back_top, back_left, back_right)
    across = left - right
    across[..., 2] = 0.0
    y = _unit(across, "back frame", "back_left and back_right at least 1 mm apart horizontally")
    z = np.zeros_like(y)
    z[..., 2] = 1.0
    rotation = np.stack([np.cross(y, z), y, z], axis=-1)
    return rotation, (top + left + right) / 3


def hand_frame(
    hand_top: npt.ArrayLike, hand_left: npt.ArrayLike, hand_right: npt.ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Frame of a hand: x towards the fingers, z out of the back of a right hand.

    Parameters
    ----------
    hand_top, hand_left, hand_right : array, shape (..., 3)
        Markers on the hand, metres.

    Returns
    -------
    rotation : array, shape (..., 3, 3)
        hand2lab: the columns are the axes of the hand frame in the frame of the markers.
    origin : array, shape (..., 3)
        Centroid of the three markers, metres.

    Raises
    ------
    LabellingError
        If the markers lie on a line, or one of them is not seen.
    """
    top, left, right = _markers("hand", hand_top, hand_left, hand_right)
    expected = "three hand markers that are not on a line"
    x = _unit(top - (left + right) / 2, "hand frame", expected)
    z = _unit(np.cross(x, left - right), "hand frame", expected)
    rotation = np.stack([x, np.cross(z, x), z], axis=-1)
    return rotation, (top + left + right) / 3


def rotation_to_quaternion(rotation: npt.ArrayLike) -> FloatArray:
    """Turn rotation matrices into quaternions of one hemisphere along the first axis.

    Parameters
    ----------
    rotation : array, shape (..., 3, 3)
        Rotation matrices.

    Returns
    -------
    array, shape (..., 4)
        Unit quaternions (w, x, y, z). A sequence, shape (T, 4), has no change of sign from one
        sample to the next and starts with w >= 0; otherwise w >= 0.
    """
    from scipy.spatial.transform import Rotation

    matrices = np.asarray(rotation, dtype=np.float64)
    flat = Rotation.from_matrix(matrices.reshape(-1, 3, 3)).as_quat(
        canonical=True, scalar_first=True
    )
    if matrices.ndim == 3 and len(flat) > 1:
        turns = np.sign(np.einsum("ti,ti->t", flat[1:], flat[:-1]))
        flat[1:] *= np.cumprod(np.where(turns < 0, -1.0, 1.0))[:, np.newaxis]
    quaternions: FloatArray = flat.reshape(*matrices.shape[:-2], 4)
    return quaternions


def quaternion_to_rotation(quaternion: npt.ArrayLike) -> FloatArray:
    """Turn quaternions (w, x, y, z), shape (..., 4), into rotation matrices, shape (..., 3, 3).

    They need not have length one; of one without any length, or not seen, the matrix is NaN.
    """
    w, x, y, z = np.moveaxis(np.asarray(quaternion, dtype=np.float64), -1, 0)
    length = np.sqrt(x * x + y * y + z * z + w * w)
    length = np.where(length > 0.0, length, np.nan)
    w, x, y, z = w / length, x / length, y / length, z / length
    rows = [
        [x * x - y * y - z * z + w * w, 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
        [2.0 * (x * y + z * w), -x * x + y * y - z * z + w * w, 2.0 * (y * z - x * w)],
        [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), -x * x - y * y + z * z + w * w],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _markers(part: str, *markers: npt.ArrayLike) -> list[FloatArray]:
    """Bring three markers to one shape, as fresh arrays."""
    arrays = [np.asarray(marker, dtype=np.float64) for marker in markers]
    shapes = {array.shape for array in arrays}
    if len(shapes) > 1 or arrays[0].shape[-1:] != (3,):
        got = ", ".join(str(array.shape) for array in arrays)
        raise LabellingError(f"{part} frame: markers must have one shape (..., 3), got {got}")
    return arrays


def _unit(vectors: FloatArray, what: str, expected: str) -> FloatArray:
    """Normalise vectors; refuse those that carry no direction (too short or NaN)."""
    lengths = np.linalg.norm(vectors, axis=-1)
    usable = lengths > 0.0
    if "back" in what:
        usable = lengths >= _SMALLEST_BASE_M
    if not np.all(usable):
        first = np.unravel_index(np.argmin(usable), lengths.shape)
        place = f" at sample {first[0]}" if first else ""
        raise LabellingError(f"{what}{place}: expected {expected}, got {vectors[first].tolist()}")
    units: FloatArray = vectors / lengths[..., np.newaxis]
    return units

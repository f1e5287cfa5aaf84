"""Where the hinge of a lever is that a demonstration pulled."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.exceptions import RefinementError

FloatArray = npt.NDArray[np.float64]

# A chord that is steeper than this does not tell which way is ahead.
_LEAST_LEVEL_M = 0.02
# Nor is a level pull's arc ahead of it; it is above.
_LEAST_BULGE = 1e-3


@dataclass(frozen=True, eq=False)
class Hinge:
    """Where a lever is hinged.

    Attributes
    ----------
    centre : array, shape (3,)
        Where the hinge's axis meets the plane in which the handle's middle moves, metres.
    axes : array, shape (3, 3)
        Columns: to the handle before the pull, where it goes first, the axis of the hinge.
    """

    centre: FloatArray
    axes: FloatArray

    @property
    def key(self) -> tuple[float, ...]:
        """The same as plain numbers."""
        return tuple(np.concatenate([self.centre, self.axes.ravel()]).tolist())

    def handle(self, angle: float, length: float) -> FloatArray:
        """Return where the handle's middle is at an angle (rad) of a lever (m), shape (3,)."""
        turned = self.axes @ np.array([np.cos(angle), np.sin(angle), 0.0])
        return np.asarray(self.centre + length * turned)

    def angle(self, handle: FloatArray) -> float:
        """Return the angle (rad) at which the handle's middle is at a place (3,)."""
        x, y, _ = self.axes.T @ (handle - self.centre)
        return float(np.arctan2(y, x))


def find_hinge(
    start: FloatArray, end: FloatArray, length: float, offset: npt.ArrayLike, name: str = "lever"
) -> Hinge:
    """Find the hinge of a lever whose handle goes from one place to another.

    Of the two circles through both places in their vertical plane it is the one that bulges
    ahead, or up where the pull is level: a person pulls down and towards the body.

    Parameters
    ----------
    start, end : array, shape (7,)
        Poses of the tool in the robot's world; the handle is at their positions, metres.
    length : float
        Of the lever, metres.
    offset : array, shape (3,)
        Moves the whole lever, metres.
    name : str
        Of the motion, for the message.

    Raises
    ------
    RefinementError
        If the places are too close to each other, or too far apart for the lever.
    """
    way = end[:3] - start[:3]
    chord = float(np.linalg.norm(way))
    if not 0.01 <= chord <= 1.98 * length:
        raise RefinementError(
            f"{name}: task pull_lever: the demonstrated movement ends {100 * chord:.1f} cm from "
            f"its start; expected 1 cm to {198 * length:.1f} cm for lever.length_m {length:g}"
        )
    ahead = -way * [1.0, 1.0, 0.0]
    if np.linalg.norm(ahead) < _LEAST_LEVEL_M:
        w, x, y, z = start[3:]
        ahead = np.array([2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 0.0])
    if np.linalg.norm(ahead) < _LEAST_BULGE:
        ahead = np.array([1.0, 0.0, 0.0])
    along = way / chord
    ahead /= np.linalg.norm(ahead)
    bulge = ahead - (ahead @ along) * along
    if np.linalg.norm(bulge) < _LEAST_BULGE:
        bulge = np.array([0.0, 0.0, 1.0]) - along[2] * along
    bulge /= np.linalg.norm(bulge)
    centre = start[:3] + way / 2 - np.sqrt(length**2 - chord**2 / 4) * bulge
    first = (start[:3] - centre) / length
    axis = np.cross(first, end[:3] - centre)
    axis /= np.linalg.norm(axis)
    return Hinge(centre + np.asarray(offset), np.column_stack([first, np.cross(axis, first), axis]))

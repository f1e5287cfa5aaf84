"""Where to look from, so that all that matters is in the picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

_MARGIN = 1.12


@dataclass(frozen=True, eq=False)
class CameraView:
    """A camera as MuJoCo describes it.

    Attributes
    ----------
    centre : array, shape (3,)
        What it looks at, metres.
    distance : float
        Of the camera to it, metres.
    azimuth, elevation : float
        Direction of sight, degrees.
    """

    centre: FloatArray
    distance: float
    azimuth: float
    elevation: float


def frame_points(
    points: FloatArray, heading: float, aspect: float, fovy: float = 45.0, turn: float = 65.0
) -> CameraView:
    """Choose a view from the right of a heading, slightly from behind and above.

    Parameters
    ----------
    points : array, shape (N, 3)
        What must be in the picture, metres, z up.
    heading : float
        What is to point to the right in the picture: direction on the floor, rad.
    aspect : float
        Width over height of the picture.
    fovy : float
        Vertical field of view, degrees.
    turn : float
        Degrees from the heading to the direction of sight: 90 from the side, less from behind.

    Returns
    -------
    CameraView
    """
    azimuth, elevation = np.degrees(heading) + turn, -14.0
    a, e = np.radians(azimuth), np.radians(elevation)
    ahead = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([np.sin(a), -np.cos(a), 0.0])
    axes = np.stack([right, np.cross(right, ahead), ahead])
    seen = points @ axes.T
    slopes = np.tan(np.radians(fovy) / 2) * np.array([aspect, 1.0]) / _MARGIN
    centre = (seen.min(axis=0) + seen.max(axis=0)) / 2
    for _ in range(20):
        off = seen - centre
        distance = float((np.abs(off[:, :2]) / slopes - off[:, 2:]).max())
        # What is near looks larger, so the middle of the picture is not that of the points.
        shown = off[:, :2] / (distance + off[:, 2:])
        middle = (shown.min(axis=0) + shown.max(axis=0)) / 2
        centre[:2] += middle * distance
    return CameraView(axes.T @ centre, max(distance, 0.3), float(azimuth), elevation)

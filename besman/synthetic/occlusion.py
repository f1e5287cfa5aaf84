"""Which cameras see a marker past limbs and boxes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

FloatArray = npt.NDArray[np.float64]

_TINY = 1e-12


@njit(cache=True)
def count_views(
    points: FloatArray,
    cameras: FloatArray,
    starts: FloatArray,
    ends: FloatArray,
    radii: FloatArray,
    box_centres: FloatArray,
    box_axes: FloatArray,
    box_halves: FloatArray,
    exempt: npt.NDArray[np.bool_],
    blur_rad: float,
    ranges: FloatArray,
    enough: int,
) -> npt.NDArray[np.uint8]:  # pragma: no cover
    """Count the cameras with a free line of sight to each marker.

    Parameters
    ----------
    points : array, shape (T, M, 3)
        Markers, metres in the laboratory frame; one that is not there (NaN) is not seen.
    cameras : array, shape (C, 3)
        Positions, metres.
    starts, ends : array, shape (T, K, 3)
        Axes of the capsules, metres.
    radii : array, shape (K,)
        Metres.
    box_centres : array, shape (T, B, 3)
        Metres.
    box_axes : array, shape (T, B, 3, 3)
        box2lab: the columns are the axes of the box.
    box_halves : array, shape (B, 3)
        Half the edges, metres.
    exempt : bool array, shape (M, K)
        True where a capsule does not hide a marker: what is held is not hidden by the hand.
    blur_rad : float
        A camera does not tell markers apart that it sees closer to each other than this.
    ranges : array, shape (C,)
        A camera sees markers no farther away, metres.
    enough : int
        Counting stops at this number.

    Returns
    -------
    uint8 array, shape (T, M)
    """
    n_samples, n_points = points.shape[:2]
    views = np.zeros((n_samples, n_points), np.uint8)
    for t in range(n_samples):
        for m in range(n_points):
            if np.isnan(points[t, m, 0]):
                continue
            for c in range(len(cameras)):
                camera = cameras[c]
                away = 0.0
                for i in range(3):
                    away += (points[t, m, i] - camera[i]) ** 2
                if away > ranges[c] ** 2:
                    continue
                free = True
                for k in range(len(radii)):
                    if exempt[m, k]:
                        continue
                    gap = _squared_distance(camera, points[t, m], starts[t, k], ends[t, k])
                    if gap < radii[k] ** 2:
                        free = False
                        break
                if free:
                    for b in range(len(box_halves)):
                        if _crosses_box(
                            camera, points[t, m], box_centres[t, b], box_axes[t, b], box_halves[b]
                        ):
                            free = False
                            break
                if free and not _blurs(points[t], m, camera, blur_rad):
                    views[t, m] += 1
                    if views[t, m] >= enough:
                        break
    return views


@njit(cache=True)
def _squared_distance(
    a0: FloatArray, a1: FloatArray, b0: FloatArray, b1: FloatArray
) -> float:  # pragma: no cover
    """Squared distance of two segments (Ericson: Real-Time Collision Detection, 2005, 5.1.9)."""
    aa = ab = bb = ac = bc = 0.0
    for i in range(3):
        u, v, w = a1[i] - a0[i], b1[i] - b0[i], a0[i] - b0[i]
        aa += u * u
        ab += u * v
        bb += v * v
        ac += u * w
        bc += v * w
    slack = aa * bb - ab * ab
    s = min(max((ab * bc - ac * bb) / slack, 0.0), 1.0) if slack > _TINY else 0.0
    t = (ab * s + bc) / bb if bb > _TINY else 0.0
    if t < 0.0 or t > 1.0 or bb <= _TINY:
        t = min(max(t, 0.0), 1.0)
        s = min(max((ab * t - ac) / aa, 0.0), 1.0)
    total = 0.0
    for i in range(3):
        gap = a0[i] + s * (a1[i] - a0[i]) - b0[i] - t * (b1[i] - b0[i])
        total += gap * gap
    return total


@njit(cache=True)
def _crosses_box(
    start: FloatArray, end: FloatArray, centre: FloatArray, axes: FloatArray, half: FloatArray
) -> bool:  # pragma: no cover
    """Tell whether a segment passes through a box (slab by slab)."""
    enter, leave = 0.0, 1.0
    for j in range(3):
        at = step = 0.0
        for i in range(3):
            at += (start[i] - centre[i]) * axes[i, j]
            step += (end[i] - start[i]) * axes[i, j]
        if abs(step) < _TINY:
            if abs(at) > half[j]:
                return False
            continue
        first, second = (-half[j] - at) / step, (half[j] - at) / step
        enter = max(enter, min(first, second))
        leave = min(leave, max(first, second))
    return enter <= leave


@njit(cache=True)
def _blurs(
    points: FloatArray, m: int, camera: FloatArray, blur_rad: float
) -> bool:  # pragma: no cover
    """Tell whether a camera sees another marker right beside this one."""
    for other in range(len(points)):
        if other == m or np.isnan(points[other, 0]):
            continue
        aa = ab = bb = 0.0
        for i in range(3):
            u, v = points[m, i] - camera[i], points[other, i] - camera[i]
            aa += u * u
            ab += u * v
            bb += v * v
        # Small angles: the sine of the angle between the lines of sight.
        if ab > 0.0 and aa * bb - ab * ab < blur_rad**2 * aa * bb:
            return True
    return False

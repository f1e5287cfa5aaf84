"""Borders at local minima of the speed.

References
----------
L. Senger, M. Schröer, J. H. Metzen, E. A. Kirchner: Velocity-based multiple change-point inference
for unsupervised segmentation of human movement behavior. ICPR 2014 (the simple rival there;
thesis 4.4.2).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.exceptions import SegmentationError


def find_speed_minima(speed: npt.ArrayLike, half_window: int) -> npt.NDArray[np.int64]:
    """Find the samples at which the speed is the lowest of a window around them.

    Parameters
    ----------
    speed : array, shape (T,)
        Absolute speed, any unit.
    half_window : int
        Samples of the window on each side, at least 1.

    Returns
    -------
    int array, shape (S + 1,)
        Borders: 0, the minima, T. A stretch of equal speed has its minimum in its middle; a
        window that reaches beyond the data has none, and neither has speed that never changes.

    Raises
    ------
    SegmentationError
        If the window is too short, or values are not finite.
    """
    from scipy.ndimage import minimum_filter1d

    v = np.asarray(speed, dtype=np.float64)
    if half_window < 1:
        raise SegmentationError(f"locmin: half a window has {half_window} samples; at least 1")
    if v.ndim != 1 or len(v) < 2:
        raise SegmentationError(f"locmin: speed must have shape (T,), T >= 2, got {v.shape}")
    if not np.isfinite(v).all():
        raise SegmentationError(f"locmin: speed must be finite; sample {np.argmin(np.isfinite(v))}")
    width = 2 * half_window + 1
    edges = np.diff((v == minimum_filter1d(v, width)).astype(np.int8), prepend=0, append=0)
    first, behind = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    middle = (first + behind - 1) // 2
    inside = (middle >= half_window) & (middle < len(v) - half_window)
    minima = middle[inside & (behind - first < len(v))]
    return np.concatenate([[0], minima, [len(v)]]).astype(np.int64)

"""Multiple change-point inference on positions alone (MCI): vMCI without its bells.

References
----------
P. Fearnhead, Z. Liu: On-line inference for multiple changepoint problems. Journal of the Royal
Statistical Society B 69(4), 2007, doi:10.1111/j.1467-9868.2007.00601.x; thesis 4.3.1.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.stages.segment.vmci import ChangePoints, VmciModel, find_change_points


def find_position_changes(
    positions: npt.ArrayLike,
    border_probability: float,
    weight_variance: float = 100.0,
    longest: int | None = None,
) -> ChangePoints:
    """Find the most probable segmentation of positions under autoregressions of order 1.

    Parameters
    ----------
    positions : array, shape (T, d)
        Zero mean, first differences of unit size.
    border_probability : float
        Probability of a border at a sample.
    weight_variance : float
        Prior variance D of the autoregression, in units of the noise.
    longest : int, optional
        Greatest length of a segment, samples.

    Returns
    -------
    ChangePoints

    Raises
    ------
    SegmentationError
        As `besman.stages.segment.vmci.find_change_points`.
    """
    y = np.asarray(positions, dtype=np.float64)
    model = VmciModel(n_centres=1, weight_variance=weight_variance)
    return find_change_points(y, np.empty((len(y), 0)), border_probability, longest, model)

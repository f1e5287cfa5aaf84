"""The evidence of chosen segments; see `besman.stages.segment.valley_vmci`."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.stages.segment.vmci import VmciModel

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


def evaluate_spans(
    speeds: FloatArray,
    starts: IntArray,
    ends: IntArray,
    farthest: IntArray,
    factor: FloatArray,
    model: VmciModel,
) -> FloatArray:
    """Evaluate the log-evidence of the speed between chosen samples, eq. (A.17).

    Parameters
    ----------
    speeds : array, shape (T, s)
        Scaled.
    starts, ends : int array, shape (V,)
        Segment (i, j) holds the samples starts[i] to ends[j] - 1. Both rise.
    farthest : int array, shape (V,)
        Greatest j that is asked for with each i.
    factor : array, shape (L + 1,)
        See `besman.stages.segment.vmci.tabulate_lengths`.
    model : VmciModel
        Prior and shape of the bells.

    Returns
    -------
    array, shape (V, V)
        -inf where j <= i or j > farthest[i], or the segment is shorter than two samples or too
        long.
    """
    longest = len(factor) - 1
    evidence = np.full((len(starts), len(starts)), -np.inf)
    for i, start in enumerate(starts):
        lengths = ends[i + 1 : farthest[i] + 1] - start
        (asked,) = np.nonzero((lengths >= 2) & (lengths <= longest))
        if asked.size:
            n = lengths[asked]
            bells = [_evaluate_bells(speeds[start : start + length], model) for length in n]
            evidence[i, i + 1 + asked] = factor[n] + bells
    return evidence


def _evaluate_bells(speeds: FloatArray, model: VmciModel) -> float:
    """Evaluate the best bell of one segment, speeds (n, s); a bell may not hang down."""
    n, n_sensors = speeds.shape
    bells = _shape_bells(n, model)
    products, sums = bells @ speeds, speeds.sum(axis=0)
    total = bells.sum(axis=1)[:, np.newaxis]
    # The weights of bell and constant: 2 x 2 for each bell, (C, 1); height and level (C, s).
    a = np.sum(bells**2, axis=1)[:, np.newaxis] + 1.0 / model.speed_weight_variance
    e = n + 1.0 / model.speed_weight_variance
    determinant = a * e - total**2
    height = e * products - total * sums
    level = a * sums - total * products
    explained = height[:, :, np.newaxis] * products[:, np.newaxis]
    explained += level[:, :, np.newaxis] * sums
    noise = speeds.T @ speeds - explained / determinant[:, np.newaxis]
    noise += model.noise_scale * np.eye(n_sensors)
    values = -0.5 * n_sensors * np.log(determinant[:, 0])
    values -= 0.5 * (n + model.nu(n_sensors)) * np.linalg.slogdet(noise)[1]
    return float(np.max(values[(height >= 0.0).all(axis=1)], initial=-np.inf))


def _shape_bells(n: int, model: VmciModel) -> FloatArray:
    """Return the bells of eq. (4.2) over n samples, at least two, shape (C, n)."""
    centres = np.arange(1, model.n_centres + 1) / (model.n_centres + 1)
    at = np.arange(n) / (n - 1)
    return np.exp(-(((at - centres[:, np.newaxis]) / model.bell_width) ** 2))

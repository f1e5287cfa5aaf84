"""The recursion of `besman.stages.segment.vmci` in plain NumPy: the oracle of the compiled one.

It follows the equations as they are written, for all ends at once, one length after the other.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.stages.segment.vmci import (
    ChangePoints,
    VmciModel,
    check_data,
    tabulate_lengths,
    trace_back,
)

FloatArray = npt.NDArray[np.float64]


def find_change_points_plainly(
    positions: npt.ArrayLike,
    speeds: npt.ArrayLike,
    border_probability: float,
    longest: int | None = None,
    model: VmciModel | None = None,
) -> ChangePoints:
    """Do what `besman.stages.segment.vmci.find_change_points` does; same arguments and result."""
    model = model or VmciModel()
    y, v = check_data(positions, speeds)
    factor = tabulate_lengths(len(y), y.shape[1], v.shape[1], border_probability, longest, model)
    evidence = factor + evaluate_segments(y, v, factor.size - 1, model)
    best = np.full(len(y) + 1, -np.inf)
    best[0] = -np.log(model.n_centres)
    previous = np.zeros(len(y) + 1, dtype=np.int64)
    for end in range(1, len(y) + 1):
        lengths = np.arange(1, min(end, factor.size - 1) + 1)
        values = best[end - lengths] + evidence[end, lengths]
        previous[end] = end - lengths[np.argmax(values)]
        best[end] = values.max()
    return ChangePoints(trace_back(previous), float(best[-1]))


def evaluate_segments(y: FloatArray, v: FloatArray, longest: int, model: VmciModel) -> FloatArray:
    """Evaluate the part of the log-evidence that depends on the data.

    Parameters
    ----------
    y : array, shape (T, d)
        Scaled positions.
    v : array, shape (T, s)
        Scaled speeds.
    longest : int
        Longest segment L, samples.
    model : VmciModel
        Prior and shape of the models.

    Returns
    -------
    array, shape (T + 1, L + 1)
        Entry (t, n) belongs to the samples t - n to t - 1; -inf where there is no such segment.

    Notes
    -----
    With E = Y - H and C = H'E, Y'PY = E'E - C'MC + (MC + C'M) / D + (I - M / D) / D, which does not
    subtract large numbers as Y'Y - Y'H M H'Y does.
    """
    n_samples, d = y.shape
    h = np.concatenate([y[:1], y[:-1]])
    e = y - h
    evidence = np.full((n_samples + 1, longest + 1), -np.inf)
    hh, he, ee = (np.zeros((n_samples + 1, d, d)) for _ in range(3))
    outer = [np.einsum("ti,tj->tij", a, b) for a, b in ((h, h), (h, e), (e, e))]
    precision = np.eye(d) / model.weight_variance
    scale, nu = model.noise_scale, model.nu(d)
    for n in range(1, longest + 1):
        for sums, products in zip((hh, he, ee), outer, strict=True):
            sums[n:] += products[: n_samples + 1 - n]
        m = np.linalg.inv(hh[n:] + precision)
        mc = m @ he[n:]
        noise = ee[n:] - np.swapaxes(he[n:], 1, 2) @ mc
        noise += precision @ (mc + np.swapaxes(mc, 1, 2) + np.eye(d) - m @ precision)
        evidence[n:, n] = 0.5 * d * np.linalg.slogdet(m)[1]
        evidence[n:, n] -= 0.5 * (n + nu) * np.linalg.slogdet(noise + scale * np.eye(d))[1]
        if v.shape[1]:
            evidence[n:, n] += _evaluate_speeds(v, n, model)
    return evidence


def _evaluate_speeds(v: FloatArray, n: int, model: VmciModel) -> FloatArray:
    """Evaluate the best bell for every window of n samples, eq. (A.17), shape (T - n + 1,)."""
    windows = np.lib.stride_tricks.sliding_window_view(v, n, axis=0)
    s = v.shape[1]
    squares = np.einsum("wsn,wrn->wsr", windows, windows)
    best = np.full(len(windows), -np.inf)
    x = np.arange(n)
    radius = model.bell_width * (n - 1) if n > 1 else 1.0
    for c in range(1, model.n_centres + 1):
        centre = c * (n - 1) / (model.n_centres + 1)
        basis = np.stack([np.exp(-(((x - centre) / radius) ** 2)), np.ones(n)], axis=1)
        m = np.linalg.inv(basis.T @ basis + np.eye(2) / model.speed_weight_variance)
        b = np.swapaxes(windows @ basis, 1, 2)
        noise = squares - np.swapaxes(b, 1, 2) @ m @ b + model.noise_scale * np.eye(s)
        value = 0.5 * s * np.linalg.slogdet(m)[1]
        value -= 0.5 * (n + model.nu(s)) * np.linalg.slogdet(noise)[1]
        hangs = ((m @ b)[:, 0] < 0).any(axis=1)
        best = np.maximum(best, np.where(hangs, -np.inf, value))
    return best

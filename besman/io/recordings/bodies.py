"""Orientations of bodies among markers, which have none, and over gaps."""

from __future__ import annotations

import numpy as np

from besman.records import FloatArray


def hold_orientations(orientations: FloatArray) -> FloatArray:
    """Return orientations (T, M, 4) with those of gaps as they were last before, or first after.

    What has none at all stays NaN.
    """
    held = np.array(orientations)
    rows = np.arange(len(held))
    seen = np.asarray(np.isfinite(held).all(axis=2))
    for column in range(held.shape[1]):
        kept = rows[seen[:, column]]
        if kept.size and kept.size < len(rows):
            before = np.searchsorted(kept, rows, side="right") - 1
            held[:, column] = held[kept[np.maximum(before, 0)], column]
    return held


def from_matrices(matrices: FloatArray) -> FloatArray:
    """Return unit quaternions (..., 4), w first, of rotation matrices (..., 3, 3); NaN of NaN."""
    from scipy.spatial.transform import Rotation

    flat = matrices.reshape(-1, 3, 3)
    found = np.full((len(flat), 4), np.nan)
    known = np.isfinite(flat).all(axis=(1, 2))
    if known.any():
        found[known] = Rotation.from_matrix(flat[known]).as_quat(canonical=True, scalar_first=True)
    return found.reshape(*matrices.shape[:-2], 4)

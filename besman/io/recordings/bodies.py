"""Orientations of bodies among markers, which have none, and over gaps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from besman.io.warning import warn_of_file
from besman.records import FloatArray

# Entries of a matrix times its transpose may differ so much from those of a rotation.
_NO_ROTATION = 0.05


def to_unit(quaternions: FloatArray) -> FloatArray:
    """Return unit quaternions (T, 4); NaN of what is half or twice as long, and of NaN."""
    # The squares of what is much larger overflow.
    bounded = np.where(np.abs(quaternions) < 2.0, quaternions, np.nan)
    lengths = np.linalg.norm(bounded, axis=1, keepdims=True)
    is_turn = (lengths > 0.5) & (lengths < 2.0)
    return np.where(is_turn, bounded, np.nan) / np.where(is_turn, lengths, 1.0)


def warn_of_no_turns(written: FloatArray, turns: FloatArray, body: str, source: str) -> None:
    """Say how many orientations of a body are none, though something stands there.

    Parameters
    ----------
    written : array, shape (T, N)
        What stands in the file; NaN or all zero where the body was not seen.
    turns : array, shape (T, 4)
        What was read of it.
    body, source : str
        Names of the body and of the file.
    """
    odd = np.isfinite(written).all(axis=1) & written.any(axis=1) & np.isnan(turns).any(axis=1)
    if odd.any():
        warn_of_file(
            f"{source}: {int(odd.sum())} orientations of {body!r:.60} are no rotations and were "
            f"left out, first in row {int(np.argmax(odd)) + 1}"
        )


def gather_turns(turns: Sequence[int | None], n_before: int) -> tuple[list[int], list[int | None]]:
    """Return the columns of all quaternions, and where each begins when these are all that is kept.

    Parameters
    ----------
    turns : sequence of int or None
        Where the four numbers of each body begin; None of what has none.
    n_before : int
        Columns that are kept before them.
    """
    columns: list[int] = []
    kept: list[int | None] = []
    for turn in turns:
        kept.append(None if turn is None else n_before + len(columns))
        columns += [] if turn is None else range(turn, turn + 4)
    return columns, kept


def read_orientations(
    values: FloatArray, columns: Sequence[int | None], names: Sequence[str], source: str
) -> FloatArray | None:
    """Return the quaternions of a table, w first.

    Parameters
    ----------
    values : array, shape (T, N)
        The table.
    columns : sequence of int or None, length M
        Where the four numbers of each body begin, w last; None of what has none.
    names : sequence of str, length M
    source : str
        Name of the file, for warnings.

    Returns
    -------
    array, shape (T, M, 4), or None
        NaN of what has none; None if nothing has one.
    """
    if all(column is None for column in columns):
        return None
    found = np.full((len(values), len(columns), 4), np.nan)
    for index, (column, name) in enumerate(zip(columns, names, strict=True)):
        if column is not None:
            quaternions = values[:, [column + k for k in (3, 0, 1, 2)]]
            found[:, index] = to_unit(quaternions)
            warn_of_no_turns(quaternions, found[:, index], name, source)
    return found


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
    """Return unit quaternions (..., 4), w first, of rotations (..., 3, 3); NaN of what is none."""
    from scipy.spatial.transform import Rotation

    flat = matrices.reshape(-1, 3, 3)
    found = np.full((len(flat), 4), np.nan)
    # No entry of a rotation is larger than one; the products of what is much larger overflow.
    bounded = np.where(np.abs(flat) < 2.0, flat, np.nan)
    off = np.abs(bounded @ bounded.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    known = off < _NO_ROTATION
    known[known] = np.linalg.det(flat[known]) > 0.0
    if known.any():
        found[known] = Rotation.from_matrix(flat[known]).as_quat(canonical=True, scalar_first=True)
    return found.reshape(*matrices.shape[:-2], 4)

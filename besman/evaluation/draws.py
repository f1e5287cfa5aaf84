"""Random divisions of a set of labelled segments into what is learnt from and what is tested."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.evaluation.recognition_data import LabelledSet

IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Draw:
    """One division of a set: rows to learn from, rows to test with."""

    learn: IntArray
    test: IntArray


def draw_balanced(labels: npt.NDArray[np.str_], n: int, seed: int) -> Draw:
    """Draw as many examples of each class; a class with no more than that is left out."""
    rng = np.random.default_rng(seed)
    learn: list[int] = []
    kept: list[int] = []
    for name in np.unique(labels):
        rows = rng.permutation(np.flatnonzero(labels == name))
        if len(rows) > n:
            learn += rows[:n].tolist()
            kept += rows[n:].tolist()
    return Draw(np.sort(learn).astype(np.int64), np.sort(kept).astype(np.int64))


def draw_subjects(one: LabelledSet, n: int, left_out: str, seed: int) -> Draw:
    """Draw examples of each class and each subject but one, who is tested."""
    rng = np.random.default_rng(seed)
    learn: list[int] = []
    for subject in np.unique(one.subjects):
        for name in np.unique(one.labels):
            own = np.flatnonzero((one.subjects == subject) & (one.labels == name))
            chosen = rng.permutation(own)[:n]
            if subject != left_out:
                learn += chosen.tolist()
    test = np.flatnonzero(
        (one.subjects == left_out) & np.isin(one.labels, np.unique(one.labels[learn]))
    )
    return Draw(np.sort(learn).astype(np.int64), test)

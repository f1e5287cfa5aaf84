"""The compiled steps of `besman.stages.segment.vmci_online`."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


@njit(cache=True, nogil=True)
def choose_start(
    best: FloatArray,
    previous: IntArray,
    behind: IntArray,
    end: int,
    row: FloatArray,
    lead: float,
    patience: int,
) -> None:  # pragma: no cover
    """Write the most probable start of a segment that ends before sample `end`, eq. (4.8).

    A start that has been far behind the best one for a while is given up.

    Parameters
    ----------
    best, previous : array, shape (C,)
        As in `besman.stages.segment.vmci_kernel.run_viterbi`; entry `end` is written.
    end : int
        Index into both.
    behind : int array, shape (C,)
        For how many ends each start has been far behind; updated.
    row : array, shape (L + 1,)
        Log-evidence of the n samples before `end`.
    lead : float
        Nats that are far.
    patience : int
        Samples that are a while.
    """
    best[end] = -np.inf
    previous[end] = max(end - 1, 0)
    for n in range(1, min(row.shape[0] - 1, end) + 1):
        value = best[end - n] + row[n]
        if value > best[end]:
            best[end] = value
            previous[end] = end - n
    behind[end] = 0
    for n in range(1, min(row.shape[0] - 1, end) + 1):
        start = end - n
        if best[start] + row[n] >= best[end] - lead:
            behind[start] = 0
        else:
            behind[start] += 1
            if behind[start] >= patience:
                best[start] = -np.inf


@njit(cache=True, nogil=True)
def find_agreed(
    best: FloatArray, previous: IntArray, low: int, now: int, longest: int
) -> tuple[int, int]:  # pragma: no cover
    """Find the last border that all segmentations share which may still win.

    They all have a border within the last `longest` samples, at which their next segment starts,
    and from there follow the best starts back.

    Parameters
    ----------
    best, previous : array, shape (C,)
        Up to entry `now`.
    low : int
        A border that all of them share.
    now : int
        Samples seen.
    longest : int
        Longest segment, samples.

    Returns
    -------
    agreed : int
        The last border shared.
    next_one : int
        The earliest border that may follow it.
    """
    marked = np.zeros(now + 1 - low, dtype=np.bool_)
    n_marked = 0
    for node in range(max(low, now + 1 - longest), now + 1):
        if best[node] > -np.inf:
            marked[node - low] = True
            n_marked += 1
    child = np.full(now + 1 - low, now + 1)
    node = now
    while n_marked > 1:
        while not marked[node - low]:
            node -= 1
        start = previous[node]
        marked[node - low] = False
        child[start - low] = node
        if marked[start - low]:
            n_marked -= 1
        else:
            marked[start - low] = True
    while node > low and not marked[node - low]:
        node -= 1
    return node, child[node - low]

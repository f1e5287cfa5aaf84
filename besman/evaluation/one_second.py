"""Experiment: what one second of a recording teaches of the rest, and how honest confidence is."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from besman.stages.label.fragments import split_fragments
from besman.stages.label.learning import learn_marker_model
from besman.stages.label.naming import label_fragments
from besman.stages.label.scores import GHOST

FloatArray = npt.NDArray[np.float64]

CONFIDENCE_BINS = (0.5, 0.8, 0.95, 0.99, 1.0)
"""Edges of the bins; the first holds what is less sure as well."""


def name_by_one_second(
    positions: FloatArray,
    rate_hz: float,
    markers: tuple[str, ...],
    bodies: tuple[tuple[str, ...], ...] | None = None,
    n_stretches: int = 8,
) -> dict[str, Any]:
    """Learn from one second, name the rest, for several seconds spread over a recording.

    Parameters
    ----------
    positions : array, shape (T, M, 3)
        Named markers, metres; NaN where not seen.
    rate_hz : float
        Frames per second.
    markers : tuple of str, length M
    bodies : tuple of tuple of str, optional
        As of `learn_marker_model`.
    n_stretches : int
        How many seconds teach, one after the other.

    Returns
    -------
    dict
        right_share and wrong_share of the marker samples seen; ``bins``: for each bin of
        confidence its ``from`` and ``to``, its ``share`` of the samples and the ``right_share`` of
        the best names in it. Where the best explanation is no marker, no name is in a bin.
    """
    width = round(rate_hz)
    starts = np.linspace(0, len(positions) - 2 * width, n_stretches).astype(int)
    edges = np.array(CONFIDENCE_BINS)
    samples, right = np.zeros(len(edges) - 1), np.zeros(len(edges) - 1)
    seen = named_right = named_wrong = 0
    for start in starts.tolist():
        taught = slice(start, start + width)
        model = learn_marker_model(positions[taught], rate_hz, markers, bodies=bodies)
        fragments = split_fragments(np.delete(positions, taught, axis=0), rate_hz)
        found = label_fragments(fragments, model)
        n, truth = fragments.n_samples, fragments.column
        seen += int(n.sum())
        named_right += int(n[found.labels == truth].sum())
        named_wrong += int(n[(found.labels != truth) & (found.labels != GHOST)].sum())
        bin_of = np.searchsorted(edges[1:-1], found.confidence, side="right")
        n = np.where(found.best == GHOST, 0, n)
        samples += np.bincount(bin_of, n, len(right))
        right += np.bincount(bin_of, n * (found.best == truth), len(right))
    return {
        "n_stretches": n_stretches,
        "right_share": named_right / seen,
        "wrong_share": named_wrong / seen,
        "bins": [
            {
                "from": float(edges[k]) if k else 0.0,
                "to": float(edges[k + 1]),
                "share": float(samples[k] / seen),
                "right_share": float(right[k] / samples[k]) if samples[k] else None,
            }
            for k in range(len(right))
        ],
    }

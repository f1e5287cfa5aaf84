"""Examples drawn by lot from labelled segments."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.exceptions import RecognitionError, nearest
from besman.records import LabelledRecording


class Candidate(NamedTuple):
    """A labelled segment.

    Attributes
    ----------
    recording : LabelledRecording
    bounds : pair of int
        Half-open rows.
    label : str
    """

    recording: LabelledRecording
    bounds: tuple[int, int]
    label: str


def draw_examples(
    labels: Sequence[str],
    examples_per_class: int,
    seed: int,
    classes: Sequence[str] | None = None,
) -> npt.NDArray[np.int64]:
    """Draw training examples of each class; of a class with fewer, all.

    Parameters
    ----------
    labels : sequence of str
        Class of each candidate.
    examples_per_class : int
        Examples to draw of each class.
    seed : int
        Seed of the draw.
    classes : sequence of str, optional
        Classes to learn; all that occur if not given.

    Returns
    -------
    int array
        Indices of the examples drawn, rising.

    Raises
    ------
    RecognitionError
        If there are no candidates, or none of a class that is to be learnt.
    """
    found = sorted(set(labels))
    if not found:
        raise RecognitionError(
            "no labelled segments to learn from; expected manual segments, of building blocks in "
            "the layer of the arm that is looked at (right_hand, left_hand) or in none"
        )
    for name in classes or ():
        if name not in found:
            raise RecognitionError(
                f"class {name!r} has no labelled examples; {nearest(name, found)}"
            )
    rng = np.random.default_rng(seed)
    chosen: list[int] = []
    # One draw for every class that occurs, so that leaving a class out does not change the others.
    for name in found:
        candidates = np.flatnonzero(np.array(labels) == name)
        drawn = rng.permutation(candidates)[:examples_per_class]
        if classes is None or name in classes:
            chosen.extend(drawn.tolist())
    return np.array(sorted(chosen), dtype=np.int64)

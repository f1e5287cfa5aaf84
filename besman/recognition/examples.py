"""Examples to learn from, out of manual segments."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.bodies import find_body
from besman.exceptions import RecognitionError, nearest
from besman.manual_segments import IDLE, Side, building_blocks, complete_truth
from besman.records import LabelledRecording, LabelledSegments


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


def find_candidates(
    recordings: Sequence[LabelledRecording],
    truth: Sequence[LabelledSegments],
    idle_s: float,
    idle_speed_m_s: float,
    side: Side = "right",
) -> list[Candidate]:
    """Gather what can be learnt from: manual segments, and rests between them.

    Parameters
    ----------
    recordings : sequence of LabelledRecording
    truth : sequence of LabelledSegments
        Manual segments of some of the recordings, matched by source.
    idle_s : float
        Stretches without a label longer than this, seconds, are ``idle`` ...
    idle_speed_m_s : float
        ... unless a hand moves faster than this, metres per second: then they are movements that
        could not be assigned to a class, and are left out (thesis 5.3.1).
    side : "right" or "left"
        Arm whose building blocks are taken, where there are layers of both.

    Returns
    -------
    list of Candidate

    Raises
    ------
    RecognitionError
        If manual segments have no recording.
    """
    by_source = {recording.source: recording for recording in recordings}
    candidates = []
    for manual in truth:
        if manual.source not in by_source:
            raise RecognitionError(
                f"manual segments of {manual.source!r} have no recording; "
                f"{nearest(manual.source, by_source)}"
            )
        recording = by_source[manual.source]
        blocks = building_blocks(manual, side)
        if blocks is None:
            continue
        whole = complete_truth(blocks, len(recording.time), idle_s)
        labelled = {tuple(rows) for rows in blocks.bounds.tolist()}
        for (start, end), label in zip(whole.bounds.tolist(), whole.labels, strict=True):
            derived = label == IDLE and (start, end) not in labelled
            if not derived or _fastest_hand(recording, start, end) <= idle_speed_m_s:
                candidates.append(Candidate(recording, (start, end), label))
    return candidates


def _fastest_hand(recording: LabelledRecording, start: int, end: int) -> float:
    """Return the greatest speed of a hand in a segment, metres per second."""
    # Over a tenth of a second, so that noise of the cameras is no movement.
    lag = min(max(1, round(0.1 * recording.rate_hz)), end - start - 1)
    time = recording.time[start:end]
    fastest = 0.0
    for arm in find_body(recording.markers, recording.source).arms:
        path = recording.marker(arm.hand)[start:end]
        ways = np.linalg.norm(path[lag:] - path[:-lag], axis=1)
        fastest = max(fastest, float(np.max(ways / (time[lag:] - time[:-lag]))))
    return fastest


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

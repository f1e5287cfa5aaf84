"""Examples to learn from, out of manual segments."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from besman.classifiers.draw_examples import Candidate
from besman.exceptions import RecognitionError, nearest
from besman.person.body import find_body
from besman.records import LabelledRecording, LabelledSegments
from besman.records.layers import IDLE, Side, building_blocks, complete_truth


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

"""Where an action may begin or end: borders of blocks, and where a hand is slow."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from besman.exceptions import RecognitionError
from besman.records import LabelledRecording
from besman.stages.compose.actions import gather_paths

FloatArray = npt.NDArray[np.float64]
Rows = npt.NDArray[np.int64]

# Speed of a hand is looked at with this smoothing (standard deviation); movements of people are
# several times longer.
SMOOTH_S = 0.06
# A hand rests below this share of its own brisk speed (90th percentile), if for long enough.
REST_SHARE = 0.05
REST_S = 0.2
_BRISK = 90.0
# Borders by bell-shaped models lie this far from where the hand is slow.
SNAP_S = 0.25


def merge_borders(per_arm: Sequence[npt.ArrayLike]) -> Rows:
    """Take the borders of every arm's blocks as borders of both (thesis 6.3.2).

    Parameters
    ----------
    per_arm : sequence of int array
        Rows of borders of each arm, e.g. half-open bounds of its blocks, shape (S, 2).

    Returns
    -------
    int array
        Rising; of borders with less than two samples between them one stays.

    Raises
    ------
    RecognitionError
        If there is no block.
    """
    rows = np.unique(np.concatenate([np.asarray(one, dtype=np.int64).ravel() for one in per_arm]))
    if len(rows) < 2:
        raise RecognitionError("compose: got no blocks; expected at least 1")
    kept = [int(rows[0])]
    for row in rows[1:-1]:
        if row - kept[-1] >= 2 and rows[-1] - row >= 2:
            kept.append(int(row))
    return np.array([*kept, rows[-1]], dtype=np.int64)


def hand_speed(recording: LabelledRecording, hand: str) -> FloatArray:
    """Return the smoothed speed of a hand, shape (T,), metres per second.

    Raises
    ------
    RecognitionError
        If the marker is missing or has a gap.
    """
    from scipy.ndimage import gaussian_filter1d

    path = gather_paths(recording, (hand,))[:, 0]
    gone = np.isnan(path).any(axis=1)
    if gone.any():
        raise RecognitionError(
            f"{recording.source}: marker {hand!r} was not seen in frame "
            f"{recording.first_frame + int(gone.argmax())}; expected no gaps"
        )
    if len(path) < 2:
        return np.zeros(len(path))
    smooth = gaussian_filter1d(path, SMOOTH_S * recording.rate_hz, axis=0, mode="nearest")
    speed: FloatArray = np.linalg.norm(np.gradient(smooth, recording.time, axis=0), axis=1)
    return speed


def measure_brisk(recordings: Sequence[LabelledRecording], hand: str) -> float:
    """Return the brisk speed of a hand: the 90th percentile over recordings, metres per second.

    Raises
    ------
    RecognitionError
        If the marker is missing or has a gap.
    """
    speeds = np.concatenate([hand_speed(recording, hand) for recording in recordings])
    return float(np.percentile(speeds, _BRISK))


def find_slow_rows(recording: LabelledRecording, hand: str, brisk_m_s: float | None = None) -> Rows:
    """Find where a hand is slow: the ends of its rests, and local minima of its speed elsewhere.

    Enumeration of all groupings forbids more borders than needed; where the best grouping is
    found in polynomial time they cost little, and a border that the segmentation missed is no
    longer lost to the actions.

    Parameters
    ----------
    recording : LabelledRecording
    hand : str
        Its marker, seen throughout.
    brisk_m_s : float, optional
        Brisk speed of the hand, see `measure_brisk`; that of the recording if not given.

    Returns
    -------
    int array
        Rising rows.

    Raises
    ------
    RecognitionError
        If the marker is missing or has a gap.
    """
    speed = hand_speed(recording, hand)
    if len(speed) < 3:
        return np.empty(0, dtype=np.int64)
    brisk = np.percentile(speed, _BRISK) if brisk_m_s is None else brisk_m_s
    slow = speed < REST_SHARE * brisk
    rests = np.flatnonzero(np.diff(slow.astype(int), prepend=0, append=0)).reshape(-1, 2)
    rests = rests[np.diff(rests, axis=1)[:, 0] >= REST_S * recording.rate_hz]
    lowest = np.flatnonzero((speed[1:-1] < speed[:-2]) & (speed[1:-1] <= speed[2:])) + 1
    resting = np.zeros(len(speed), dtype=bool)
    for start, end in rests:
        resting[start:end] = True
    ends = rests[(rests > 1) & (rests < len(speed) - 1)]
    return np.unique(np.concatenate([ends, lowest[~resting[lowest]]])).astype(np.int64)


def candidate_borders(
    recording: LabelledRecording, blocks: Sequence[npt.ArrayLike], hands: Sequence[str]
) -> Rows:
    """Return where actions may begin or end.

    Parameters
    ----------
    recording : LabelledRecording
    blocks : sequence of int array, shape (S, 2)
        Half-open rows of the blocks of each arm.
    hands : sequence of str
        Markers of hands. Where one is slow there is a border too, and borders of blocks within
        0.25 s of such a place give way to it. None: borders of blocks only, as in the thesis.

    Returns
    -------
    int array
        Rising rows, from the begin of the first block to the end of the last.

    Raises
    ------
    RecognitionError
        If there is no block, or a hand was not seen.
    """
    borders = merge_borders(blocks)
    if not hands:
        return borders
    slow = np.unique(np.concatenate([find_slow_rows(recording, hand) for hand in hands]))
    slow = slow[(slow > borders[0]) & (slow < borders[-1])]
    kept = give_way(borders[1:-1], slow, recording.rate_hz)
    return merge_borders([borders[[0, -1]], kept, slow])


def give_way(borders: Rows, slow: Rows, rate_hz: float) -> Rows:
    """Return the borders of blocks that are not within 0.25 s of where a hand is slow."""
    if len(slow) == 0:
        return borders
    apart = np.abs(borders[:, np.newaxis] - slow).min(axis=1)
    kept: Rows = borders[apart > SNAP_S * rate_hz]
    return kept

"""Demonstrations with two layers of truth: building blocks of each arm, and actions."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.exceptions import RecognitionError
from besman.records import LabelledRecording, LabelledSegments, Recording
from besman.records.layers import IDLE, complete_truth

_HANDS = ("hand_top", "wrist")
_JOINTS = ("elbow", "shoulder")


@dataclass(frozen=True, eq=False)
class Demonstration:
    """One example of an experiment.

    Attributes
    ----------
    recording : LabelledRecording
        What was recorded, from its first action to its last.
    blocks : dict of LabelledSegments
        True building blocks of each arm; stretches without a label are ``idle``.
    actions : LabelledSegments
        True actions, completed in the same way.
    """

    recording: LabelledRecording
    blocks: dict[str, LabelledSegments]
    actions: LabelledSegments


def arm_markers(markers: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Find the markers of each arm: hand or wrist, elbow, shoulder.

    Parameters
    ----------
    markers : sequence of str
        ``hand_top`` for a single arm, ``right_hand_top`` and ``left_hand_top`` for two; an
        exoskeleton has wrists.

    Returns
    -------
    dict
        By arm, the hand's marker first.

    Raises
    ------
    RecognitionError
        If no arm is complete.
    """
    found = {}
    for arm, prefix in (("right", ""), ("right", "right_"), ("left", "left_")):
        for hand in _HANDS:
            names = tuple(f"{prefix}{name}" for name in (hand, *_JOINTS))
            if set(names) <= set(markers):
                found[arm] = names
    if not found:
        raise RecognitionError(
            f"no arm is complete: got markers {', '.join(markers)}; expected hand_top or wrist, "
            "elbow and shoulder, with right_ or left_ in front for two arms"
        )
    return found


def name_markers(recording: Recording) -> LabelledRecording:
    """Take the names in a recording as those of its markers.

    Raises
    ------
    RecognitionError
        If a trajectory has no name.
    """
    names = [
        "" if name is None else name.strip().lower().replace(" ", "_") for name in recording.names
    ]
    if "" in names:
        raise RecognitionError(f"{recording.source}: trajectory {names.index('') + 1} has no name")
    return LabelledRecording(
        recording.time,
        recording.positions,
        tuple(names),
        np.zeros(recording.positions.shape[:2], dtype=bool),
        recording.rate_hz,
        recording.source,
        recording.first_frame,
    )


def cut_demonstrations(
    recording: LabelledRecording,
    actions: LabelledSegments,
    blocks: Mapping[str, LabelledSegments],
    actions_each: int,
    around_s: float = 0.0,
    idle_s: float = 0.25,
) -> list[Demonstration]:
    """Cut a recording into demonstrations of a fixed number of actions.

    Parameters
    ----------
    recording : LabelledRecording
    actions : LabelledSegments
        True actions.
    blocks : mapping of LabelledSegments
        True building blocks of each arm.
    actions_each : int
        Actions of one demonstration; what is left over at the end is not used.
    around_s : float
        Seconds to keep before the first and after the last action; at most half of what lies
        between two demonstrations.
    idle_s : float
        Stretches without a label longer than this are ``idle``.

    Returns
    -------
    list of Demonstration
    """
    order = np.argsort(actions.bounds[:, 0], kind="stable")
    groups = [
        actions.bounds[order[first : first + actions_each]]
        for first in range(0, len(order) - actions_each + 1, actions_each)
    ]
    starts = [int(group[:, 0].min()) for group in groups]
    ends = [int(group[:, 1].max()) for group in groups]
    margin = round(around_s * recording.rate_hz)
    found = []
    for index, (start, end) in enumerate(zip(starts, ends, strict=True)):
        before = ends[index - 1] if index else 0
        after = starts[index + 1] if index + 1 < len(groups) else len(recording.time)
        rows = (
            max(start - margin, (before + start) // 2),
            min(end + margin, (end + after) // 2),
        )
        piece = dataclasses.replace(
            recording,
            time=recording.time[rows[0] : rows[1]],
            positions=recording.positions[rows[0] : rows[1]],
            filled=recording.filled[rows[0] : rows[1]],
            source=f"{recording.source}:{index}",
            first_frame=recording.first_frame + rows[0],
        )
        found.append(
            Demonstration(
                piece,
                {arm: _truth(layer, piece, rows, idle_s) for arm, layer in blocks.items()},
                _truth(actions, piece, rows, idle_s),
            )
        )
    return found


def _truth(
    layer: LabelledSegments, piece: LabelledRecording, rows: tuple[int, int], idle_s: float
) -> LabelledSegments:
    """Take the true segments inside rows, and those that reach half-way into them."""
    bounds = np.clip(layer.bounds, *rows) - rows[0]
    inside = np.diff(bounds, axis=1)[:, 0] > 0.5 * np.diff(layer.bounds, axis=1)[:, 0]
    kept = np.flatnonzero(inside & np.array([label != IDLE for label in layer.labels]))
    part = dataclasses.replace(
        layer,
        bounds=bounds[kept],
        labels=tuple(layer.labels[row] for row in kept),
        distances=np.zeros(len(kept)),
        source=piece.source,
        first_frame=piece.first_frame,
    )
    return complete_truth(part, len(piece.time), idle_s)


def sample_labels(bounds: npt.ArrayLike, labels: Sequence[str], n_samples: int) -> list[str]:
    """Return the label of every sample; ``idle`` where there is none."""
    named = np.full(n_samples, -1)
    for index, (start, end) in enumerate(np.asarray(bounds, dtype=np.int64).reshape(-1, 2)):
        named[start:end] = index
    return [IDLE if index < 0 else labels[index] for index in named]

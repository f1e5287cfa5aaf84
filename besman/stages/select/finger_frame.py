"""Where a hand holds things: between thumb and fingers, as they are seen."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from besman.geometry.frames import quaternion_to_rotation, rotation_to_quaternion
from besman.records import HandTrajectory, LabelledRecording
from besman.stages.select.handled_objects import finger_names

FloatArray = npt.NDArray[np.float64]

# Fewer samples of all that is needed tell nothing.
_LEAST_ROWS = 3
# Tips that are as one have no direction.
_LEAST_OPENING_M = 0.01
# Fingers above each other say nothing of what is level (sine of the angle).
_LEAST_LEVEL = 0.3


def finger_frame(tips: FloatArray, hand2lab: FloatArray, hands: FloatArray) -> FloatArray | None:
    """Tell the frame between thumb and fingers in the frame of the hand.

    Parameters
    ----------
    tips : array, shape (T, 2, 3)
        Thumb, and mean of the other fingers, metres in the frame of `hands`; NaN where not seen.
    hand2lab : array, shape (T, 3, 3)
        How the hand is turned; z is up in the lab.
    hands : array, shape (T, 3)
        Where it is, metres.

    Returns
    -------
    array, shape (4, 4)
        Origin half way between thumb and fingers, y across them, towards the hand's own y, x away
        from the hand and level: how a gripper is turned about the axis along which it closes is
        free. In the median over time; None if they are not seen, or closed.
    """
    seen = np.isfinite(tips).all(axis=(1, 2))
    if seen.sum() < _LEAST_ROWS:
        return None
    apart = tips[seen] - hands[seen, np.newaxis]
    inside = np.median(np.einsum("tji,tkj->tki", hand2lab[seen], apart), axis=0)
    across, middle = inside[0] - inside[1], inside.mean(axis=0)
    if np.linalg.norm(across) < _LEAST_OPENING_M:
        return None
    y = across / np.linalg.norm(across) * (1.0 if across[1] >= 0 else -1.0)
    up = np.median(hand2lab[seen, 2], axis=0)
    level = np.cross(y, up)
    if np.linalg.norm(level) < _LEAST_LEVEL:
        return None
    x = level / np.linalg.norm(level) * (1.0 if level @ middle >= 0 else -1.0)
    frame = np.eye(4)
    frame[:3, :3] = np.column_stack([x, y, np.cross(x, y)])
    frame[:3, 3] = middle
    return frame


def turn_to_fingers(
    hand: HandTrajectory,
    recording: LabelledRecording,
    motion: tuple[FloatArray, FloatArray | None],
    first: int,
    held: Sequence[tuple[int, int]],
    prefix: str,
) -> HandTrajectory:
    """Turn the frame of a hand to its thumb and fingers, and say that a tool follows their middle.

    What a tool's ``hand_to_tcp`` says is of a hand whose thumb and fingers close along its y axis;
    how a person holds a thing depends on the thing and on where the markers of the hand are.

    Parameters
    ----------
    hand : HandTrajectory
    recording : LabelledRecording
    motion : centres (T, 3) and orientations (T, 3, 3)
        Of the hand in some rows of the recording; no orientation: the hand stays as it is.
    first : int
        The first of these.
    held : sequence of (int, int)
        Half-open rows of the recording in which something is held, within these.
    prefix : str
        Of the hand's markers.

    Returns
    -------
    HandTrajectory
        The same one, if fingers are not seen, nothing is held, or a recipe says where the thing
        is in the hand.
    """
    centres, hand2lab = motion
    names = finger_names(recording, prefix)
    if hand2lab is None or not names or not held or np.isfinite(hand.grasp).any():
        return hand
    rows = np.concatenate([np.arange(*span) for span in held])
    with warnings.catch_warnings():
        # Nothing but NaN in a row is NaN.
        warnings.simplefilter("ignore", RuntimeWarning)
        fingers = np.nanmean([recording.marker(name)[rows] for name in names], axis=0)
    tips = np.stack([recording.marker(f"{prefix}thumb")[rows], fingers], axis=1)
    frame = finger_frame(tips, hand2lab[rows - first], centres[rows - first])
    if frame is None:
        return hand
    turned = quaternion_to_rotation(hand.poses[:, 3:]) @ frame[:3, :3]
    poses = np.hstack([hand.poses[:, :3], rotation_to_quaternion(turned)])
    grasp = np.concatenate([frame[:3, :3].T @ frame[:3, 3], np.full(4, np.nan)])
    return replace(hand, poses=poses, grasp=grasp)

"""What files leave to their reader: zeros for what was not seen, and which way is up.

Readers of formats leave positions in the file's frame and say in `besman.records.Origin` what the
file says of it; here a recording gets z up, and what was concluded is kept with it.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from besman.geometry.quaternions import multiply
from besman.geometry.up_axis import CLEAR, UpAxis, find_up_axis
from besman.io.warning import warn_of_file
from besman.records import Axis, FloatArray, Origin, Recording
from besman.records.frozen import hand_over

BY_FORMAT = "the format"
"""`Origin.up_by` where a format allows one direction only."""

BY_HABIT = "the program's habit"
"""`Origin.up_by` where a program writes one direction unless told otherwise."""

_SURE = 0.95  # what the data say then counts more than the file's own word
_LIKELY = 0.75  # and then more than what is usual, where nobody said anything

# Rows of a turn from the file's frame: column taken, with its sign. None of them is a mirror.
_TURNS: dict[Axis, tuple[tuple[int, int, int], tuple[float, float, float]]] = {
    "x": ((2, 1, 0), (-1.0, 1.0, 1.0)),
    "y": ((0, 2, 1), (1.0, -1.0, 1.0)),
    "z": ((0, 1, 2), (1.0, 1.0, 1.0)),
    "-x": ((2, 1, 0), (1.0, 1.0, -1.0)),
    "-y": ((0, 2, 1), (1.0, 1.0, -1.0)),
    "-z": ((0, 1, 2), (1.0, -1.0, -1.0)),
}
_HALF = float(np.sqrt(0.5))
# The same turns as quaternions, w first.
_QUATERNIONS: dict[Axis, tuple[float, float, float, float]] = {
    "x": (_HALF, 0.0, -_HALF, 0.0),
    "y": (_HALF, _HALF, 0.0, 0.0),
    "z": (1.0, 0.0, 0.0, 0.0),
    "-x": (_HALF, 0.0, _HALF, 0.0),
    "-y": (_HALF, -_HALF, 0.0, 0.0),
    "-z": (0.0, 1.0, 0.0, 0.0),
}


def at_rate(recording: Recording, asked_hz: float | None) -> Recording:
    """Return a recording whose frames follow each other at a rate that was asked for, if any."""
    if asked_hz is None or recording.rate_hz == asked_hz:
        return recording
    time = recording.time * (recording.rate_hz / asked_hz)
    told = f"{asked_hz:g} frames a second, as asked for; the file says {recording.rate_hz:g}"
    return _note(replace(recording, time=time, rate_hz=asked_hz), told)


def leave_out_zeros(recording: Recording) -> Recording:
    """Make gaps of samples that are 0, 0, 0 to the last digit: no camera sees a marker there.

    Warns
    -----
    RecordingWarning
        With their count, if there are any.
    """
    at_zero = recording.positions == 0.0
    zeros = at_zero[..., 0] & at_zero[..., 1] & at_zero[..., 2]
    if not zeros.any():
        return recording
    count, n_markers = int(zeros.sum()), int(zeros.any(axis=0).sum())
    warn_of_file(
        f"{recording.source}: {count} {'sample' if count == 1 else 'samples'} of {n_markers} "
        f"{'trajectory' if n_markers == 1 else 'trajectories'} at exactly 0, 0, 0 became gaps, as "
        "programs write what they did not see"
    )
    positions = recording.positions.copy()
    positions[zeros] = np.nan
    return _note(
        replace(recording, positions=hand_over(positions)),
        f"{count} samples at exactly 0, 0, 0 are gaps",
    )


def turn_up(recording: Recording, asked: Axis | None, path: Path) -> Recording:
    """Turn a recording so that z points up.

    Parameters
    ----------
    recording : Recording
        In its file's frame; `Origin.up` says what the file or its format says.
    asked : str, optional
        The direction of the file's frame that the user says is up.
    path : Path
        Named in warnings.

    Returns
    -------
    Recording
        Turned, never mirrored; `origin` says by which axis and how that was told.

    Warns
    -----
    RecordingWarning
        If the data say something else than the file or its format, or nothing tells.
    """
    origin = recording.origin or Origin()
    if asked is not None:
        up, told_by = asked, "asked for"
    elif origin.up_by == BY_FORMAT:
        up, told_by = origin.up, origin.up_by
    else:
        found = find_up_axis(recording.positions, recording.names, recording.rate_hz, origin.up)
        up, told_by = _choose(origin, found, path)
    turned = replace(origin, up=up, up_by=told_by)
    if up == "z":
        return replace(recording, origin=turned)
    orientations = recording.orientations
    if orientations is not None:
        orientations = multiply(_QUATERNIONS[up], orientations)
    return replace(
        recording,
        positions=hand_over(turn(recording.positions, up)),
        orientations=orientations,
        origin=turned,
    )


def turn(positions: FloatArray, up: Axis) -> FloatArray:
    """Return positions (..., 3) of a frame in which `up` points up in one in which z does."""
    columns, signs = _TURNS[up]
    # Adding zero turns -0.0 into 0.0.
    turned: FloatArray = np.ascontiguousarray(positions[..., columns]) * np.array(signs) + 0.0
    return turned


def _choose(origin: Origin, found: UpAxis, path: Path) -> tuple[Axis, str]:
    """Choose between what the file or its format says and what the data show."""
    said = origin.up_by or "usual of the format"
    differs = found.axis != origin.up
    if found.confidence < _LIKELY:
        if origin.up != "z" and not origin.up_by:
            warn_of_file(
                f"{path.name}: nothing tells which way is up; taken for {origin.up}, as is usual "
                "(--up z says otherwise)"
            )
        return origin.up, origin.up_by
    if not differs:
        agree = f"{origin.up_by} and {found.told_by}" if origin.up_by else found.told_by
        return origin.up, agree
    least = _SURE if origin.up_by not in ("", BY_HABIT) else CLEAR
    if not origin.up_by and origin.up != "z" and found.axis == "z":
        least = _LIKELY
    if found.confidence < least:
        warn_of_file(
            f"{path.name}: {found.axis} seems to point up, by {found.told_by}, and {origin.up} "
            f"is taken ({said}); --up {found.axis} says otherwise"
        )
        return origin.up, origin.up_by
    if found.axis != "z" or origin.up_by:
        warn_of_file(
            f"{path.name}: {found.axis} points up, by {found.told_by}, not {origin.up} "
            f"({said}); --up {origin.up} says otherwise"
        )
    return found.axis, found.told_by


def _note(recording: Recording, note: str) -> Recording:
    """Add a note to a recording."""
    origin = recording.origin or Origin()
    return replace(recording, origin=replace(origin, notes=(*origin.notes, note)))

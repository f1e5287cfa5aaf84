"""Keypoints of markerless systems: JSON with positions by name for each frame.

Variants seen: a list of frames, or one under ``frames``, ``tracking``, ``data`` or ``keypoints``,
and those that `besman.io.recordings.keypoint_frames` names; a frame a line (JSON Lines); frames'
numbers and times, in seconds or milliseconds (SPL open data), micro- or nanoseconds; ``NaN`` and
``null`` for what was not seen, and names that some frames lack; several people a frame under
``people``, each with a name or an id; lists without names, as OpenPose's ``pose_keypoints_3d`` and
Panoptic's ``joints19``, gathered into one file; Azure Kinect's ``joint_positions``, mmpose's
``instances``; the rate as ``fps``, ``frame_rate``, ``sampling_rate`` or ``rate_hz``, ``units`` and
``up``, beside the frames or in ``metadata``, or none of them; where a ball met a ring,
``landing_x`` and ``landing_y``, in inches (SPL open data). Where no unit is named the height of the
body tells it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from besman.exceptions import RecordingError
from besman.foreign.json_text import parse_json
from besman.foreign.names import split_subject
from besman.io.recordings.c3d_names import keep_single_names
from besman.io.recordings.clock import TIME_NAMES, in_seconds, read_rate, settle_clock
from besman.io.recordings.format import Units, parse_up
from besman.io.recordings.frame_folder import parse_frame_files
from besman.io.recordings.keypoint_frames import (
    collect_positions,
    find_frames,
    names_for_all,
)
from besman.io.recordings.keypoint_orders import is_number
from besman.io.recordings.lengths import UNIT_M, Length, body_length, find_length, parse_unit
from besman.io.recordings.text_lines import in_usual_text
from besman.io.warning import warn_of_file
from besman.records import Axis, FloatArray, Origin, Recording
from besman.records.frozen import hand_over
from besman.records.recordings import RATES_HZ

_RATES = ("rate_hz", "fps", "frame_rate", "framerate", "sampling_rate", "sample_rate", "rate")
_NUMBERS = ("frame", "frame_number", "frame_id", "index")
_LANDING = ("landing_x", "landing_y")
_FARTHEST_IN = 120.0  # who misses a ring by more has not thrown at it
# Parts that only a whole body has.
_ENDS = (("nose", "head", "eye", "ear"), ("ankle", "foot", "toe", "heel"))
_NO_BODY = ("ball", "stick", "box", "object")


def read_keypoints(path: Path, units: Units | None = None) -> Recording:
    """Read keypoints from JSON.

    Parameters
    ----------
    path : Path
        The file, or a folder of them, each of one frame.
    units : "m", "cm", "mm", "in" or "ft", optional
        What the coordinates are in, whatever the file says.

    Returns
    -------
    Recording
        Positions in metres and in the file's frame; the times of the file, from 0 where it has
        none.

    Raises
    ------
    RecordingError
        If the file is missing, is no JSON, or has no frames of positions, or no rate.

    Warns
    -----
    RecordingWarning
        For what was concluded of units and rate.
    """
    files: tuple[Path, ...] = ()
    if path.is_dir():
        frames, about, files = parse_frame_files(path)
    else:
        frames, about = find_frames(_parse(path), path)
    names, positions = collect_positions(frames, names_for_all(about), path, files)
    if len(positions) == 1:
        raise RecordingError(
            f"{path}: a recording of one frame; expected at least two: where each frame has a file "
            "of its own, give their folder"
        )
    numbers = _column(frames, _NUMBERS, path)
    rate_hz = _find_rate(about)
    is_rate = rate_hz is not None and RATES_HZ[0] <= rate_hz <= RATES_HZ[1]
    times = None
    for name in TIME_NAMES:
        column = _column(frames, (name,), path)
        if column is not None:
            times = in_seconds(column, name, rate_hz if is_rate else None)
            break
    if numbers is None and times is None:
        numbers = np.arange(1.0, len(positions) + 1)
    clock = settle_clock(numbers, times, rate_hz, path, None, 0.0)
    positions = clock.spread(positions)
    word = about.get("units", about.get("unit"))
    word = word if isinstance(word, str) else None
    length = find_keypoint_length(word, names, positions, units, path)
    positions = positions * length.metres
    up, up_by = _read_up(about)
    return Recording(
        time=clock.time,
        positions=hand_over(positions),
        names=keep_single_names(names, positions, path.name, "keypoints"),
        rate_hz=clock.rate_hz,
        source=path.name,
        first_frame=clock.first_frame,
        origin=Origin(
            units=length.name,
            units_by=length.told_by,
            up=up,
            up_by=up_by,
            on_ring_m=_read_landing(about),
        ),
    )


def _parse(path: Path) -> Any:
    """Parse the file; NaN stands bare in what Python wrote."""
    try:
        text = path.read_bytes()
    except FileNotFoundError:
        raise RecordingError(f"{path}: no such file") from None
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from None
    if not text.strip():
        raise RecordingError(f"{path}: the file is empty; expected keypoints in JSON")
    text = in_usual_text(text).removeprefix(b"\xef\xbb\xbf")
    try:
        lines = text.split(b"\n")
        if len(lines) > 1 and all(line.strip()[-1:] == b"}" for line in lines[:2]):
            return [parse_json(line, allow_nan=True) for line in lines if line.strip()]
        return parse_json(text, allow_nan=True)
    except json.JSONDecodeError as error:
        raise RecordingError(
            f"{path}:{error.lineno}: not valid JSON: {error.msg}; is the file cut?"
        ) from None


def _find_rate(about: Mapping[str, Any]) -> float | None:
    """Return the rate that the file says: None where it says none, NaN where that is no number."""
    said = next((about[key] for key in _RATES if about.get(key) is not None), None)
    if said is None:
        return None
    return float(said) if is_number(said) else read_rate(str(said))


def _read_landing(about: Mapping[str, Any]) -> tuple[float, float] | None:
    """Return where a ball met a ring, metres from its front; None if the file does not say it."""
    said: list[float] = []
    for key in _LANDING:
        one: Any = about.get(key)
        # JSON holds whole numbers that are larger than any float.
        if not is_number(one) or not abs(one) <= _FARTHEST_IN:
            return None
        said.append(float(one) * UNIT_M["in"])
    return said[0], said[1]


def _column(frames: list[dict[str, Any]], keys: tuple[str, ...], path: Path) -> FloatArray | None:
    """Return a number of every frame, None if not all have it; say so where some have it."""
    for key in keys:
        have = [is_number(frame.get(key)) for frame in frames]
        if all(have):
            return np.array([float(frame[key]) for frame in frames])
        if any(have):
            at = have.index(False)
            warn_of_file(
                f"{path.name}: {key} of frame {at + 1} is {frames[at].get(key)!r:.60}, no number; "
                f"{key} is left out of account"
            )
    return None


def find_keypoint_length(
    word: str | None,
    names: Sequence[str | None],
    positions: FloatArray,
    units: Units | None,
    path: Path,
) -> Length:
    """Tell the units: by the file's word, or by the height of a body that is there as a whole.

    Parameters
    ----------
    word : str or None
        The file's word for its units.
    names : sequence of str or None, length M
    positions : array, shape (T, M, 3)
        In the file's units.
    units : str or None
        What the user says.
    path : Path
        Named in messages.
    """
    lowered = [str(name).lower() for name in names]
    is_body = all(any(part in name for name in lowered for part in parts) for parts in _ENDS)
    if is_body and units is None and (word is None or parse_unit(word) is None):
        kept = [k for k, name in enumerate(lowered) if not any(one in name for one in _NO_BODY)]
        return body_length(positions[:, _most_seen(lowered, kept, positions)], None, str(path))
    return find_length(word, units, positions, str(path), "units")


def _most_seen(names: Sequence[str], kept: list[int], positions: FloatArray) -> list[int]:
    """Return the columns of the one of several people who is seen most: they may stand apart."""
    of_each: dict[str, list[int]] = {}
    for column in kept:
        of_each.setdefault(split_subject(names[column])[0], []).append(column)
    return max(of_each.values(), key=lambda columns: np.isfinite(positions[:, columns, 0]).sum())


def _read_up(about: Mapping[str, Any]) -> tuple[Axis, str]:
    """Return the axis that the file says is up."""
    word = about.get("up")
    if isinstance(word, str):
        try:
            axis = parse_up(word)
        except RecordingError:
            axis = None
        if axis is not None:
            return axis, "the file"
    return "z", ""

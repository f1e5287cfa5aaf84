"""Segments files: the public layout of manual segments, and synthetic truth beside them."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from besman.exceptions import RecordingError
from besman.records import LabelledRecording, LabelledSegments, Recording

SEGMENTS_SUFFIX = "_manually_segmented.json"
_KEYS = ("start index", "end index", "label")
_PART = "_part"


@dataclass(frozen=True)
class ThrowEvent:
    """When and where a thrown object left the hand and met the ground.

    Attributes
    ----------
    release_frame : int
        Absolute frame number nearest to the release.
    release_time_s, touchdown_time_s : float
        Seconds, on the clock of the recording.
    release_m, touchdown_m : tuple of 3 float
        Position of the object's marker, metres in the laboratory frame.
    """

    release_frame: int
    release_time_s: float
    touchdown_time_s: float
    release_m: tuple[float, float, float]
    touchdown_m: tuple[float, float, float]


def segments_path(recording_path: Path) -> Path:
    """Return where the segments of a recording file belong: beside it, with a fixed ending."""
    return recording_path.with_name(recording_path.stem + SEGMENTS_SUFFIX)


def find_segments(recording_path: Path) -> Path | None:
    """Return the segments file beside a recording file, None if there is none."""
    path = segments_path(recording_path)
    return path if path.is_file() else None


def read_segments(
    path: Path, recording: Recording | LabelledRecording, *, keep_parts: bool = False
) -> LabelledSegments:
    """Read the segments of a recording.

    Parameters
    ----------
    path : Path
        A list of ``{"start index", "end index", "label"}``, or an object that holds the list as
        ``segments``. Indices are absolute frame numbers; segments are half-open, so that a border
        is the end of one and the start of the next.
    recording : Recording or LabelledRecording
        The recording that the segments belong to.
    keep_parts : bool
        Keep labels that end in ``_part``; these lie inside another segment.

    Returns
    -------
    LabelledSegments
        In the order of their start, with row indices into the recording.

    Raises
    ------
    RecordingError
        If the file is missing, not of this layout, or belongs to other frames.
    """
    content = _read_json(path)
    rows = content.get("segments") if isinstance(content, dict) else content
    if not isinstance(rows, list):
        raise RecordingError(
            f"{path}: expected a list of segments or an object with a list 'segments'"
        )
    n_samples = len(recording.time)
    segments = [
        _read_segment(row, number, recording.first_frame, n_samples, path)
        for number, row in enumerate(rows, start=1)
    ]
    kept = sorted(
        (segment for segment in segments if keep_parts or not segment[2].endswith(_PART)),
        key=lambda segment: segment[:2],
    )
    return LabelledSegments(
        bounds=np.array([segment[:2] for segment in kept], dtype=np.int64).reshape(-1, 2),
        labels=tuple(segment[2] for segment in kept),
        distances=np.zeros(len(kept)),
        rate_hz=recording.rate_hz,
        source=recording.source,
        first_frame=recording.first_frame,
    )


def read_throws(path: Path) -> tuple[ThrowEvent, ...]:
    """Read the known releases and touchdowns of a segments file; none if it has none.

    Raises
    ------
    RecordingError
        If the file is missing or its events are not of the layout of `write_segments`.
    """
    content = _read_json(path)
    if not isinstance(content, dict) or "events" not in content:
        return ()
    names = [field.name for field in fields(ThrowEvent)]
    try:
        rows = content["events"]["throws"]
        throws = tuple(ThrowEvent(**row) for row in rows)
        return tuple(
            replace(
                throw,
                release_m=_read_point(throw.release_m),
                touchdown_m=_read_point(throw.touchdown_m),
            )
            for throw in throws
        )
    except (KeyError, TypeError, ValueError):
        raise RecordingError(
            f"{path}: events: expected 'throws', a list of objects with {', '.join(names)}"
        ) from None


def write_segments(
    segments: LabelledSegments, path: Path, throws: tuple[ThrowEvent, ...] | None = None
) -> None:
    """Write segments in the public layout.

    Parameters
    ----------
    segments : LabelledSegments
        What to write; bounds become absolute frame numbers.
    path : Path
        The file; replaced if it exists.
    throws : tuple of ThrowEvent, optional
        Known releases and touchdowns; if given, the file is
        ``{"segments": [...], "events": {"throws": [...]}}``, else the bare list.
    """
    bounds = (segments.bounds + segments.first_frame).tolist()
    rows = [
        {"start index": start, "end index": end, "label": label}
        for (start, end), label in zip(bounds, segments.labels, strict=True)
    ]
    content: Any = rows
    if throws is not None:
        content = {"segments": rows, "events": {"throws": [asdict(throw) for throw in throws]}}
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def _read_json(path: Path) -> Any:
    """Read a JSON file."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise RecordingError(f"{path}: no such file") from None
    except json.JSONDecodeError as error:
        raise RecordingError(f"{path}:{error.lineno}: not valid JSON: {error.msg}") from None
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(f"{path}: cannot be read as text: {error}") from None


def _read_segment(
    row: Any, number: int, first_frame: int, n_samples: int, path: Path
) -> tuple[int, int, str]:
    """Check one segment; return start row, end row and label."""
    where = f"{path}: segment {number}"
    if not isinstance(row, dict) or not set(_KEYS) <= set(row):
        raise RecordingError(f"{where}: got {row!r:.80}, expected the keys {', '.join(_KEYS)}")
    start, end, label = (row[key] for key in _KEYS)
    if not (type(start) is int and type(end) is int and isinstance(label, str) and label):
        raise RecordingError(f"{where}: got {row!r:.80}, expected two frame numbers and a label")
    last_frame = first_frame + n_samples - 1
    if not first_frame <= start < end <= last_frame + 1:
        raise RecordingError(
            f"{where} ({label}): frames {start} to {end} do not lie in the recording's frames "
            f"{first_frame} to {last_frame}, or end before they start"
        )
    return start - first_frame, end - first_frame, label


def _read_point(values: Any) -> tuple[float, float, float]:
    """Check three coordinates."""
    x, y, z = (float(value) for value in values)
    return x, y, z

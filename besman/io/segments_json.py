"""Segments files: the public layout of manual segments, and synthetic truth beside them."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from besman.records import LabelledSegments

SEGMENTS_SUFFIX = "_manually_segmented.json"


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

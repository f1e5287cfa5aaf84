"""Segments files: the public layout of manual segments, and synthetic truth beside them."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from besman.exceptions import RecordingError, nearest
from besman.foreign.json_text import parse_json
from besman.foreign.names import fault_of_name
from besman.io.atomic_files import write_text
from besman.io.segments_origin import ORIGIN, Origin, check_origin, describe_origin
from besman.io.warning import warn_of_file
from besman.records import LabelledRecording, LabelledSegments, Recording
from besman.records.layers import LAYERS, is_layer
from besman.records.recordings import FARTHEST_M, GREATEST_FRAME

SEGMENTS_SUFFIX = "_manually_segmented.json"
_KEYS = ("start index", "end index", "label")
_LAYER = "layer"
_ALLOWED = (*_KEYS, _LAYER)
_PART = "_part"
# A clock of recordings counts a day at most; what falls for a minute fell from above the clouds.
_LONGEST_CLOCK_S = 1e5
_LONGEST_FLIGHT_S = 60.0


class _Row(NamedTuple):
    """One segment of a file: half-open rows of the recording, and its number in the file."""

    start: int
    end: int
    label: str
    layer: str
    number: int


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
        ``segments`` and may say as ``recording`` what they belong to (see
        `besman.io.segments_origin`). Indices are absolute frame numbers; segments are half-open,
        so that a border is the end of one and the start of the next. A segment may have a
        ``"layer"``, one of `besman.records.layers.LAYERS`; segments of one layer do not overlap.
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
        If the file is missing, not of this layout, or belongs to other frames, or two segments of
        one layer overlap.

    Warns
    -----
    RecordingWarning
        If a stretch stands there twice in one layer, or the file says that it was made of other
        places.
    """
    return parse_segments(read_content(path), recording, path, keep_parts=keep_parts)


def parse_segments(
    content: Any,
    recording: Recording | LabelledRecording,
    path: Path,
    *,
    keep_parts: bool = False,
    origin: Origin | None = None,
) -> LabelledSegments:
    """Check what stands in a segments file, as `read_segments` does.

    Parameters
    ----------
    content : list or dict
        What `read_content` returns.
    recording, keep_parts
        As in `read_segments`.
    path : Path
        Named in errors.
    origin : dict, optional
        What `besman.io.segments_origin.describe_origin` says of the recording, if that is known.

    Raises
    ------
    RecordingError
        If it is not of this layout or belongs to other frames, or two segments of one layer
        overlap.
    """
    rows = content.get("segments") if isinstance(content, dict) else content
    if not isinstance(rows, list):
        raise RecordingError(
            f"{path}: expected a list of segments or an object with a list 'segments'"
        )
    if isinstance(content, dict) and ORIGIN in content:
        origin = describe_origin(recording) if origin is None else origin
        check_origin(content[ORIGIN], origin, recording.source, path)
    n_samples = len(recording.time)
    segments = [
        _read_segment(row, number, recording.first_frame, n_samples, path)
        for number, row in enumerate(rows, start=1)
    ]
    segments.sort(key=lambda segment: segment[:2])
    _refuse_overlap(segments, recording.first_frame, path)
    _warn_of_twins(segments, recording.first_frame, path)
    kept = [segment for segment in segments if keep_parts or not segment.label.endswith(_PART)]
    return LabelledSegments(
        bounds=np.array([segment[:2] for segment in kept], dtype=np.int64).reshape(-1, 2),
        labels=tuple(segment.label for segment in kept),
        layers=tuple(segment.layer for segment in kept),
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
    content = read_content(path)
    if not isinstance(content, dict) or "events" not in content:
        return ()
    names = [field.name for field in fields(ThrowEvent)]
    try:
        rows = content["events"]["throws"]
        if not isinstance(rows, list):
            raise TypeError
        return tuple(_read_throw(ThrowEvent(**row)) for row in rows)
    except (KeyError, TypeError, ValueError):
        raise RecordingError(
            f"{path}: events: expected 'throws', a list of objects with {', '.join(names)}: a "
            f"frame, times in s that rise by {_LONGEST_FLIGHT_S:g} s at most, places within "
            f"{FARTHEST_M:g} m"
        ) from None


def write_segments(
    segments: LabelledSegments,
    path: Path,
    throws: tuple[ThrowEvent, ...] | None = None,
    origin: Origin | None = None,
) -> None:
    """Write segments in the public layout.

    Parameters
    ----------
    segments : LabelledSegments
        What to write; bounds become absolute frame numbers. A segment without a layer gets no
        key ``layer``.
    path : Path
        The file; replaced if it exists.
    throws : tuple of ThrowEvent, optional
        Known releases and touchdowns.
    origin : dict, optional
        What `besman.io.segments_origin.describe_origin` says of the recording. With it or throws
        the file is ``{"segments": [...], "recording": {...}, "events": {"throws": [...]}}``, else
        the bare list.
    """
    rows = segment_rows(segments)
    around: dict[str, Any] = {} if origin is None else {ORIGIN: origin}
    if throws is not None:
        around["events"] = {"throws": [asdict(throw) for throw in throws]}
    content: Any = {"segments": rows, **around} if around else rows
    text = json.dumps(content, indent=1) + "\n"
    write_text(path, text, durable=False, kind=RecordingError)


def segment_rows(segments: LabelledSegments) -> list[dict[str, Any]]:
    """Return segments as rows of a segments file, in frame numbers; "" is no layer."""
    bounds = (segments.bounds + segments.first_frame).tolist()
    layers = segments.layers or ("",) * len(bounds)
    return [
        {"start index": start, "end index": end, "label": label}
        | ({_LAYER: layer} if layer else {})
        for (start, end), label, layer in zip(bounds, segments.labels, layers, strict=True)
    ]


def read_content(path: Path) -> Any:
    """Read a JSON file.

    Raises
    ------
    RecordingError
        If it is missing or not JSON.
    """
    try:
        return parse_json(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise RecordingError(f"{path}: no such file") from None
    except json.JSONDecodeError as error:
        raise RecordingError(f"{path}:{error.lineno}: not valid JSON: {error.msg}") from None
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(f"{path}: cannot be read as text: {error}") from None


def _read_segment(row: Any, number: int, first_frame: int, n_samples: int, path: Path) -> _Row:
    """Check one segment."""
    where = f"{path}: segment {number}"
    if not isinstance(row, dict) or not set(_KEYS) <= set(row):
        raise RecordingError(f"{where}: got {row!r:.80}, expected the keys {', '.join(_KEYS)}")
    unknown = sorted(set(row) - {*_KEYS, _LAYER})
    if unknown:
        raise RecordingError(f"{where}: no key {unknown[0]!r}; {nearest(unknown[0], _ALLOWED)}")
    start, end, label = (row[key] for key in _KEYS)
    if not (type(start) is int and type(end) is int and isinstance(label, str) and label):
        raise RecordingError(f"{where}: got {row!r:.80}, expected two frame numbers and a label")
    fault = fault_of_name(label)
    if fault is not None:
        raise RecordingError(f"{where}: label {label!r:.60} {fault}")
    layer = row.get(_LAYER, "")
    if not (isinstance(layer, str) and (is_layer(layer) or _LAYER not in row)):
        raise RecordingError(
            f"{where} ({label}): no layer {layer!r}; {nearest(str(layer), LAYERS)}"
        )
    last_frame = first_frame + n_samples - 1
    if not first_frame <= start < end <= last_frame + 1:
        raise RecordingError(
            f"{where} ({label}): frames {start} to {end} do not lie in the recording's frames "
            f"{first_frame} to {last_frame}, or end before they start"
        )
    return _Row(start - first_frame, end - first_frame, label, layer, number)


def _refuse_overlap(segments: list[_Row], first_frame: int, path: Path) -> None:
    """Refuse segments of one layer that overlap; rows are in the order of their start.

    Parts lie inside another segment, and segments without a layer may be of several.
    """
    last: dict[str, _Row] = {}
    for one in segments:
        if not one.layer or one.label.endswith(_PART):
            continue
        before = last.get(one.layer)
        if before is not None and one.start < before.end:
            both = " and ".join(
                f"segment {row.number} ({row.label}, frames {row.start + first_frame} to "
                f"{row.end + first_frame})"
                for row in (before, one)
            )
            raise RecordingError(
                f"{path}: {both} overlap in layer {one.layer!r}; expected one after the other"
            )
        last[one.layer] = one


def _warn_of_twins(segments: list[_Row], first_frame: int, path: Path) -> None:
    """Say which stretches stand there twice in one layer: a class would learn from them twice."""
    seen: dict[tuple[int, int, str], _Row] = {}
    twins = [
        (seen[one[0], one[1], one.layer], one)
        for one in segments
        if seen.setdefault((one.start, one.end, one.layer), one) is not one
    ]
    if twins:
        first, second = twins[0]
        warn_of_file(
            f"{path.name}: {len(twins)} stretches stand there twice, first segment {second.number} "
            f"({second.label}), frames {second.start + first_frame} to {second.end + first_frame} "
            f"as segment {first.number} ({first.label})"
        )


def _read_throw(throw: ThrowEvent) -> ThrowEvent:
    """Check a throw; a `ValueError` or `TypeError` says that it is none."""
    times = (_read_number(throw.release_time_s), _read_number(throw.touchdown_time_s))
    if type(throw.release_frame) is not int or not 0 <= throw.release_frame <= GREATEST_FRAME:
        raise ValueError
    if not (abs(times[0]) <= _LONGEST_CLOCK_S and 0 < times[1] - times[0] <= _LONGEST_FLIGHT_S):
        raise ValueError
    release_m, touchdown_m = _read_point(throw.release_m), _read_point(throw.touchdown_m)
    return replace(throw, release_m=release_m, touchdown_m=touchdown_m)


def _read_number(value: Any) -> float:
    """Check a number that is neither text nor infinite."""
    if type(value) not in (int, float) or not abs(value) <= GREATEST_FRAME:
        raise ValueError
    return float(value)


def _read_point(values: Any) -> tuple[float, float, float]:
    """Check three coordinates."""
    x, y, z = (_read_number(value) for value in values)
    if max(abs(x), abs(y), abs(z)) > FARTHEST_M:
        raise ValueError
    return x, y, z

"""Keypoints of markerless systems: JSON with positions by name for each frame.

Variants seen: a list of frames, or one under ``frames``, ``tracking``, ``data`` or ``keypoints``;
each frame a mapping of names to three numbers, at any depth (``data``: ``player``: ``R_WRIST``); or
one mapping of names to lists of positions; frames' numbers and times, in seconds or milliseconds
(SPL open data); ``NaN`` and ``null`` for what was not seen, and names that some frames lack;
several people a frame under ``people``, each with a name or an id, and OpenPose's flat lists
``pose_keypoints_3d`` of BODY_25, gathered into one file; the rate as ``fps``, ``frame_rate``,
``sampling_rate`` or ``rate_hz``; ``units`` and ``up`` or neither. Where no unit is named
the height of the body tells it.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from besman.exceptions import RecordingError, RecordingWarning
from besman.foreign.json_text import parse_json
from besman.io.recordings.c3d_names import keep_single_names
from besman.io.recordings.clock import read_rate, settle_clock
from besman.io.recordings.format import Units, parse_up
from besman.io.recordings.lengths import Length, body_length, find_length, parse_unit
from besman.records import Axis, FloatArray, Origin, Recording
from besman.records.frozen import hand_over

_RATES = ("rate_hz", "fps", "frame_rate", "framerate", "sampling_rate", "sample_rate", "rate")
_FRAMES = ("frames", "tracking", "data", "keypoints", "markers", "poses")
_TRIALS = ("trials", "recordings", "takes", "sequences")
_TIMES = ("time", "time_s", "timestamp", "t")
_NUMBERS = ("frame", "frame_number", "frame_id", "index")
_PEOPLE = ("people", "persons", "subjects", "skeletons")
_IDS = ("name", "subject", "person_id", "id", "track_id")
_FLAT = "pose_keypoints_3d"
# OpenPose's BODY_25, in its order.
_BODY_25 = (
    "Nose", "Neck", "RShoulder", "RElbow", "RWrist", "LShoulder", "LElbow", "LWrist", "MidHip",
    "RHip", "RKnee", "RAnkle", "LHip", "LKnee", "LAnkle", "REye", "LEye", "REar", "LEar",
    "LBigToe", "LSmallToe", "LHeel", "RBigToe", "RSmallToe", "RHeel",
)  # fmt: skip
_WRAPPERS = {"data", "keypoints", "markers", "player", "positions", "pose", "joints", "person"}
_MOST_NAMES = 10_000
# Parts that only a whole body has.
_ENDS = (("nose", "head", "eye", "ear"), ("ankle", "foot", "toe", "heel"))
_NO_BODY = ("ball", "stick", "box", "object")


def read_keypoints(path: Path, units: Units | None = None) -> Recording:
    """Read keypoints from JSON.

    Parameters
    ----------
    path : Path
        The file.
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
    content = _parse(path)
    about = content if isinstance(content, dict) else {}
    frames = _find_frames(content, path)
    names, positions = _collect(frames, path)
    numbers = _column(frames, _NUMBERS, path)
    times = _column(frames, _TIMES, path)
    rate_hz = _find_rate(about)
    if times is not None and rate_hz is None and np.median(np.diff(times)) > 1.0:
        times = times / 1000.0
    elif times is not None and rate_hz is not None and len(times) > 1:
        # Milliseconds count a thousand times as far as the rate says.
        shown = np.median(np.diff(times)) * rate_hz
        times = times / 1000.0 if 500.0 < shown < 2000.0 else times
    if numbers is None and times is None:
        numbers = np.arange(1.0, len(positions) + 1)
    clock = settle_clock(numbers, times, rate_hz, path, 1, 0.0)
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
        origin=Origin(units=length.name, units_by=length.told_by, up=up, up_by=up_by),
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
    try:
        return parse_json(text.removeprefix(b"\xef\xbb\xbf"), allow_nan=True)
    except json.JSONDecodeError as error:
        raise RecordingError(
            f"{path}:{error.lineno}: not valid JSON: {error.msg}; is the file cut?"
        ) from None


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_position(value: Any) -> bool:
    """Tell whether a value is three numbers, or what stands for them in a gap."""
    if not isinstance(value, list) or len(value) not in (3, 4):
        return False
    return all(one is None or _is_number(one) for one in value)


def _find_frames(content: Any, path: Path) -> list[dict[str, Any]]:
    """Return the frames: mappings that hold positions by name."""
    _refuse_trials(content, path)
    if isinstance(content, dict):
        for key in _FRAMES:
            inner = content.get(key)
            if isinstance(inner, list) and inner and isinstance(inner[0], dict):
                content = inner
                break
        else:
            content = _turn_over(content, path)
    if not isinstance(content, list) or not content:
        raise RecordingError(
            f"{path}: no frames; expected a list of them, each with positions by name"
        )
    for at, frame in enumerate(content, start=1):
        if not isinstance(frame, dict):
            raise RecordingError(
                f"{path}: frame {at}: got {frame!r:.60}; expected positions by name"
            )
    return content


def _refuse_trials(content: Any, path: Path) -> None:
    """Refuse a file with several recordings: a list of what each has frames of its own."""
    several = content
    if isinstance(content, dict):
        several = next((content[key] for key in _TRIALS if key in content), content)
    if isinstance(several, dict):
        several = list(several.values())
    if not isinstance(several, list) or not several:
        return
    trials = [one for one in several if isinstance(one, dict) and _has_frames(one)]
    if len(trials) == len(several):
        raise RecordingError(
            f"{path}: {len(trials)} recordings with frames of their own; expected one a file: "
            "jq -c '.[]' FILE | split -l 1 --additional-suffix=.json - trial_ makes files of a list"
        )


def _has_frames(one: Mapping[str, Any]) -> bool:
    """Tell whether a mapping holds a list of frames."""
    lists = (one.get(key) for key in _FRAMES)
    return any(isinstance(each, list) and each and isinstance(each[0], dict) for each in lists)


def _turn_over(content: dict[str, Any], path: Path) -> list[dict[str, Any]]:
    """Make frames of lists of positions by name."""
    lists = {
        name: value
        for name, value in _flatten(content)
        if isinstance(value, list) and value and all(map(_is_position, value))
    }
    lengths = {len(value) for value in lists.values()}
    if len(lengths) > 1:
        name = next(iter(lists))
        other = next(one for one in lists if len(lists[one]) != len(lists[name]))
        raise RecordingError(
            f"{path}: {name!r:.60} has {len(lists[name])} positions and {other!r:.60} "
            f"{len(lists[other])}; expected the same number"
        )
    return [dict(zip(lists, row, strict=True)) for row in zip(*lists.values(), strict=True)]


def _flatten(frame: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield what a mapping holds at any depth, by its own name or that of what it is in."""
    for name, value in frame.items():
        full = f"{prefix}{name}"
        if name.lower() in _PEOPLE and isinstance(value, list):
            for at, person in enumerate(value):
                if isinstance(person, dict):
                    yield from _flatten(person, f"{prefix}{_identify(person, at)}:")
        elif name == _FLAT and isinstance(value, list):
            yield from _unfold(value, prefix)
        elif isinstance(value, dict):
            yield from _flatten(value, prefix if name.lower() in _WRAPPERS else f"{full}:")
        else:
            yield full, value


def _identify(person: Mapping[str, Any], at: int) -> str:
    """Say who of several people in a frame one is: by the file's word, else by the place."""
    for key in _IDS:
        value = person.get(key)
        if isinstance(value, list) and len(value) == 1:
            value = value[0]
        # Where nobody was told apart, OpenPose writes -1.
        if isinstance(value, str) or (_is_number(value) and value != -1):
            return value if isinstance(value, str) else f"person{value:g}"
    return f"person{at}"


def _unfold(values: list[Any], prefix: str) -> Iterator[tuple[str, Any]]:
    """Yield the keypoints of OpenPose's flat list: x, y, z and how sure it is, 0 if not seen."""
    n_points = len(_BODY_25)
    if len(values) != 4 * n_points or not all(map(_is_number, values)):
        if values:
            yield f"{prefix}{_FLAT}", values
        return
    for at, name in enumerate(_BODY_25):
        *place, sure = values[4 * at : 4 * at + 4]
        yield f"{prefix}{name}", place if sure > 0 else [None, None, None]


def _collect(frames: list[dict[str, Any]], path: Path) -> tuple[list[str | None], FloatArray]:
    """Return names and positions (T, M, 3); NaN where a frame lacks a name."""
    places: dict[str, int] = {}
    rows = []
    for at, frame in enumerate(frames, start=1):
        row = {}
        for name, value in _flatten(frame):
            if not isinstance(value, list):
                continue
            if name.rpartition(":")[2].lower() in _IDS:
                continue
            if not _is_position(value):
                raise RecordingError(
                    f"{path}: frame {at}: {name!r:.60} is {value!r:.60}; expected three numbers"
                )
            place = places.setdefault(name, len(places))
            row[place] = [np.nan if one is None else float(one) for one in value[:3]]
        rows.append(row)
        if len(places) > _MOST_NAMES:
            raise RecordingError(f"{path}: more than {_MOST_NAMES} names of keypoints")
    if not places:
        raise RecordingError(
            f"{path}: no positions by name; expected three numbers for each keypoint"
        )
    positions = np.full((len(frames), len(places), 3), np.nan)
    for at, row in enumerate(rows):
        if row:
            positions[at, list(row)] = list(row.values())
    # Larger than a double, as a power of ten that JSON can hold.
    positions[~np.isfinite(positions)] = np.nan
    return list(places), positions


def _find_rate(about: Mapping[str, Any]) -> float | None:
    """Return the rate that the file says: None where it says none, NaN where that is no number."""
    said = next((about[key] for key in _RATES if about.get(key) is not None), None)
    if said is None:
        return None
    return float(said) if _is_number(said) else read_rate(str(said))


def _column(frames: list[dict[str, Any]], keys: tuple[str, ...], path: Path) -> FloatArray | None:
    """Return a number of every frame, None if not all have it; say so where some have it."""
    for key in keys:
        have = [_is_number(frame.get(key)) for frame in frames]
        if all(have):
            return np.array([float(frame[key]) for frame in frames])
        if any(have):
            at = have.index(False)
            warnings.warn(
                f"{path.name}: {key} of frame {at + 1} is {frames[at].get(key)!r:.60}, no number; "
                f"{key} is left out of account",
                RecordingWarning,
                stacklevel=5,
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
        return body_length(positions[:, kept], None, str(path))
    return find_length(word, units, positions, str(path), "units")


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

"""Frames of keypoints, in whatever way JSON holds them: each a mapping of names to three numbers.

What is understood, at any depth and mixed: a place as ``[x, y, z]`` (a fourth number, how sure it
is, is left out), as ``{"x": ..., "y": ..., "z": ...}``, as ``{"position": [...]}`` or as the
numbers ``NAME_x``, ``NAME_y``, ``NAME_z``; keypoints as a mapping of names, as a list of
mappings with ``name``, or as a bare list whose names stand once in the file (``keypoint_names``);
frames as a list, as a mapping by number, or turned over: a list of places, of x, y and z, or of one
coordinate by name. pandas writes some of these (``records``, ``columns``, ``split``).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from besman.exceptions import RecordingError
from besman.io.recordings.keypoint_orders import ORDERS, UNSEEN, is_number, unfold
from besman.records import FloatArray

FRAMES = ("frames", "tracking", "data", "keypoints", "markers", "poses", "instance_info")
_TRIALS = ("trials", "recordings", "takes", "sequences")
_ABOUT = ("metadata", "meta", "info", "header", "meta_info")
_NAMES = (
    "keypoint_names", "joint_names", "marker_names", "landmark_names", "names", "labels",
    "keypoints", "joints", "markers",
)  # fmt: skip
_NAME = ("name", "label", "keypoint", "joint", "marker", "landmark", "part", "body_part")
_PLACE = ("position", "pos", "xyz", "point", "coordinates", "coords", "location", "translation")
_PEOPLE = ("people", "persons", "subjects", "skeletons", "bodies", "instances")
_IDS = ("name", "subject", "person_id", "body_id", "id", "track_id")
# What is said of keypoints besides where they are.
_NO_PLACES = re.compile(
    r"orient|rotat|quat|veloc|accel|angle|score|confiden|visib|bbox", re.IGNORECASE
)
_WRAPPERS = {
    "data", "keypoints", "markers", "player", "positions", "pose", "joints", "person", "landmarks",
    "pose_3d", "pose3d", "keypoints_3d", "keypoints3d", "landmark_positions", "points", "objects",
}  # fmt: skip
_MOST_NAMES = 10_000
_MOST_DIGITS = 15


def find_frames(content: Any, path: Path) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Return the frames, and what the file says of all of them.

    Parameters
    ----------
    content : dict or list
        Parsed JSON.
    path : Path
        Named in messages.

    Returns
    -------
    frames : list of dict
        Of each its own keys; positions by name, see `collect_positions`.
    about : dict
        Values by key: rate, units, what is up, and whatever else stands beside the frames.

    Raises
    ------
    RecordingError
        If there are none, or several recordings.
    """
    content, about = _unwrap(content)
    _refuse_trials(content, path)
    names = names_for_all(about)
    if isinstance(content, dict):
        content = _frames_of_mapping(content, names, path)
    if not isinstance(content, list) or not content:
        raise RecordingError(
            f"{path}: no frames; expected a list of them, each with positions by name"
        )
    if names and all(isinstance(frame, list) for frame in content):
        content = [{"keypoints": frame} for frame in content]
    for at, frame in enumerate(content, start=1):
        if not isinstance(frame, dict):
            raise RecordingError(
                f"{path}: frame {at}: got {frame!r:.60}; expected positions by name"
            )
    return content, about


def _unwrap(content: Any) -> tuple[Any, dict[str, Any]]:
    """Go down to what holds the frames; gather what the levels above say."""
    about: dict[str, Any] = {}
    while isinstance(content, dict):
        for key in _ABOUT:
            if isinstance(content.get(key), dict):
                about |= content[key]
        about |= content
        inner = [one for one in content.values() if isinstance(one, dict) and _has_frames(one)]
        if len(inner) != 1 or _has_frames(content) or any(key in content for key in _TRIALS):
            break
        content = inner[0]
    return content, about


def names_for_all(about: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the names of keypoints that stand once for all frames; none if they do not."""
    for key in _NAMES:
        value = about.get(key)
        if isinstance(value, list) and value and all(isinstance(one, str) for one in value):
            return tuple(value)
    by_number = about.get("keypoint_id2name")
    if isinstance(by_number, dict) and by_number:
        names = [by_number.get(str(at)) for at in range(len(by_number))]
        if all(isinstance(name, str) for name in names):
            return tuple(map(str, names))
    return ()


def _frames_of_mapping(
    content: dict[str, Any], names: Sequence[str], path: Path
) -> list[dict[str, Any]] | list[Any]:
    """Return frames that stand under one key, by number, as a table, or turned over."""
    table = _rows_of_table(content)
    if table is not None:
        return table
    for key in FRAMES:
        inner = content.get(key)
        if isinstance(inner, dict):
            inner = _by_number(inner) or inner
        framed = dict | list if names else dict
        # Names and places are the keypoints of one frame.
        if (
            isinstance(inner, list)
            and inner
            and isinstance(inner[0], framed)
            and not _named_place(inner[0])
        ):
            return inner
    numbered = _by_number(content)
    return numbered if numbered is not None else _turn_over(content, path) or _find_list(content)


def _find_list(content: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the longest list of mappings with places in them; of people it makes one frame."""
    lists = {key: one for key, one in content.items() if isinstance(one, list) and one}
    framed = [
        [content] if key.lower() in _PEOPLE else one
        for key, one in lists.items()
        if all(isinstance(frame, dict) for frame in one)
        and not _named_place(one[0])
        and any(_is_position(value) for _, value in _flatten(one[0]))
    ]
    return max(framed, key=len, default=[])


def _by_number(content: Mapping[str, Any]) -> list[dict[str, Any]] | None:
    """Return the frames of a mapping of numbers to frames."""
    if not content or not all(
        _is_frame_number(key) and isinstance(one, dict) for key, one in content.items()
    ):
        return None
    return [
        {"frame": int(key), **content[key]} for key in sorted(content, key=lambda key: int(key))
    ]


def _is_frame_number(key: str) -> bool:
    """Tell whether a key counts frames: Python parses no number of thousands of digits."""
    return key.isascii() and key.isdecimal() and len(key) <= _MOST_DIGITS


def _rows_of_table(content: Mapping[str, Any]) -> list[dict[str, Any]] | None:
    """Return the rows of a table: its columns and its data, or a mapping of rows by column."""
    columns, rows = content.get("columns"), content.get("data")
    if isinstance(columns, list) and isinstance(rows, list):
        same = all(isinstance(row, list) and len(row) == len(columns) for row in rows)
        return [dict(zip(map(str, columns), row, strict=True)) for row in rows] if same else None
    values = list(content.values())
    if len(values) < 3 or not all(isinstance(one, dict) and one for one in values):
        return None
    keys = list(values[0])
    if not all(map(_is_frame_number, keys)) or any(list(one) != keys for one in values):
        return None
    return [{name: column[key] for name, column in content.items()} for key in keys]


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
    """Tell whether a mapping holds a list of frames, and not one of keypoints with their names."""
    lists = (one.get(key) for key in FRAMES)
    return any(
        isinstance(each, list) and each and isinstance(each[0], dict) and not _named_place(each[0])
        for each in lists
    )


def _turn_over(content: dict[str, Any], path: Path) -> list[dict[str, Any]]:
    """Make frames of lists by name: of places, or of one coordinate each."""
    lists = {
        name: value
        for name, value in _flatten(content)
        if isinstance(value, list) and value and (_are_positions(value) or _are_numbers(value))
    }
    n_places = {len(value) for value in lists.values() if _are_positions(value)}
    lengths = {len(value) for value in lists.values()}
    if n_places:
        lists = {name: value for name, value in lists.items() if _are_positions(value)}
        lengths = n_places
    elif not any(name[-2:-1] in ("_", ".", " ", ":") for name in lists):
        return []
    if len(lengths) > 1:
        name = next(iter(lists))
        other = next(one for one in lists if len(lists[one]) != len(lists[name]))
        raise RecordingError(
            f"{path}: {name!r:.60} has {len(lists[name])} positions and {other!r:.60} "
            f"{len(lists[other])}; expected the same number"
        )
    return [dict(zip(lists, row, strict=True)) for row in zip(*lists.values(), strict=True)]


def _are_positions(value: list[Any]) -> bool:
    return isinstance(value[0], list) and all(map(_is_position, value))


def _are_numbers(value: list[Any]) -> bool:
    return all(one is None or is_number(one) for one in value)


def _is_position(value: Any) -> bool:
    """Tell whether a value is three numbers, or what stands for them in a gap."""
    if not isinstance(value, list) or len(value) not in (3, 4):
        return False
    return all(one is None or is_number(one) for one in value)


def _place_of(value: Mapping[str, Any]) -> list[Any] | None:
    """Return the place that a mapping holds; None if it holds none."""
    lowered = {key.lower(): one for key, one in value.items()}
    if {"x", "y", "z"} <= lowered.keys():
        place = [lowered[axis] for axis in "xyz"]
        return None if any(isinstance(one, dict | list) for one in place) else place
    for key in _PLACE:
        inner = lowered.get(key)
        if isinstance(inner, dict):
            inner = _place_of(inner)
        if _is_position(inner):
            return list(inner or ())[:3]
    return None


def _named_place(one: Any) -> tuple[str, list[Any]] | None:
    """Return name and place of one entry of a list of keypoints."""
    if not isinstance(one, dict):
        return None
    name = next((one[key] for key in _NAME if isinstance(one.get(key), str)), None)
    # What was not seen may have a name alone.
    place = _place_of(one) or (UNSEEN if any(key in one for key in _PLACE) else None)
    return None if name is None or place is None else (name, place)


def _flatten(
    frame: Mapping[str, Any], prefix: str = "", names: Sequence[str] = ()
) -> Iterator[tuple[str, Any]]:
    """Yield what a mapping holds at any depth, by its own name or that of what it is in."""
    apart: dict[str, dict[str, Any]] = {}
    for name, value in frame.items():
        full = f"{prefix}{name}"
        if isinstance(value, list) and _NO_PLACES.search(name):
            continue
        if isinstance(value, dict):
            place = _place_of(value)
            if place is not None:
                yield full, place
                continue
            inside = prefix if name.lower() in _WRAPPERS else f"{full}:"
            yield from _flatten(value, inside, names)
        elif isinstance(value, list):
            yield from _flatten_list(name, value, prefix, names)
        elif name[-1:] in "xyzXYZ" and name[-2:-1] in ("_", ".", " ", ":"):
            apart.setdefault(f"{prefix}{name[:-2]}", {})[name[-1].lower()] = value
        else:
            yield full, value
    for full, axes in apart.items():
        if len(axes) == len("xyz"):
            yield full, [axes[axis] for axis in "xyz"]


def _flatten_list(
    name: str, value: list[Any], prefix: str, names: Sequence[str]
) -> Iterator[tuple[str, Any]]:
    """Yield what a list in a frame holds: a place, people, or keypoints."""
    if name in ORDERS:
        yield from unfold(name, value, prefix)
        return
    named = [_named_place(one) for one in value]
    if named and all(named):
        yield from ((f"{prefix}{one[0]}", one[1]) for one in named if one is not None)
    elif name.lower() in _PEOPLE:
        for at, person in enumerate(value):
            if isinstance(person, dict):
                yield from _flatten(person, f"{prefix}{_identify(person, at)}:", names)
    else:
        places = _places_of_all(value, len(names)) if names else None
        if places is None:
            yield f"{prefix}{name}", value
        else:
            yield from zip((f"{prefix}{one}" for one in names), places, strict=True)


def _places_of_all(value: list[Any], n_names: int) -> list[Any] | None:
    """Return the places of keypoints that stand in the order of their names; None if not so."""
    if len(value) == n_names and all(isinstance(one, list | dict) for one in value):
        return [_place_of(one) if isinstance(one, dict) else one for one in value]
    n_each = len(value) // n_names
    if n_each in (3, 4) and len(value) == n_each * n_names and _are_numbers(value):
        return [value[n_each * at : n_each * at + 3] for at in range(n_names)]
    return None


def _identify(person: Mapping[str, Any], at: int) -> str:
    """Say who of several people in a frame one is: by the file's word, else by the place."""
    for key in _IDS:
        value = person.get(key)
        if isinstance(value, list) and len(value) == 1:
            value = value[0]
        # Where nobody was told apart, OpenPose writes -1.
        if isinstance(value, str) or (is_number(value) and value != -1):
            return value if isinstance(value, str) else f"person{value:g}"
    return f"person{at}"


def collect_positions(
    frames: list[dict[str, Any]], names: Sequence[str], path: Path, files: Sequence[Path] = ()
) -> tuple[list[str | None], FloatArray]:
    """Return names, and positions of shape (T, M, 3) in the file's units.

    Parameters
    ----------
    frames : list of dict, length T
        As `find_frames` returns them.
    names : sequence of str
        Of keypoints that the frames hold without; see `names_for_all`.
    path : Path
        Named in messages.
    files : sequence of Path, length T, optional
        Of each frame, where it has a file of its own.

    Raises
    ------
    RecordingError
        If there are no positions by name, or too many names.
    """
    places: dict[str, int] = {}
    rows = []
    for at, frame in enumerate(frames, start=1):
        row = {}
        for name, value in _flatten(frame, names=names):
            # An empty list stands where something was not seen.
            if not isinstance(value, list) or not value:
                continue
            if name.rpartition(":")[2].lower() in _IDS:
                continue
            if not _is_position(value):
                where = files[at - 1] if files else f"{path}: frame {at}"
                raise RecordingError(
                    f"{where}: {name!r:.60} is {value!r:.60}; expected three numbers"
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

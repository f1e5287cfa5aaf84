"""Folders of keypoints in which every frame is a JSON file of its own, its number in its name.

Variants seen: CMU Panoptic 0.7 (``body3DScene_00000000.json``: ``bodies``, each with ``id`` and
``joints19``, centimetres, y down; ``univTime`` in milliseconds, ``fpsType`` as ``hd_29_97`` or
``vga_25``; nobody there: no bodies); OpenPose's 3D (``NAME_000000000000_keypoints.json``:
``people`` with ``pose_keypoints_3d``); EasyMocap (``keypoints3d/000000.json``: a list of people,
each with ``id`` and ``keypoints3d``, x, y, z and how sure it is, in the order of BODY_25); a file
of ``{name: [x, y, z]}``, or whatever else one frame may look like in
`besman.io.recordings.keypoint_frames`. Frames without a file are gaps. What is in pictures
(OpenPose's ``pose_keypoints_2d``) is refused once for all of its files.

References
----------
CMU Panoptic Studio toolbox, skeleton output format; OpenPose, output format (demo output);
EasyMocap, output (doc/02_output.md).
"""

from __future__ import annotations

import hashlib
import json
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from besman.exceptions import RecordingError
from besman.foreign.json_text import parse_json
from besman.io.recordings.format import is_keypoints
from besman.io.recordings.keypoint_frames import collect_positions, find_frames, names_for_all
from besman.io.recordings.keypoint_orders import ORDERS
from besman.io.recordings.text_lines import in_usual_text

_Kind = Literal["frame", "picture", "nobody", "cut", "other"]
_FEWEST = 2
# Places of a frame; and files, where the names are of no body's parts.
_FEWEST_PLACES, _MANY = 3, 10
_LARGEST_BYTES = 4_000_000  # a frame; a dozen people with hands and faces have 0.1 MB
_IN_PICTURE = (
    "points in a picture, not in space: give what was triangulated from two cameras or more, for "
    "one a TRC of Pose2Sim"
)
_NAMELESS, _FIRST_OF_BODY = "keypoints3d", 15  # BODY_15 is what BODY_25 begins with
_LOOKED_AT = 1000  # frames in which somebody may be
_PEOPLE = ("people", "bodies")
_RATE = re.compile(r"(\d+)(?:_(\d+))?\Z")  # of hd_29_97


@dataclass(frozen=True)
class FrameFiles:
    """Files of one frame each that belong together.

    Attributes
    ----------
    folder : Path
    pattern : str
        Their names, ``*`` for the number.
    files : tuple of Path
        In the order of their numbers.
    numbers : tuple of int
        Of the frames.
    fault : str
        Why they are no recording; empty if they are one.
    """

    folder: Path
    pattern: str
    files: tuple[Path, ...]
    numbers: tuple[int, ...]
    fault: str = ""

    def describe(self) -> str:
        """Say what they are, and what is wrong with them."""
        return f"{len(self.files)} files of one frame each: {self.fault}"


def find_frame_files(folder: Path, names: Iterable[str] | None = None) -> list[FrameFiles]:
    """Find files of one frame each in a folder.

    Parameters
    ----------
    folder : Path
    names : iterable of str, optional
        Of the folder's files; looked up if not given.

    Returns
    -------
    list of FrameFiles
        Each two files or more, whose first, middle and last hold a frame.
    """
    if names is None:
        names = (one.name for one in folder.iterdir())
    shown = (name for name in names if not name.startswith("."))
    groups = group_numbered(name for name in shown if name.lower().endswith(".json"))
    found = []
    for (before, after), numbered in groups.items():
        numbered.sort()
        files = tuple(folder / name for _, name in numbered)
        kinds = _tell_all(files)
        # One may be damaged: that is said when all are read.
        n_others = kinds.count("other")
        if n_others <= (len(files) >= _MANY) and {"frame", "picture"} & set(kinds):
            numbers = tuple(number for number, _ in numbered)
            fault = "" if "frame" in kinds else _IN_PICTURE
            found.append(FrameFiles(folder, f"{before}*{after}", files, numbers, fault))
    return found


def group_numbered(names: Iterable[str]) -> dict[tuple[str, str], list[tuple[int, str]]]:
    """Put names together that differ in one number: the one in which most differ.

    Parameters
    ----------
    names : iterable of str

    Returns
    -------
    dict
        For what stands before and after the number, the numbers with their names; of two and more.
    """
    parts: dict[str, list[tuple[str, int, str]]] = {}
    for name in names:
        runs = re.finditer(r"[0-9]{1,15}", name)
        parts[name] = [(name[: r.start()], int(r[0]), name[r.end() :]) for r in runs]
    counts = Counter((one[0], one[2]) for places in parts.values() for one in places)
    groups: dict[tuple[str, str], list[tuple[int, str]]] = {}
    for name, places in parts.items():
        if not places:
            continue
        _, at = max((counts[one[0], one[2]], at) for at, one in enumerate(places))
        before, number, after = places[at]
        groups.setdefault((before, after), []).append((number, name))
    return {key: found for key, found in groups.items() if len(found) >= _FEWEST}


def _tell_all(files: Sequence[Path]) -> list[_Kind]:
    """Tell what the first, middle and last file hold; where nobody is in these, what others do."""
    kinds = [_tell(files[at], len(files)) for at in (0, len(files) // 2, -1)]
    if set(kinds) <= {"nobody", "cut"}:
        others = (_tell(file, len(files)) for file in files)
        kinds.append(next((one for one in others if one not in kinds), "nobody"))
    return kinds


def _tell(file: Path, n_files: int) -> _Kind:
    """Tell what a file holds: a frame, one of a picture or without anybody, or something else."""
    try:
        content = _parse(file) if file.stat().st_size <= _LARGEST_BYTES else None
    except (OSError, RecordingError):
        return "cut"
    if isinstance(content, list) and content and _is_nameless(content):
        return "frame"
    content = {"people": []} if content == [] else content
    if not isinstance(content, dict):
        return "other"
    people = _people_of(content)
    if not people and any(content.get(key) == [] for key in _PEOPLE):
        return "nobody"
    if any(person.get(key) for person in people for key in ORDERS):
        return "frame"
    if any(key.endswith("_2d") for person in people for key in person):
        return "picture"
    return "frame" if _has_places(content, n_files) else "other"


def _has_places(content: dict[str, Any], n_files: int) -> bool:
    """Tell whether a frame has places enough, which are of a body, or in many files."""
    n_places = _count_places(content)
    if n_places < _FEWEST_PLACES:
        return False
    return n_files >= _MANY or is_keypoints(json.dumps(content).encode())


def _count_places(content: dict[str, Any]) -> int:
    """Count the places of the one frame that parsed JSON is; 0 if it is something else."""
    nowhere = Path()
    try:
        names, _ = collect_positions([_bare(content)], names_for_all(content), nowhere)
    except RecordingError:
        return 0
    if _people_of(content):
        return len(names)
    try:
        frames, about = find_frames(content, nowhere)
        collect_positions(frames, names_for_all(about), nowhere)
    except RecordingError:
        return len(names)
    return 0


def take_frame_files(folder: Path) -> FrameFiles:
    """Return the one set of files of a frame each that a folder holds.

    Raises
    ------
    RecordingError
        If there is none, or more than one, or it is of points in pictures.
    """
    found = find_frame_files(folder)
    if not found:
        raise RecordingError(
            f"{folder}: a folder, without files of one frame each; expected a recording's file"
        )
    usable = [one for one in found if not one.fault]
    if not usable:
        raise RecordingError(f"{folder / found[0].pattern}: {found[0].describe()}")
    if len(usable) > 1:
        raise RecordingError(
            f"{folder}: {len(usable)} recordings of one frame a file, "
            f"{' and '.join(one.pattern for one in usable[:3])}; expected one in a folder"
        )
    return usable[0]


def parse_frame_files(
    folder: Path,
) -> tuple[list[dict[str, Any]], dict[str, Any], tuple[Path, ...]]:
    """Return frames of a folder, and what its layout says of all of them.

    Parameters
    ----------
    folder : Path

    Returns
    -------
    frames, about
        As of `besman.io.recordings.keypoint_frames.find_frames`; ``frame`` is the number in the
        file's name.
    files : tuple of Path
        Of each frame.

    Raises
    ------
    RecordingError
        If there is no such set of files, or one is no JSON, or no frame.
    """
    series = take_frame_files(folder)
    frames: list[dict[str, Any]] = []
    about: dict[str, Any] = {}
    for file, number in zip(series.files, series.numbers, strict=True):
        content = _parse(file)
        if isinstance(content, list) and _is_nameless(content):
            content = _name(content, file)
        if not isinstance(content, dict):
            raise RecordingError(f"{file}: got {content!r:.60}; expected positions by name")
        if not frames:
            about = content
        frames.append(_bare(content) | {"frame": number})
    if any("joints19" in body for frame in frames[:_LOOKED_AT] for body in _people_of(frame)):
        said = _RATE.search(str(about.get("fpsType", "")))
        rate = {} if said is None else {"fps": float(f"{said[1]}.{said[2] or 0}")}
        about = {"units": "cm", "up": "-y", **rate, **about}
    return frames, about, series.files


def digest_frame_files(folder: Path) -> str:
    """Return the SHA-256 of a recording's files, in the order of its frames."""
    sha = hashlib.sha256()
    for file in take_frame_files(folder).files:
        sha.update(file.read_bytes())
    return sha.hexdigest()


def _is_nameless(content: list[Any]) -> bool:
    """Tell whether a frame is a list of people with keypoints in an order, as EasyMocap writes."""
    return all(isinstance(one, dict) and isinstance(one.get(_NAMELESS), list) for one in content)


def _name(people: list[dict[str, Any]], file: Path) -> dict[str, Any]:
    """Return a frame of a list of people as one of OpenPose's body."""
    key, named = "pose_keypoints_3d", []
    n_names = len(ORDERS[key])
    for person in people:
        points = person[_NAMELESS]
        if len(points) != _FIRST_OF_BODY and len(points) < n_names:
            raise RecordingError(
                f"{file}: {len(points)} keypoints without names; expected {_FIRST_OF_BODY}, or "
                f"{n_names} and more, in the order of BODY_25"
            )
        short = next((one for one in points if not isinstance(one, list) or len(one) != 4), None)
        if short is not None:
            raise RecordingError(f"{file}: a keypoint is {short!r:.60}; expected four numbers")
        points = [*points, *[[0, 0, 0, 0]] * n_names][:n_names]
        told = {name: person[name] for name in ("id",) if name in person}
        named.append(told | {key: [value for point in points for value in point]})
    return {"people": named}


def _people_of(frame: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the people in a frame of a layout that lists them."""
    listed = (frame.get(key) for key in _PEOPLE)
    return [
        one for each in listed if isinstance(each, list) for one in each if isinstance(one, dict)
    ]


def _bare(frame: dict[str, Any]) -> dict[str, Any]:
    """Return a frame without lists of words, which name its keypoints."""
    return {
        key: value
        for key, value in frame.items()
        if not (isinstance(value, list) and value and isinstance(value[0], str))
    }


def _parse(file: Path) -> Any:
    """Parse a file; NaN stands bare in what Python wrote."""
    try:
        text = file.read_bytes()
    except OSError as error:
        raise RecordingError(f"{file}: cannot be read: {error.strerror}") from None
    try:
        return parse_json(in_usual_text(text).removeprefix(b"\xef\xbb\xbf"), allow_nan=True)
    except json.JSONDecodeError as error:
        raise RecordingError(
            f"{file}:{error.lineno}: not valid JSON: {error.msg}; is the file cut?"
        ) from None

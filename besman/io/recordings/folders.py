"""Recordings in folders: files, and folders whose files hold a frame each."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from besman.exceptions import RecordingError
from besman.io.recordings.formats import FORMATS, KNOWN_FORMATS, read_head, recognise

if TYPE_CHECKING:
    from besman.io.recordings.frame_folder import FrameFiles


@dataclass(frozen=True)
class Folder:
    """What a folder holds.

    Attributes
    ----------
    recordings : list of Path
        Files that end like recordings or whose content is one, and folders whose files hold a
        frame each; in natural order, so that run 2 comes before run 10.
    refused : list of FrameFiles
        Files of a frame each that are no recording.
    others : list of Path
        Other files, but those whose name begins with a dot.
    """

    recordings: list[Path]
    refused: list[FrameFiles]
    others: list[Path]


def find_recordings(paths: Iterable[Path]) -> list[Path]:
    """Find recordings in files and folders.

    Parameters
    ----------
    paths : iterable of Path
        Files are taken as they are; in a folder, all files that end like recordings or whose
        content is one. A folder whose files hold a frame each is one recording.

    Returns
    -------
    list of Path
        In the order given; in a folder in natural order. What is met twice is returned once.

    Raises
    ------
    RecordingError
        If a path does not exist or a folder holds no recording.
    """
    found: list[Path] = []
    for path in paths:
        if path.is_dir():
            inside = look_into(path)
            if not inside.recordings:
                raise RecordingError(_describe_lack(path, inside))
            found += inside.recordings
        elif path.is_file():
            found.append(path)
        else:
            raise RecordingError(f"{path}: no such file or folder")
    if not found:
        raise RecordingError("no recordings given; expected at least one file or folder")
    return list(dict.fromkeys(found))


def look_into(folder: Path) -> Folder:
    """Sort what is in a folder.

    Parameters
    ----------
    folder : Path
        An existing one.
    """
    entries = [one for one in folder.iterdir() if not one.name.startswith(".")]
    files = [one for one in entries if one.is_file()]
    places = {folder: _find_frame_files(folder, files)}
    for inner in entries:
        if _may_look_into(inner):
            places[inner] = _find_frame_files(inner, list(inner.iterdir()))
    of_frames = [one for found in places.values() for one in found]
    taken = {file for one in of_frames for file in one.files}
    recordings = [
        # It is called by its name; "." has none.
        place.resolve() if place.name in ("", "..") else place
        for place, found in places.items()
        if any(not one.fault for one in found)
    ]
    others: list[Path] = []
    for file in sorted(set(files) - taken, key=_natural_order):
        (recordings if _is_recording(file) else others).append(file)
    refused = [one for one in of_frames if one.fault]
    return Folder(sorted(recordings, key=_natural_order), refused, others)


def _may_look_into(place: Path) -> bool:
    """Tell whether it is a folder that may be read."""
    return place.is_dir() and os.access(place, os.R_OK | os.X_OK)


def _find_frame_files(folder: Path, files: list[Path]) -> list[FrameFiles]:
    """Find files of a frame each; what tells them is loaded where there may be some."""
    names = [one.name for one in files if one.suffix.lower() == ".json"]
    if len(names) < 2:
        return []
    from besman.io.recordings.frame_folder import find_frame_files

    return find_frame_files(folder, names)


def _describe_lack(folder: Path, inside: Folder) -> str:
    """Say that a folder holds no recording, and what it holds."""
    if inside.refused:
        one = inside.refused[0]
        return f"{one.folder / one.pattern}: {one.describe()}"
    deeper = sorted(one for one in folder.iterdir() if _may_look_into(one))
    places = [str(d) for d in deeper if look_into(d).recordings]
    more = f"; there are some in {', '.join(places)}" if places else ""
    return (
        f"{folder}: no recording in this folder; expected files that are {KNOWN_FORMATS}, or end "
        f"in {', '.join(_own_suffixes())}{more}"
    )


def _is_recording(file: Path) -> bool:
    """Tell whether a file of a folder is meant: a damaged recording must not go unnoticed."""
    return file.suffix.lower() in _own_suffixes() or recognise(read_head(file)) is not None


def _own_suffixes() -> tuple[str, ...]:
    """Return the endings that only recordings have."""
    return tuple(suffix for entry in FORMATS for suffix in entry.own_suffixes)


def _natural_order(path: Path) -> tuple[list[tuple[int, str]], str]:
    """Sort key that compares numbers inside a name by value."""
    parts = re.split(r"(\d+)", path.name.lower())
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts], path.name

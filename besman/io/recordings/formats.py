"""Recording files, whatever their format."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Literal

import numpy as np

from besman.exceptions import RecordingError
from besman.io.recordings.c3d import Units, read_c3d, write_c3d
from besman.io.recordings.exoskeleton import find_log_urdf, read_joint_log
from besman.io.recordings.mvnx import read_mvnx
from besman.io.recordings.qtm_tsv import read_tsv, write_tsv
from besman.records import LabelledRecording, Recording

Format = Literal["tsv", "c3d", "mvnx", "joint log"]

_SUFFIXES = (".tsv", ".c3d", ".mvnx")
_WRITERS = {".tsv": write_tsv, ".c3d": write_c3d}
_HEAD_BYTES = 16_384
# No capture volume is that large, but metres that are millimetres look like it.
_FARTHEST_M = 100.0
_TSV_KEY = re.compile(
    rb"^(FILE_VERSION|NO_OF_[A-Z]+|FREQUENCY|DATA_INCLUDED|MARKER_NAMES)(\t|\r?$)", re.MULTILINE
)
_JOINT_LOG = re.compile(rb"^(#[^\n]*\n)*(# *(urdf|frames) *:|time_s *,)", re.IGNORECASE)
_KNOWN = "Qualisys TSV, C3D, Xsens MVNX or a joint log (CSV with '# urdf' and '# frames')"


def read_recording(path: Path, units: Units | None = None) -> Recording:
    """Read one recording; its content tells the format, whatever the file's ending.

    Parameters
    ----------
    path : Path
        Qualisys TSV, C3D, Xsens MVNX or the joint log of an exoskeleton.
    units : "m" or "mm", optional
        What the coordinates of a C3D file are in, if it does not say so itself.

    Returns
    -------
    Recording
        At least two frames, with times that rise.

    Raises
    ------
    RecordingError
        If the file cannot be used; the message names file and line or frame.
    """
    head = _read_head(path)
    found = _recognise(head)
    if found is None:
        if not head.strip():
            raise RecordingError(f"{path}: the file is empty; expected {_KNOWN}")
        raise RecordingError(f"{path}: a format that is not known; expected {_KNOWN}")
    if found == "c3d":
        recording = read_c3d(path, units)
    else:
        read: dict[str, Callable[[Path], Recording]] = {
            "tsv": read_tsv,
            "mvnx": read_mvnx,
            "joint log": read_joint_log,
        }
        recording = read[found](path)
    if len(recording.time) < 2:
        raise RecordingError(f"{path}: a recording of one frame; expected at least two")
    distances = np.abs(recording.positions[np.isfinite(recording.positions)])
    if distances.size and np.median(distances) > _FARTHEST_M:
        raise RecordingError(
            f"{path}: half of all coordinates are beyond {_FARTHEST_M:g} m (median "
            f"{np.median(distances):.4g} m); are the units of the file right?"
        )
    return recording


def find_companions(path: Path) -> tuple[Path, ...]:
    """Return the files that a recording is read with besides its own.

    Parameters
    ----------
    path : Path
        A recording.

    Returns
    -------
    tuple of Path
        Of a joint log its URDF; nothing of another format.

    Raises
    ------
    RecordingError
        If the file cannot be read, or what it names is not there.
    """
    return (find_log_urdf(path),) if _recognise(_read_head(path)) == "joint log" else ()


def write_recording(recording: Recording | LabelledRecording, path: Path) -> None:
    """Write a recording; the path's ending chooses the format.

    Parameters
    ----------
    recording : Recording or LabelledRecording
        What to write. Gaps are written the way the format defines them.
    path : Path
        ``.tsv`` (Qualisys) or ``.c3d``; replaced if it exists.

    Raises
    ------
    RecordingError
        If the ending is another one, the folder does not exist or the format cannot hold it.
    """
    if isinstance(recording, LabelledRecording):
        recording = Recording(
            time=recording.time,
            positions=recording.positions,
            names=recording.markers,
            rate_hz=recording.rate_hz,
            source=recording.source,
            first_frame=recording.first_frame,
        )
    check_ending(path)
    _WRITERS[path.suffix.lower()](recording, path)


def check_ending(path: Path) -> None:
    """Refuse a file that is to be written in a format that is not written.

    Raises
    ------
    RecordingError
    """
    if path.suffix.lower() not in _WRITERS:
        raise RecordingError(
            f"{path}: cannot be written: the ending must be {' or '.join(_WRITERS)}"
        )


def find_recordings(paths: Iterable[Path]) -> list[Path]:
    """Find recordings in files and folders.

    Parameters
    ----------
    paths : iterable of Path
        Files are taken as they are; in a folder, all files that end like recordings or whose
        content is one.

    Returns
    -------
    list of Path
        In the order given; in a folder in natural order, so that run 2 comes before run 10.
        A file that is met twice is returned once.

    Raises
    ------
    RecordingError
        If a path does not exist or a folder holds no recording.
    """
    found: list[Path] = []
    for path in paths:
        if path.is_dir():
            inside = [file for file in path.iterdir() if _is_recording(file)]
            if not inside:
                raise RecordingError(
                    f"{path}: no recording in this folder; expected files that are {_KNOWN}, "
                    f"or end in {', '.join(_SUFFIXES)}"
                )
            found += sorted(inside, key=_natural_order)
        elif path.is_file():
            found.append(path)
        else:
            raise RecordingError(f"{path}: no such file or folder")
    if not found:
        raise RecordingError("no recordings given; expected at least one file or folder")
    return list(dict.fromkeys(found))


def _is_recording(file: Path) -> bool:
    """Tell whether a file of a folder is meant: a damaged recording must not go unnoticed."""
    if not file.is_file() or file.name.startswith("."):
        return False
    return file.suffix.lower() in _SUFFIXES or _recognise(_read_head(file)) is not None


def _read_head(path: Path) -> bytes:
    """Read the start of a file."""
    try:
        with path.open("rb") as file:
            return file.read(_HEAD_BYTES)
    except FileNotFoundError:
        raise RecordingError(f"{path}: no such file") from None
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from None


def _recognise(head: bytes) -> Format | None:
    """Tell the format from the first bytes of a file."""
    # Text may start with a tab or line end and P, but has no zero bytes.
    if head[1:2] == b"P" and 2 <= head[0] < 32 and (head[0] not in b"\t\n\r" or b"\0" in head):
        return "c3d"
    text = head.removeprefix(b"\xef\xbb\xbf").lstrip()
    if head[:2] in (b"\xff\xfe", b"\xfe\xff"):
        text = head[2:].replace(b"\0", b"")
    if text.startswith(b"<"):
        return "mvnx" if b"mvnx" in text else None
    if _TSV_KEY.search(text):
        return "tsv"
    if _JOINT_LOG.match(text):
        return "joint log"
    return None


def _natural_order(path: Path) -> tuple[list[tuple[int, str]], str]:
    """Sort key that compares numbers inside a name by value."""
    parts = re.split(r"(\d+)", path.name.lower())
    return [(int(part), "") if part.isdigit() else (-1, part) for part in parts], path.name

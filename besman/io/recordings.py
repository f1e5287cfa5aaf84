"""Recording files, whatever their format."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from besman.exceptions import RecordingError
from besman.io.qtm_tsv import read_tsv
from besman.records import Recording

_SUFFIXES = (".tsv",)


def read_recording(path: Path) -> Recording:
    """Read one recording.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    Recording

    Raises
    ------
    RecordingError
        If the file cannot be used; the message names file and line.
    """
    return read_tsv(path)


def find_recordings(paths: Iterable[Path]) -> list[Path]:
    """Find recordings in files and folders.

    Parameters
    ----------
    paths : iterable of Path
        Files are taken as they are; in a folder, all files that end like recordings.

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
            inside = [
                file
                for file in path.iterdir()
                if file.suffix.lower() in _SUFFIXES and file.is_file()
            ]
            if not inside:
                raise RecordingError(
                    f"{path}: no recording in this folder; expected files that end in "
                    f"{', '.join(_SUFFIXES)}"
                )
            found += sorted(inside, key=_natural_order)
        elif path.is_file():
            found.append(path)
        else:
            raise RecordingError(f"{path}: no such file or folder")
    if not found:
        raise RecordingError("no recordings given; expected at least one file or folder")
    return list(dict.fromkeys(found))


def _natural_order(path: Path) -> tuple[list[tuple[int, str]], str]:
    """Sort key that compares numbers inside a name by value."""
    parts = re.split(r"(\d+)", path.name.lower())
    return [(int(part), "") if part.isdigit() else (-1, part) for part in parts], path.name

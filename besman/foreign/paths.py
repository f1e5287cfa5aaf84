"""Paths from files: any text may stand where a path should."""

from __future__ import annotations

from pathlib import Path


def is_file(path: Path) -> bool:
    """Tell whether there is a file, also of a text that no path can be."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def is_folder(path: Path) -> bool:
    """Tell whether there is a folder, also of a text that no path can be."""
    try:
        return path.is_dir()
    except (OSError, ValueError):
        return False


def file_alike(file: Path) -> Path | None:
    """Return the one file of the same name but for capitals, beside where one is missing.

    Other systems do not tell capitals apart. A link that leads elsewhere is not taken.
    """
    if not is_folder(file.parent):
        return None
    found = [one for one in file.parent.iterdir() if one.name.lower() == file.name.lower()]
    if len(found) != 1 or found[0].resolve().parent != file.parent.resolve():
        return None
    return found[0] if is_file(found[0]) else None

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

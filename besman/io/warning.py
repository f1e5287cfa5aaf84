"""Warnings about files, said of the line that has them read."""

from __future__ import annotations

import sys
import warnings

from besman.exceptions import RecordingWarning

_HERE = f"{__package__}."


def warn_of_file(message: str) -> None:
    """Say what was concluded of a file, of the line from which `besman.io` was called.

    Parameters
    ----------
    message : str
        What, where, and what is done.
    """
    frame, level = sys._getframe(), 1
    while frame.f_back is not None and frame.f_globals.get("__name__", "").startswith(_HERE):
        frame, level = frame.f_back, level + 1
    warnings.warn(message, RecordingWarning, stacklevel=level)

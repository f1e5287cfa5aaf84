"""Who works in a run folder: one process at a time."""

from __future__ import annotations

import fcntl
from pathlib import Path
from typing import IO

from besman.exceptions import RunError

_NAME = ".lock"


def take_lock(folder: Path) -> IO[str]:
    """Take a run folder for this process; the system lets go of it if the process dies.

    Returns
    -------
    file
        Close it to let go of the folder.

    Raises
    ------
    RunError
        If another process has it, or nothing may be written there.
    """
    path = folder / _NAME
    try:
        file = path.open("w", encoding="ascii")
    except IsADirectoryError:
        raise RunError(f"{path}: is a folder; expected a file: remove the folder") from None
    except OSError as error:
        raise RunError(f"{path}: cannot be written: {error.strerror}") from None
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        file.close()
        raise RunError(f"{folder}: another besman is working here; wait or use --out") from None
    return file


def is_locked(folder: Path) -> bool:
    """Tell whether a process is working in a run folder."""
    path = folder / _NAME
    try:
        with path.open(encoding="ascii") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        # There is no lock, or none that could be held.
        return False
    return False

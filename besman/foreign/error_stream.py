"""What libraries write to the error stream of the process in place of raising it."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager

_STREAM = 2


@contextmanager
def catch_error_stream() -> Iterator[list[str]]:
    """Keep what is written to the process' error stream, also by libraries that are not Python.

    Yields
    ------
    list of str
        Empty; the lines are in it at the end, whether or not an error is raised meanwhile. None of
        a process that was started without an error stream.
    """
    lines: list[str] = []
    if sys.stderr is None:
        yield lines
        return
    sys.stderr.flush()
    kept = os.dup(_STREAM)
    with tempfile.TemporaryFile() as file:
        os.dup2(file.fileno(), _STREAM)
        try:
            yield lines
        finally:
            os.dup2(kept, _STREAM)
            os.close(kept)
            file.seek(0)
            lines += file.read().decode("utf-8", "replace").splitlines()

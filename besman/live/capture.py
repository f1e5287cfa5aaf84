"""A stream on the disk while it comes: a Qualisys TSV that is whole at any time."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from besman.exceptions import FileError
from besman.records import FloatArray

_COUNT = "NO_OF_FRAMES\t"
_DIGITS = 10
# Whoever is ended in the middle loses no more than these seconds.
_EVERY_S = 1.0


class WholeLines:
    """A new file to which lines are appended: all of what is given or nothing of it.

    Parameters
    ----------
    path : Path
        It is not there.

    Raises
    ------
    FileError
        If it is, or cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._end = 0
        try:
            # Never what was there: a session cannot be captured again.
            self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
        except FileExistsError:
            raise FileError(f"--record: {path}: is there already; expected a new name") from None
        except OSError as error:
            raise FileError(f"--record: {path}: cannot be written: {error.strerror}") from None

    def append(self, text: str) -> None:
        """Write lines at the end.

        Raises
        ------
        FileError
            If the disk is full, or gone; what was written until then is whole.
        """
        data, done = text.encode(), 0
        try:
            while done < len(data):
                done += os.pwrite(self._file, data[done:], self._end + done)
        except OSError as error:
            os.ftruncate(self._file, self._end)
            raise FileError(
                f"--record: {self.path}: cannot be written: {error.strerror}; what was recorded "
                "until then is whole"
            ) from None
        self._end += len(data)

    def replace(self, text: str, at: int) -> None:
        """Write over what stands at a place, as many bytes."""
        os.pwrite(self._file, text.encode(), at)

    def close(self) -> None:
        """Let the file go."""
        os.close(self._file)


class CaptureFile:
    """Takes frames; the file can be read as a recording whenever that is looked at.

    Rows are appended whole, a second at a time, and counted in the header after that. Where the
    disk is full the file is cut back to its last whole row.

    Parameters
    ----------
    path : Path
        It ends in ``.tsv``, and is not there.
    names : sequence of str or None, length M
    rate_hz : float

    Raises
    ------
    FileError
        If it ends otherwise, is there, or cannot be written.
    """

    def __init__(self, path: Path, names: Sequence[str | None], rate_hz: float) -> None:
        if path.suffix != ".tsv":
            raise FileError(f"--record: {path}: expected a name that ends in .tsv")
        self.path = path
        self.n_frames = 0
        self._rate_hz = rate_hz
        self._rows: list[FloatArray] = []
        self._line = "\t".join(["%d", "%.5f"] + ["%.3f"] * (3 * len(names))) + "\n"
        columns = [f"{name or ''} {axis}" for name in names for axis in "XYZ"]
        lines = [
            f"{_COUNT}{0:0{_DIGITS}d}",
            "NO_OF_CAMERAS\t0",
            f"NO_OF_MARKERS\t{len(names)}",
            f"FREQUENCY\t{rate_hz:.12g}",
            "NO_OF_ANALOG\t0",
            "ANALOG_FREQUENCY\t0",
            "DESCRIPTION\t--",
            "DATA_INCLUDED\t3D",
            "\t".join(["MARKER_NAMES", *(name or "" for name in names)]),
            "\t".join(["Frame", "Time", *columns, ""]),
        ]
        self._file = WholeLines(path)
        self._file.append("\n".join(lines) + "\n")

    def add(self, positions: FloatArray) -> None:
        """Take a frame, shape (M, 3), metres; NaN where a marker was not seen.

        Raises
        ------
        FileError
            If the disk is full, or gone; what was written until then is whole.
        """
        self._rows.append(positions)
        if len(self._rows) >= _EVERY_S * self._rate_hz:
            self.flush()

    def flush(self) -> None:
        """Write what was taken.

        Raises
        ------
        FileError
            As `add`.
        """
        if not self._rows:
            return
        first = self.n_frames + 1
        numbers = np.arange(first, first + len(self._rows))
        values = np.round(np.array(self._rows).reshape(len(numbers), -1) * 1000.0, 3) + 0.0
        block = np.column_stack([numbers, (numbers - 1) / self._rate_hz, values])
        text = self._line * len(block) % tuple(block.ravel().tolist())
        self._rows = []
        self._file.append(text)
        self.n_frames += len(numbers)
        self._file.replace(f"{self.n_frames:0{_DIGITS}d}", len(_COUNT))

    def close(self) -> None:
        """Write what was taken, and end.

        Raises
        ------
        FileError
            As `add`.
        """
        try:
            self.flush()
        finally:
            self._file.close()

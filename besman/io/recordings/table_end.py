"""The end of a table: an empty line, below which no further row stands."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from besman.exceptions import RecordingError
from besman.io.recordings.number_cells import is_number_cell

_LINES_LOOKED_AT = 20


def find_end(
    body: Sequence[bytes],
    lines: Sequence[str],
    first: int,
    split: Callable[[str], list[str]],
    path: Path,
) -> int:
    """Find the empty line that ends a table, and refuse one that goes on below it.

    Half of a recording would be lost in silence.

    Parameters
    ----------
    body : sequence of bytes
        Some lines of the table, cells between tabs.
    lines : sequence of str
        Of the whole file.
    first : int
        Index of the first line of the body among them.
    split : callable
        Cuts a line of the file into its cells.
    path : Path
        Named in the error.

    Returns
    -------
    int
        Index in the body; its length if no line is empty.

    Raises
    ------
    RecordingError
        If the next line that is not empty begins with a number, as no title of a table does.
    """
    end = next((at for at, line in enumerate(body) if not line.strip(b"\t ")), len(body))
    at = first + end
    below = lines[at : at + _LINES_LOOKED_AT] if end < len(body) else ()
    for number, line in enumerate(below):
        cells = split(line)
        if any(cells):
            if len(cells) > 1 and is_number_cell(cells[0]):
                raise RecordingError(
                    f"{path}:{at + 1}: an empty line among the rows, which go on in line "
                    f"{at + number + 1}; expected rows one below the other"
                )
            break
    return end

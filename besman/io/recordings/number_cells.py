"""Numbers out of text, the quick ways, where all cells are plain."""

from __future__ import annotations

import re
import sys
from importlib import import_module

import numpy as np
import numpy.typing as npt

from besman.foreign.numbers import parse_number

FloatArray = npt.NDArray[np.float64]

# Of anything else NumPy's and Python's opinions differ.
_NOT_THERE = re.compile(rb"\bNA\b")
_PLAIN = b"0123456789.+-eE\t\nnaulNAUL"

# Bytes of text from which on half a second and 120 MB are well spent on loading what was compiled,
# up to there it saves 0.3 s at most; and from which on the rest of it is where something else has
# loaded Numba.
_WORTH_NUMBA = 2**27
_WORTH_KERNEL = 2**24
_KERNEL = "besman.io.recordings.number_kernel"


class _Work:
    """How many bytes this process has read without the kernel."""

    n_bytes = 0


def prepare(n_bytes: int) -> None:
    """Load the kernel if so much text, with what this process has read before, is worth it."""
    if _KERNEL not in sys.modules:
        _Work.n_bytes += n_bytes
        if _Work.n_bytes >= (_WORTH_KERNEL if "numba" in sys.modules else _WORTH_NUMBA):
            import_module(_KERNEL)


def parse_table(
    text: bytes, n_rows: int, n_columns: int, separator: bytes, point: bytes, is_strict: bool
) -> FloatArray | None:
    """Parse lines of plain cells; the values are those of Python's ``float``.

    Parameters
    ----------
    text : bytes
        Without a line end after the last line.
    n_rows, n_columns : int
    separator, point : bytes
        What stands between cells and in numbers.
    is_strict : bool
        Whether each line has as many cells as there are columns, or one more that is empty. Else
        empty ones may come and go at its end.

    Returns
    -------
    array, shape (n_rows, n_columns), or None
        NaN for ``nan``, ``null``, ``NA`` and empty cells. None where a line has other cells or
        nothing in them, a cell is anything else than a plain number or one of these, or if the
        kernel is not loaded (`prepare`).
    """
    if _KERNEL not in sys.modules:
        return None
    from besman.io.recordings.number_kernel import read_table

    codes = np.frombuffer(text + b"\n", np.uint8)
    values = np.empty((n_rows, n_columns))
    n_read = read_table(codes, separator[0], point[0], is_strict, values)
    return values if n_read == n_rows else None


def parse_cells(text: bytes, n_cells: int) -> FloatArray | None:
    """Parse cells separated by tabs and line ends; the values are those of Python's ``float``.

    NumPy reads numbers wherever they stand, also two in one cell. But every cell gives at least
    one, or ends the reading: where there are as many numbers as cells, each cell is one.

    Parameters
    ----------
    text : bytes
        Lines of two cells or more, without a line end after the last.
    n_cells : int
        How many cells there are.

    Returns
    -------
    array, shape (n_cells,), or None
        NaN for ``nan``, ``null``, ``NA`` and empty cells; None where a cell is anything else than a
        plain, finite number or one of these.
    """
    if text.translate(None, _PLAIN):
        return None
    if b"NA" in text:
        text = _NOT_THERE.sub(b"nan", text)
    if b"l" in text or b"L" in text:
        text = text.lower().replace(b"null", b"nan")
    values = np.empty(0) if b"\t\t" in text else _read_all(text)
    if len(values) != n_cells:
        # Of two empty cells side by side the first round finds one.
        text = text.replace(b"\t\t", b"\tnan\t").replace(b"\t\t", b"\tnan\t")
        text = text.replace(b"\t\n", b"\tnan\n")
        # Most lines begin with a number.
        text = text.replace(b"\n\t", b"\nnan\t") if b"\n\t" in text else text
        text = (b"nan" if text[:1] == b"\t" else b"") + text
        text += b"nan" if text[-1:] == b"\t" else b""
        values = _read_all(text)
    return values if len(values) == n_cells and not np.isinf(values).any() else None


def _read_all(text: bytes) -> FloatArray:
    """Read numbers up to what is none."""
    try:
        return np.fromstring(text, sep=" ")
    except (ValueError, DeprecationWarning):
        return np.empty(0)


def is_number_cell(cell: str) -> bool:
    """Tell whether a cell is a number, with a point or a comma."""
    try:
        parse_number(cell.replace(",", "."))
    except ValueError:
        return False
    return True

"""Numbers out of text, the quick way, where all cells are plain."""

from __future__ import annotations

import re

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

# Of anything else NumPy's and Python's opinions differ.
_NOT_THERE = re.compile(rb"\bNA\b")
_PLAIN = b"0123456789.+-eE\t\nnaulNAUL"


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

"""Numbers out of text, compiled: for recordings of an hour, where Python's own way takes long."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

_TAB, _LINE_END, _BLANK, _POINT, _MINUS, _PLUS = (ord(c) for c in "\t\n .-+")
_ZERO, _NINE = ord("0"), ord("9")
_N, _A, _U, _L = (ord(c) for c in "naul")
_TO_LOWER = 32
# Both are exact as doubles, so that their quotient is rounded once, as Python's float is.
_LARGEST_EXACT = 2**53
_POWERS: npt.NDArray[np.float64] = np.array([float(f"1e{k}") for k in range(23)])


@njit(cache=True, nogil=True)
def parse_cells(
    text: npt.NDArray[np.uint8], powers: npt.NDArray[np.float64], values: npt.NDArray[np.float64]
) -> int:  # pragma: no cover
    """Parse cells separated by tabs and line ends.

    In one piece: with its loops in functions of their own it is slower.

    Parameters
    ----------
    text : uint8 array
        Bytes.
    powers : array, shape (23,)
        Powers of ten.
    values : array, shape (N,)
        Filled; NaN for ``nan``, ``null`` and empty cells.

    Returns
    -------
    int
        How many cells there were; -1 where one is not plain digits, sign and point, or has more
        digits than a double holds exactly.
    """
    at, n, count = 0, len(text), 0
    while at <= n:
        if count == len(values):
            return -1
        while at < n and text[at] == _BLANK:
            at += 1
        signed = at < n and (text[at] == _MINUS or text[at] == _PLUS)
        negative = signed and text[at] == _MINUS
        at += 1 if signed else 0
        mantissa, digits, after = 0, 0, -1
        while at < n:
            byte = text[at]
            if _ZERO <= byte <= _NINE:
                mantissa = 10 * mantissa + (byte - _ZERO)
                digits += 1
                if mantissa > _LARGEST_EXACT:
                    return -1
            elif byte == _POINT and after < 0:
                after = digits
            else:
                break
            at += 1
        places = digits - after if after >= 0 else 0
        if digits > 0 and places < len(powers):
            value = mantissa / powers[places]
            values[count] = -value if negative else value
        elif digits > 0 or after >= 0 or signed:
            return -1
        else:
            length = _skip_word(text, at)
            if length < 0:
                return -1
            at += length
            values[count] = np.nan
        while at < n and text[at] == _BLANK:
            at += 1
        if at < n and text[at] != _TAB and text[at] != _LINE_END:
            return -1
        count += 1
        at += 1
    return count


@njit(cache=True, nogil=True)
def _skip_word(text: npt.NDArray[np.uint8], at: int) -> int:  # pragma: no cover
    """Return the length of ``nan`` or ``null`` at a place, 0 of nothing, -1 of anything else."""
    n = len(text)
    if at == n or text[at] == _TAB or text[at] == _LINE_END or text[at] == _BLANK:
        return 0
    word = (_N, _A, _N, 0)
    length = 3
    if at + 1 < n and (text[at + 1] | _TO_LOWER) == _U:
        word, length = (_N, _U, _L, _L), 4
    if at + length > n:
        return -1
    for k in range(length):
        if (text[at + k] | _TO_LOWER) != word[k]:
            return -1
    return length


def parse_numbers(text: str, n_cells: int) -> npt.NDArray[np.float64] | None:
    """Parse cells separated by tabs and line ends; the values are those of Python's ``float``.

    Parameters
    ----------
    text : str
    n_cells : int
        How many are expected.

    Returns
    -------
    array, shape (n_cells,), or None
        None where a cell is no plain number, or there are more or fewer.
    """
    values = np.empty(n_cells)
    found = parse_cells(np.frombuffer(text.encode(), dtype=np.uint8), _POWERS, values)
    return values if found == n_cells else None

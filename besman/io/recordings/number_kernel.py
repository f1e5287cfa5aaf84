"""Tables of plain numbers, compiled: cells to the last bit as Python's ``float`` reads them.

What is not plain is left to `besman.io.recordings.number_cells` and to Python, which know the
words of programs and what to say of a cell that is no number.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

FloatArray = npt.NDArray[np.float64]
ByteArray = npt.NDArray[np.uint8]

# Doubles hold these powers exactly, and whole numbers up to the limit: of two exact numbers a
# quotient or product is the double nearest to the true one (Clinger 1990, fast path).
_POWERS = 10.0 ** np.arange(23)
_MOST_EXACT = 2**53
_MOST_DIGITS = 18
_NEWLINE, _BLANK, _MINUS, _PLUS = ord("\n"), ord(" "), ord("-"), ord("+")
_LETTER_E, _LETTER_A, _LETTER_L = ord("e"), ord("a"), ord("l")
_LETTER_N, _LETTER_U, _SMALL = ord("n"), ord("u"), 0x20
# What a cell is.
_EMPTY, _TOLD, _ODD = 0, 1, 2


@njit(cache=True, nogil=True)
def read_table(
    text: ByteArray, separator: int, point: int, is_strict: bool, values: FloatArray
) -> int:  # pragma: no cover
    """Read lines of cells.

    Parameters
    ----------
    text : uint8 array
        Whole lines, a line end after the last.
    separator, point : int
        The bytes between cells and in numbers.
    is_strict : bool
        Whether each line has as many cells as there are columns, or one more that is empty. Else
        empty ones may come and go at its end.
    values : array, shape (T, C)
        Written: NaN for ``nan``, ``null``, ``NA`` and empty cells.

    Returns
    -------
    int
        How many lines were read before the first that is not plain: that has other cells, or
        nothing at all in them; T if there is none.
    """
    n_rows, n_columns = len(values), values.shape[1]
    at, end = 0, len(text)
    for row in range(n_rows):
        column, n_told = 0, 0
        while True:
            if at >= end:
                return row
            at, value, kind = _read_cell(text, at, separator, point)
            if column < n_columns:
                values[row, column] = value
                n_told += kind
            elif kind != _EMPTY:
                return row
            column += 1
            if text[at] == _NEWLINE:
                break
            if kind == _ODD or text[at] != separator:
                return row
            at += 1
        at += 1
        if kind == _ODD or n_told == 0:
            return row
        if is_strict and not n_columns <= column <= n_columns + 1:
            return row
        while column < n_columns:
            values[row, column] = np.nan
            column += 1
    return n_rows


@njit(cache=True, nogil=True, inline="always")
def _read_cell(
    text: ByteArray, at: int, separator: int, point: int
) -> tuple[int, float, int]:  # pragma: no cover
    """Return where a cell ends, its value, and what it is; a line end comes behind it."""
    while text[at] == _BLANK:
        at += 1
    code = text[at]
    if code in (separator, _NEWLINE):
        return at, np.nan, _EMPTY
    first, is_negative = at, code == _MINUS
    if is_negative or code == _PLUS:
        at += 1
    number: Any = 0
    begin = at
    digit: Any = np.int64(text[at]) - 48
    while 0 <= digit <= 9:
        number = number * 10 + digit
        at += 1
        digit = np.int64(text[at]) - 48
    n_digits, power = at - begin, 0
    if digit + 48 == point:
        at += 1
        begin = at
        digit = np.int64(text[at]) - 48
        while 0 <= digit <= 9:
            number = number * 10 + digit
            at += 1
            digit = np.int64(text[at]) - 48
        power = begin - at
        n_digits -= power
    if n_digits == 0:
        at = _skip_word(text, first)
        return at, np.nan, _TOLD if at > first else _ODD
    if (digit + 48) | _SMALL == _LETTER_E:
        at, exponent = _read_exponent(text, at + 1)
        power += exponent
    while text[at] == _BLANK:
        at += 1
    # What has more digits has overflown.
    if n_digits > _MOST_DIGITS or number > _MOST_EXACT or not -22 <= power <= 22:
        return at, np.nan, _ODD
    value = number / _POWERS[-power] if power < 0 else number * _POWERS[power]
    return at, -value if is_negative else value, _TOLD


@njit(cache=True, nogil=True)
def _read_exponent(text: ByteArray, at: int) -> tuple[int, int]:  # pragma: no cover
    """Return where an exponent ends, and its value: out of all bounds if it is none."""
    is_negative = text[at] == _MINUS
    if is_negative or text[at] == _PLUS:
        at += 1
    first = at
    value: Any = 0
    while 48 <= text[at] <= 57 and at - first < 4:
        value = value * 10 + np.int64(text[at]) - 48
        at += 1
    if at == first:
        return at, 9999
    return at, -value if is_negative else value


@njit(cache=True, nogil=True)
def _skip_word(text: ByteArray, at: int) -> int:  # pragma: no cover
    """Return where a word ends that stands for a number that is not there; `at` if it is none."""
    first = at
    if text[at] | _SMALL != _LETTER_N:
        return first
    # No line end is a letter, so that nothing is read beyond the last.
    if text[at + 1] | _SMALL == _LETTER_A:
        at += 3 if text[at + 2] | _SMALL == _LETTER_N else 2
    elif (
        text[at + 1] | _SMALL == _LETTER_U
        and text[at + 2] | _SMALL == _LETTER_L
        and text[at + 3] | _SMALL == _LETTER_L
    ):
        at += 4
    else:
        return first
    while text[at] == _BLANK:
        at += 1
    return at

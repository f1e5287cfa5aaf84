"""Many messages of one kind at once: one is written by its library, the others differ in numbers.

A message is made with blanks in place of the numbers that change; where they stand in its bytes is
found by their values. Filling them for all messages is one copy of arrays, in place of writing
every message by itself.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

# Far beyond anything measured, no two alike in their bytes: floats of 64, integers of 32 bits.
_REAL, _REAL_STEP = -1.2345678901234e300, 1.1e290
_WHOLE = 0x6B3A0000


class Blanks:
    """Stands for the numbers that change from message to message.

    Parameters
    ----------
    n_messages : int
        Length of every column.
    """

    def __init__(self, n_messages: int) -> None:
        self._n = n_messages
        self._columns: list[tuple[bytes, npt.NDArray[Any]]] = []

    def real(self, column: npt.ArrayLike) -> float:
        """Take the values, shape (n,), of a ``float64``; return what stands for them."""
        value = _REAL - len(self._columns) * _REAL_STEP
        self._add(struct.pack("<d", value), np.asarray(column, "<f8"))
        return value

    def whole(self, column: npt.ArrayLike) -> int:
        """Take the values, shape (n,), of an ``int32``, ``uint32``; return what stands for them."""
        value = _WHOLE + len(self._columns)
        self._add(struct.pack("<i", value), np.asarray(column, "<i4"))
        return value

    def _add(self, mark: bytes, column: npt.NDArray[Any]) -> None:
        self._columns.append((mark, np.broadcast_to(column, (self._n,))))

    def fill(self, write: Callable[[], bytes]) -> list[bytes]:
        """Return the messages.

        Parameters
        ----------
        write : callable
            Gives the bytes of the message with the blanks, little endian.

        Raises
        ------
        ValueError
            If a blank does not stand in it once.
        """
        template = write()
        rows = np.tile(np.frombuffer(template, np.uint8), (self._n, 1))
        for mark, column in self._columns:
            if template.count(mark) != 1:
                raise ValueError(f"a blank stands {template.count(mark)} times in a message")
            at = template.index(mark)
            as_bytes = np.ascontiguousarray(column).view(np.uint8).reshape(self._n, len(mark))
            rows[:, at : at + len(mark)] = as_bytes
        return [row.tobytes() for row in rows]

"""What a page is given to draw: JSON and arrays of small integers, compressed."""

from __future__ import annotations

import gzip
import json
from typing import Any

import numpy as np
import numpy.typing as npt

_GREATEST = 32766
_NOT_SEEN = -32768
_COMPRESSION = 9


class Packer:
    """Collects arrays, and packs them with the JSON that refers to them.

    The bundle is gzip of: the length of the JSON (uint32), the JSON (UTF-8, padded with spaces to
    a multiple of four bytes), the arrays (int16, little endian). Along their first axis arrays are
    differences, which compress well; sums wrap around.
    """

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._length = 0

    def add(self, values: npt.ArrayLike) -> dict[str, Any]:
        """Add an array of numbers, rounded to 1 / 32766 of the greatest of them.

        Parameters
        ----------
        values : array, shape (F, ...)
            NaN means not seen.

        Returns
        -------
        dict
            What the JSON says of it: ``at`` (first number), ``shape`` and ``step`` (what one unit
            is worth).
        """
        array = np.asarray(values, dtype=np.float64)
        finite = np.isfinite(array)
        greatest = float(np.abs(array[finite]).max(initial=0.0))
        step = greatest / _GREATEST or 1.0
        rounded = np.where(finite, np.rint(np.where(finite, array, 0.0) / step), _NOT_SEEN)
        return self._put(rounded.astype(np.int64), array.shape) | {"step": step}

    def add_indices(self, values: npt.ArrayLike) -> dict[str, Any]:
        """Add an array of integers from 0 to 65535; what the JSON says has no ``step``."""
        array = np.asarray(values, dtype=np.int64)
        return self._put(array, array.shape)

    def _put(self, values: npt.NDArray[np.int64], shape: tuple[int, ...]) -> dict[str, Any]:
        if values.size:
            values = np.diff(values, axis=0, prepend=np.zeros((1, *shape[1:]), np.int64))
        self._parts.append(values.astype(np.uint16).astype("<u2").tobytes())
        found = {"at": self._length, "shape": list(shape)}
        self._length += values.size
        return found

    def bundle(self, content: Any) -> bytes:
        """Return everything packed; the same content gives the same bytes."""
        text = json.dumps(content, allow_nan=False, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        whole = len(text).to_bytes(4, "little") + text + b"".join(self._parts)
        return gzip.compress(whole, _COMPRESSION, mtime=0)

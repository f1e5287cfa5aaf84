"""Arrays in a ``.npz``: nothing is allocated because a file says how large it is.

NumPy's reader makes an array of the size that the header names before it reads, and a few bytes can
name terabytes.
"""

from __future__ import annotations

import io
import math
import tokenize
import zipfile
import zlib
from functools import lru_cache
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import numpy.typing as npt

ERRORS = (
    OSError,
    ValueError,
    KeyError,
    TypeError,
    EOFError,
    OverflowError,
    NotImplementedError,
    RuntimeError,
    # NumPy reads headers of arrays by Python's tokens.
    tokenize.TokenError,
    zipfile.BadZipFile,
    zlib.error,
)
"""What reading an archive that is damaged or made up can raise."""


# Of each version of the format: bytes that tell a header's length, and what reads both.
_HEADERS = {
    (1, 0): (2, np.lib.format.read_array_header_1_0),
    (2, 0): (4, np.lib.format.read_array_header_2_0),
}
_LONGEST_HEADER = 10_000


@lru_cache(maxsize=256)
def _parse_header(version: tuple[int, int], header: bytes) -> tuple[Any, bool, np.dtype[Any]]:
    """Return shape, order and type that a header tells: a file has few that differ, and many."""
    shape, fortran_order, dtype = _HEADERS[version][1](io.BytesIO(header))
    return shape, fortran_order, dtype


class Arrays:
    """The arrays of a ``.npz`` by name, read when asked for; a context manager.

    Parameters
    ----------
    path : Path
    most_bytes : int, optional
        Refuse a file whose arrays are larger together; None: as large as they are.

    Raises
    ------
    ValueError
        If it is larger; a damaged file gives one of `ERRORS`, here and when an array is read.
    """

    def __init__(self, path: Path, most_bytes: int | None = None) -> None:
        self._archive = zipfile.ZipFile(path)
        size = sum(member.file_size for member in self._archive.infolist())
        if most_bytes is not None and size > most_bytes:
            self._archive.close()
            raise ValueError(f"{size / 1e6:.0f} MB, expected at most {most_bytes / 1e6:g}")

    def __enter__(self) -> Arrays:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._archive.close()

    def __getitem__(self, name: str) -> npt.NDArray[Any]:
        if not isinstance(name, str):
            raise ValueError(f"an array named {name!r:.40}; expected text")
        # A name that no member has is a KeyError.
        member = self._archive.getinfo(f"{name}.npy")
        with self._archive.open(member) as file:
            version = np.lib.format.read_magic(file)
            if version not in _HEADERS:
                raise ValueError(f"array {name}: version {version} is not known")
            length = file.read(_HEADERS[version][0])
            size = int.from_bytes(length, "little")
            if size > _LONGEST_HEADER:
                raise ValueError(f"array {name}: header of {size} bytes")
            shape, fortran_order, dtype = _parse_header(version, length + file.read(size))
            if dtype.hasobject:
                raise ValueError(f"array {name}: holds Python objects")
            size = math.prod(shape) * dtype.itemsize
            if min(shape, default=0) < 0 or size > member.file_size:
                raise ValueError(f"array {name}: shape {shape} is larger than the file")
            data = file.read(size)
            if len(data) != size or file.read(1):
                raise ValueError(f"array {name}: is not as long as its shape {shape}")
        array = np.frombuffer(data, dtype=dtype)
        return array.reshape(shape, order="F" if fortran_order else "C")

"""Lines of a text file, decoded when they are asked for: an hour of a recording has 100 MB."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import overload

from besman.exceptions import RecordingError

_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
# Bytes that are read together.
_AT_ONCE = 2**22


class TextLines(Sequence[str]):
    """Lines without line ends; blank ones at the end are left out.

    They are not kept: what needs them reads the file once more, of which the system has a copy.

    Parameters
    ----------
    read : callable
        Return the bytes piece by piece, every time it is called. They are UTF-8, or else Latin-1:
        older exports are written in the code page of the recording computer. Lines end with a line
        feed, with or without a carriage return.

    Attributes
    ----------
    is_ended : bool
        Whether the last line ends with a line end.
    is_blank : bool
        Whether there is nothing but blanks.
    """

    def __init__(self, read: Callable[[], Iterable[bytes]]) -> None:
        self._read = read
        self.is_ended, self.is_blank, is_utf8 = False, True, True
        self._n_lines, self._is_whole = 1, True
        n_before = 0
        for part in _cut_at_line_ends(read()):
            self.is_ended = not part
            is_utf8 = is_utf8 and _is_utf8(part)
            self.is_blank = self.is_blank and not part.strip()
            # Tabs at the end of the last line may be gaps, so only blanks and line ends go.
            kept = part.rstrip(b" \n")
            if kept:
                self._n_lines = n_before + kept.count(b"\n") + 1
            n_before += part.count(b"\n") + 1
        self._encoding = "utf-8" if is_utf8 else "latin-1"

    @classmethod
    def of(cls, path: Path) -> TextLines:
        """Return the lines of a file."""
        return cls(lambda: _read(path))

    def __len__(self) -> int:
        return self._n_lines

    def __iter__(self) -> Iterator[str]:
        for part in self.blocks(0):
            yield from self.decode(part).split("\n")

    @overload
    def __getitem__(self, index: int) -> str: ...

    @overload
    def __getitem__(self, index: slice) -> list[str]: ...

    def __getitem__(self, index: int | slice) -> str | list[str]:
        if isinstance(index, slice):
            return list(islice(self, *index.indices(len(self))))
        first = index if index >= 0 else len(self) + index
        found = list(islice(self, first, first + 1)) if first >= 0 else []
        if not found:
            raise IndexError(f"no line {index}")
        return found[0]

    def last(self, count: int) -> list[str]:
        """Return the last lines, the very last one at the end."""
        blocks = list(self.blocks(max(0, len(self) - count)))
        return self.decode(b"\n".join(blocks)).split("\n")

    def drop_last(self) -> None:
        """Leave out the last line."""
        self._n_lines -= 1
        self._is_whole = False

    def blocks(self, first: int) -> Iterator[bytes]:
        """Yield the lines from one on, many at a time, without the line end of the last."""
        n_before = 0
        for part in _cut_at_line_ends(self._read()):
            if n_before >= self._n_lines:
                return
            if n_before == 0 and self._encoding == "utf-8":
                part = part.removeprefix(_BYTE_ORDER_MARK)
            n_lines = part.count(b"\n") + 1
            if n_before + n_lines >= self._n_lines:
                n_lines = self._n_lines - n_before
                part = b"\n".join(part.split(b"\n")[:n_lines])
                part = part.rstrip(b" ") if self._is_whole else part
            if first < n_before + n_lines:
                skip = first - n_before
                yield part.split(b"\n", skip)[-1] if skip > 0 else part
            n_before += n_lines

    def decode(self, text: bytes) -> str:
        """Decode a part of the file."""
        return text.decode(self._encoding)


def open_lines(path: Path, expected: str) -> TextLines:
    """Return the lines of a recording that is text.

    Parameters
    ----------
    path : Path
    expected : str
        Such as ``a TRC recording``, for messages.

    Raises
    ------
    RecordingError
        If the file is missing, cannot be read or is empty.
    """
    try:
        lines = TextLines.of(path)
    except FileNotFoundError:
        raise RecordingError(f"{path}: no such file") from None
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from None
    if lines.is_blank:
        raise RecordingError(f"{path}: the file is empty; expected {expected}")
    return lines


def _read(path: Path) -> Iterator[bytes]:
    """Read a file piece by piece."""
    with path.open("rb") as file:
        yield from iter(lambda: file.read(_AT_ONCE), b"")


def _cut_at_line_ends(content: Iterable[bytes]) -> Iterator[bytes]:
    """Yield pieces of whole lines, the last one without a line end; it may be empty."""
    begun: list[bytes] = []
    for piece in content:
        lines, line_end, rest = piece.rpartition(b"\n")
        if line_end:
            lines = b"".join([*begun, lines])
            if b"\r" in lines:
                lines = (lines + line_end).replace(b"\r\n", b"\n")[:-1]
            yield lines
            begun = []
        begun.append(rest)
    yield b"".join(begun)


def _is_utf8(text: bytes) -> bool:
    """Tell whether bytes are UTF-8."""
    if text.isascii():
        return True
    try:
        text.decode("utf-8")
    except UnicodeDecodeError:
        return False
    return True

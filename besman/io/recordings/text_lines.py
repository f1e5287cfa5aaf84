"""Lines of a text file, decoded when they are asked for: an hour of a recording has 100 MB."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import overload

import numpy as np

from besman.exceptions import RecordingError

_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_UTF16_MARKS = (b"\xff\xfe", b"\xfe\xff")
_LINE_END = ord("\n")
# Bytes that are read together.
_AT_ONCE = 2**22
# Bytes of the first piece: whoever looks at a header needs no more.
_FIRST = 2**16
# Lines that are looked for from the end; of more it is quicker to count those before them.
_MOST_BACKWARDS = 1000


class TextLines(Sequence[str]):
    """Lines without line ends; blank ones at the end are left out.

    They are not kept: what needs them reads the file once more, of which the system has a copy.

    Parameters
    ----------
    read : callable
        Takes how many bytes to leave out, and returns the rest piece by piece, every time it is
        called. They are UTF-8, or else Latin-1: older exports are written in the code page of the
        recording computer. Lines end with a line feed, with or without a carriage return.

    Attributes
    ----------
    is_ended : bool
        Whether the last line ends with a line end.
    is_blank : bool
        Whether there is nothing but blanks.
    n_bytes : int
        Of the whole text, about.
    """

    def __init__(self, read: Callable[[int], Iterable[bytes]]) -> None:
        self._read = read
        self.is_ended, self.is_blank, is_utf8 = False, True, True
        self._n_lines, self._is_whole = 1, True
        # Where parts begin: lines and bytes before them.
        self._starts: list[tuple[int, int]] = []
        n_before, offset, part = 0, 0, b""
        for offset, part in _cut_at_line_ends(read(0)):
            self._starts.append((n_before, offset))
            self.is_ended = not part
            is_utf8 = is_utf8 and _is_utf8(part)
            self.is_blank = self.is_blank and not part.strip()
            # Tabs at the end of the last line may be gaps, so only blanks and line ends go.
            kept = len(part.rstrip(b" \n"))
            n_lines = count_lines(part)
            if kept:
                self._n_lines = n_before + n_lines - part.count(b"\n", kept)
            n_before += n_lines
        self.n_bytes = offset + len(part)
        self._encoding = "utf-8" if is_utf8 else "latin-1"

    @classmethod
    def of(cls, path: Path) -> TextLines:
        """Return the lines of a file, also of what Excel saves as Unicode text or for old Macs."""
        with path.open("rb") as file:
            head = file.read(_FIRST)
        is_odd = head[:2] in _UTF16_MARKS or (b"\r" in head and b"\n" not in head)
        if path.stat().st_size > _AT_ONCE and not is_odd:
            return cls(lambda first: _read(path, first))
        content = path.read_bytes()
        if is_odd:
            content = in_usual_text(content)
        return cls(lambda first: _part(content, first))

    def __len__(self) -> int:
        return self._n_lines

    def __iter__(self) -> Iterator[str]:
        return self._since(0)

    def _since(self, first: int) -> Iterator[str]:
        """Yield the lines from one on."""
        for part in self.blocks(first):
            yield from self.decode(part).split("\n")

    @overload
    def __getitem__(self, index: int) -> str: ...

    @overload
    def __getitem__(self, index: slice) -> list[str]: ...

    def __getitem__(self, index: int | slice) -> str | list[str]:
        if isinstance(index, slice):
            start, stop, step = index.indices(len(self))
            return list(islice(self._since(start), 0, max(stop - start, 0), step))
        first = index if index >= 0 else len(self) + index
        found = list(islice(self._since(first), 1)) if first >= 0 else []
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
        which = bisect_right(self._starts, first, key=lambda start: start[0]) - 1
        n_before, offset = self._starts[max(which, 0)]
        for _, part in _cut_at_line_ends(self._read(offset)):
            if n_before >= self._n_lines:
                return
            if n_before == 0 and self._encoding == "utf-8":
                part = part.removeprefix(_BYTE_ORDER_MARK)
            n_lines = count_lines(part)
            n_too_many = n_before + n_lines - self._n_lines
            if n_too_many >= 0:
                part = part[: _start_of_last(part, n_too_many) - 1] if n_too_many else part
                part = part.rstrip(b" ") if self._is_whole else part
                n_lines -= n_too_many
            if first < n_before + n_lines:
                n_kept = n_before + n_lines - first
                yield part if n_kept >= n_lines else part[_start_of_last(part, n_kept) :]
            n_before += n_lines
            if n_too_many >= 0:
                return

    def decode(self, text: bytes) -> str:
        """Decode a part of the file."""
        return text.decode(self._encoding)


def count_lines(text: bytes) -> int:
    """Return how many lines a text without a line end after the last has."""
    # `bytes.count` takes five times as long.
    return int(np.count_nonzero(np.frombuffer(text, np.uint8) == _LINE_END)) + 1


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


def in_usual_text(content: bytes) -> bytes:
    """Return a text in UTF-16 as UTF-8, and lines that end with a carriage return as others do.

    Parameters
    ----------
    content : bytes
        Of a whole file, or its first bytes.
    """
    if content[:2] in _UTF16_MARKS:
        content = content.decode("utf-16", "replace").encode("utf-8", "replace")
    if b"\r" in content and b"\n" not in content:
        content = content.replace(b"\r", b"\n")
    return content


def _read(path: Path, first: int) -> Iterator[bytes]:
    """Read a file piece by piece, without its first bytes; the first piece is a small one."""
    with path.open("rb") as file:
        file.seek(first)
        yield file.read(_FIRST)
        yield from iter(lambda: file.read(_AT_ONCE), b"")


def _part(content: bytes, first: int) -> Iterator[bytes]:
    """Yield what `_read` does, of a file that is in memory."""
    yield content[first : first + _FIRST]
    yield content[first + _FIRST :]


def _cut_at_line_ends(content: Iterable[bytes]) -> Iterator[tuple[int, bytes]]:
    """Yield where pieces of whole lines begin, and the pieces.

    The last one has no line end; it may be empty.
    """
    begun: list[bytes] = []
    first = 0
    for piece in content:
        cut = piece.rfind(b"\n")
        if cut < 0:
            begun.append(piece)
            continue
        lines = b"".join([*begun, piece[:cut]]) if begun else piece[:cut]
        n_bytes = len(lines) + 1
        if b"\r" in lines or piece[cut - 1 : cut] == b"\r":
            lines = (lines + b"\n").replace(b"\r\n", b"\n")[:-1]
        yield first, lines
        first += n_bytes
        begun = [piece[cut + 1 :]] if cut + 1 < len(piece) else []
    yield first, b"".join(begun)


def _start_of_last(part: bytes, n_lines: int) -> int:
    """Return where the last so many lines begin; one behind the end if there are none of them."""
    at = len(part) + 1
    for _ in range(min(n_lines, _MOST_BACKWARDS)):
        at = part.rfind(b"\n", 0, at - 1) + 1
    if n_lines > _MOST_BACKWARDS:
        skipped = count_lines(part) - n_lines
        at = len(part) - len(part.split(b"\n", skipped)[-1]) if skipped > 0 else 0
    return at


def _is_utf8(text: bytes) -> bool:
    """Tell whether bytes are UTF-8."""
    if text.isascii():
        return True
    try:
        text.decode("utf-8")
    except UnicodeDecodeError:
        return False
    return True

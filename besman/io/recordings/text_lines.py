"""Lines of a text file, decoded when they are asked for: an hour of a recording has 100 MB."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import overload

_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_NO_BLANK = re.compile(rb"\S")
# Bytes that are looked at together.
_BLOCK = 2**22


class TextLines(Sequence[str]):
    """Lines without line ends; blank ones at the end are left out.

    Parameters
    ----------
    content : bytes
        UTF-8, or else Latin-1: older exports are written in the code page of the recording
        computer. Lines end with a line feed, with or without a carriage return.

    Attributes
    ----------
    is_ended : bool
        Whether the last line ends with a line end.
    """

    def __init__(self, content: bytes) -> None:
        self._encoding, self._start = "utf-8", 0
        if not content.isascii():
            try:
                content.decode("utf-8")
            except UnicodeDecodeError:
                self._encoding = "latin-1"
            else:
                self._start = len(_BYTE_ORDER_MARK) if content.startswith(_BYTE_ORDER_MARK) else 0
        if b"\r\n" in content:
            content = content.replace(b"\r\n", b"\n")
        self._content = content
        self.is_ended = content.endswith(b"\n")
        self._end = len(content)
        # Tabs at the end of the last line may be gaps, so only blanks and line ends go.
        while self._end > self._start:
            tail = content[max(self._start, self._end - _BLOCK) : self._end]
            kept = tail.rstrip(b" \n")
            self._end -= len(tail) - len(kept)
            if kept:
                break

    @property
    def is_blank(self) -> bool:
        """Whether there is nothing but blanks."""
        return _NO_BLANK.search(self._content, self._start, self._end) is None

    def __len__(self) -> int:
        return self._content.count(b"\n", self._start, self._end) + 1

    def __iter__(self) -> Iterator[str]:
        at = self._start
        while at <= self._end:
            end = self._line_end(at)
            yield self.decode(self._content[at:end])
            at = end + 1

    @overload
    def __getitem__(self, index: int) -> str: ...

    @overload
    def __getitem__(self, index: slice) -> list[str]: ...

    def __getitem__(self, index: int | slice) -> str | list[str]:
        if isinstance(index, slice):
            return [self[k] for k in range(*index.indices(len(self)))]
        if index < 0:
            index += len(self)
        start = self._start_of(index) if index >= 0 else self._end + 1
        if start > self._end:
            raise IndexError(f"no line {index}")
        return self.decode(self._content[start : self._line_end(start)])

    def last(self, count: int) -> list[str]:
        """Return the last lines, the very last one at the end."""
        start = self._end
        for _ in range(count):
            before = self._content.rfind(b"\n", self._start, start)
            start = before
            if before < 0:
                break
        start = max(start + 1, self._start)
        return self.decode(self._content[start : self._end]).split("\n")

    def drop_last(self) -> None:
        """Leave out the last line."""
        self._end = max(self._content.rfind(b"\n", self._start, self._end), self._start)

    def blocks(self, first: int) -> Iterator[bytes]:
        """Yield all from one line on, some lines at a time, without the line end of the last."""
        at = self._start_of(first)
        while at <= self._end:
            end = self._line_end(min(at + _BLOCK, self._end))
            yield self._content[at:end]
            at = end + 1

    def decode(self, text: bytes) -> str:
        """Decode a part of the file."""
        return text.decode(self._encoding)

    def _start_of(self, index: int) -> int:
        """Return where a line begins; beyond the end if there is none."""
        at = self._start
        for _ in range(index):
            at = self._line_end(at) + 1
        return at

    def _line_end(self, at: int) -> int:
        """Return where the line ends in which a place is."""
        end = self._content.find(b"\n", at, self._end)
        return self._end if end < 0 else end

"""Rows of numbers below a header, whatever separates their cells: tabs, commas, semicolons, blanks.

An hour of a recording is read by the same quick way as a Qualisys TSV (`number_cells`).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from besman.exceptions import RecordingError
from besman.foreign.numbers import parse_number
from besman.io.recordings.number_cells import is_number_cell, parse_cells, parse_table, prepare
from besman.io.recordings.table_end import find_end
from besman.io.recordings.text_lines import TextLines, count_lines
from besman.records import FloatArray

# What programs write in the place of a number that they do not have.
_MISSING = frozenset({"", "-", "nan", "-nan", "nan(ind)", "-nan(ind)", "na", "n/a", "#n/a", "null",
                      "none", "1.#qnan", "-1.#ind", "1.#ind", "-1.#qnan"})  # fmt: skip
_DECIMAL = re.compile(rb"[+-]?[0-9]*\.([0-9]+)")
_WITH_COMMA = re.compile(r"[+-]?[0-9]*,[0-9]+([eE][+-]?[0-9]+)?")
_ROWS_ABOVE = 100
_MARGIN = 1.05
ROWS_SEEN = 20
"""First rows that tell how numbers are written: of some no cell may have decimals."""

TAKE = "--partial takes what is there"


@dataclass(frozen=True)
class Cells:
    """How the cells of a table are separated.

    Attributes
    ----------
    separator : bytes
        A tab, a comma, a semicolon, or a blank for any number of blanks and tabs.
    has_decimal_commas : bool
        Whether numbers have a comma for a point.
    is_doubled : bool
        Whether two separators stand between cells.
    """

    separator: bytes
    has_decimal_commas: bool = False
    is_doubled: bool = False

    def tabbed(self, text: bytes) -> bytes:
        """Return lines with tabs between cells and points in numbers."""
        if b'"' in text:
            text = text.replace(b'"', b"")
        if self.has_decimal_commas:
            text = text.replace(b",", b".")
        if self.separator == b" ":
            return b"\n".join(b"\t".join(line.split()) for line in text.split(b"\n"))
        if self.is_doubled:
            text = text.replace(2 * self.separator, self.separator)
        return text if self.separator == b"\t" else text.replace(self.separator, b"\t")

    def split(self, line: str) -> list[str]:
        """Return the cells of a line of a header, without blanks and quotes around them."""
        if self.separator == b" ":
            return line.split() or [""]
        mark = self.separator.decode()
        parts = line.split(mark)
        parts = _join_quoted(parts, mark) if '"' in line else parts
        return [cell.strip().strip('"').strip() for cell in parts]


def _join_quoted(parts: list[str], mark: str) -> list[str]:
    """Put together what was cut between quotes; all as it was if a quote is not closed."""
    joined: list[str] = []
    begun: list[str] = []
    for part in parts:
        bare = part.strip()
        begins = bare[:1] == '"' and (len(bare) == 1 or bare[-1] != '"')
        if begun or begins:
            begun.append(part)
            if len(begun) == 1 or bare[-1:] != '"':
                continue
            part, begun = mark.join(begun), []
        joined.append(part)
    return parts if begun else joined


def find_cells(line: str) -> Cells:
    """Tell what separates the cells of a line with at least two of them."""
    if "\t" in line:
        return Cells(b"\t")
    if ";" in line:
        return Cells(b";", has_decimal_commas="," in line)
    return Cells(b"," if "," in line else b" ")


def see_commas(cells: Cells, rows: Sequence[str]) -> Cells:
    """Return how cells are separated, numbers with a comma for a point where rows show it.

    Parameters
    ----------
    cells : Cells
        As the header has them.
    rows : sequence of str
        The first lines of numbers.
    """
    if cells.separator == b"," or cells.has_decimal_commas:
        return cells
    found = [cell for row in rows for cell in cells.split(row)]
    has_commas = any(_WITH_COMMA.fullmatch(cell) for cell in found)
    return replace(cells, has_decimal_commas=has_commas and not any("." in one for one in found))


def is_word(cell: str) -> bool:
    """Tell whether a cell is a word, and none that stands for a number that is not there."""
    return any(map(str.isalpha, cell)) and cell.lower() not in _MISSING and not is_number_cell(cell)


def is_blank(line: str) -> bool:
    """Tell whether a line has nothing but separators."""
    return not line.strip(" \t,;\"'")


def read_rows(
    lines: TextLines,
    first: int,
    width: int,
    cells: Cells,
    path: Path,
    *,
    partial: bool = False,
    texts: tuple[int, ...] = (),
) -> FloatArray:
    """Read rows of numbers up to the first blank line, below which no row may be, or to the end.

    Parameters
    ----------
    lines : TextLines
        Of the whole file.
    first : int
        Index of the first row.
    width : int
        How many columns there are. Further cells must be empty; cells that are missing at the end
        of a line are, too.
    cells : Cells
    path : Path
        Named in errors.
    partial : bool
        Leave out a last line that was cut.
    texts : tuple of int
        Columns that are no numbers, and come back as NaN.

    Returns
    -------
    array, shape (T, width)
        NaN for empty cells and what else stands for a number that is not there.

    Raises
    ------
    RecordingError
        If there is no row, one has too many cells, a cell is no number, or the last line was cut.
    """
    blocks = _read_blocks(lines, first, width, cells, path, partial, texts)
    return _gather(blocks, (slice(None),))[0]


def read_tracks(
    lines: TextLines,
    first: int,
    width: int,
    cells: Cells,
    path: Path,
    lead: Sequence[int],
    places: Sequence[int],
    *,
    partial: bool = False,
    texts: tuple[int, ...] = (),
) -> tuple[FloatArray, FloatArray]:
    """Read rows as `read_rows` does, and keep no more of them than is asked for.

    Parameters
    ----------
    lines, first, width, cells, path, partial, texts
        As of `read_rows`.
    lead : sequence of int
        Columns such as frame and time.
    places : sequence of int, length M
        Columns of x, behind which y and z stand.

    Returns
    -------
    array, shape (T, L)
        The first.
    array, shape (T, M, 3)
        The others.
    """
    columns = (np.array(places, np.intp)[:, None] + np.arange(3)).ravel()
    blocks = _read_blocks(lines, first, width, cells, path, partial, texts)
    is_even = bool((np.diff(columns) == 1).all())
    wanted = slice(columns[0], columns[-1] + 1) if is_even else columns
    led, placed = _gather(blocks, (np.array(lead, np.intp), wanted))
    # No view, which a record would copy.
    placed.resize((len(placed), len(places), 3), refcheck=False)
    return led, placed


def _gather(
    blocks: Iterator[tuple[FloatArray, int]], picks: Sequence[npt.NDArray[np.intp] | slice]
) -> list[FloatArray]:
    """Return columns of all rows together, each pick as an array of its own."""
    found: list[FloatArray] = []
    n_found = 0
    for values, n_left in blocks:
        n_rows = len(values)
        for which, pick in enumerate(picks):
            # What is picked by numbers is gathered faster by `take`.
            part = values[:, pick] if isinstance(pick, slice) else values.take(pick, axis=1)
            if not n_found:
                found.append(np.empty((0, part.shape[1])))
            if n_found + n_rows > len(found[which]):
                room = np.empty((n_found + max(n_left, n_rows), part.shape[1]))
                room[:n_found] = found[which][:n_found]
                found[which] = room
            found[which][n_found : n_found + n_rows] = part
        n_found += n_rows
    for one in found:
        one.resize((n_found, one.shape[1]), refcheck=False)
    return found


def _read_blocks(
    lines: TextLines,
    first: int,
    width: int,
    cells: Cells,
    path: Path,
    partial: bool,
    texts: tuple[int, ...],
) -> Iterator[tuple[FloatArray, int]]:
    """Yield the rows of each part of a file, and how many there will be, if all are as long."""
    prepare(lines.n_bytes)
    row, is_any = first, False
    for block in lines.blocks(first):
        n_lines = count_lines(block)
        n_left = int(_MARGIN * n_lines * lines.n_bytes / max(len(block), 1))
        n_left = max(0, min(n_left, len(lines) - row))
        is_last = row + n_lines >= len(lines)
        is_whole = not texts and (lines.is_ended or not is_last)
        values = _parse_plain(block, cells, n_lines, width) if is_whole else None
        text, end = b"" if values is not None else cells.tabbed(block), n_lines
        if values is None and is_whole and _is_even(text, width):
            values = parse_cells(text, n_lines * width)
        if values is None:
            body = text.split(b"\n")
            end = find_end(body, lines, row, cells.split, path)
            body = body[:end]
            if is_last and end == n_lines:
                above = lines.last(min(_ROWS_ABOVE, len(lines) - first))[:-1]
                body = _look_for_cut(body, cells, above, width, lines.is_ended, path, row, partial)
            values = _parse(body, width, texts, path, row, lines) if body else None
        if values is not None and values.size:
            is_any = True
            yield values.reshape(-1, width), n_left
        if end < n_lines or is_last:
            break
        row += n_lines
    if not is_any:
        raise RecordingError(f"{path}:{first + 1}: no frames after the header; is the file cut?")


def _parse_plain(block: bytes, cells: Cells, n_rows: int, width: int) -> FloatArray | None:
    """Parse lines as they are, where one byte separates cells and all of them are plain."""
    if cells.is_doubled or cells.separator == b" " or b'"' in block:
        return None
    point = b"," if cells.has_decimal_commas else b"."
    return parse_table(block, n_rows, width, cells.separator, point, False)


def _is_even(text: bytes, width: int) -> bool:
    """Tell whether every line has as many cells as there are columns, and not all of them empty."""
    codes = np.frombuffer(text, np.uint8)
    ends = np.append(np.flatnonzero(codes == ord("\n")), len(codes))
    tabs = np.flatnonzero(codes == ord("\t"))
    lengths = np.diff(ends, prepend=-1) - 1
    counts = np.diff(np.searchsorted(tabs, ends), prepend=0)
    return width > 1 and bool((counts == width - 1).all() and (lengths > width - 1).all())


def _parse(
    body: list[bytes],
    width: int,
    texts: tuple[int, ...],
    path: Path,
    first: int,
    lines: TextLines,
) -> FloatArray:
    """Parse lines of cells between tabs."""
    n_tabs = np.fromiter((line.count(b"\t") for line in body), np.int64, len(body))
    for at in np.flatnonzero(n_tabs != width - 1):
        body[at] = _fit(body[at], width, path, first + int(at))
    if texts:
        body = [_blank_out(line, texts) for line in body]
    values = parse_cells(b"\n".join(body), len(body) * width) if width > 1 else None
    if values is None:
        values = _parse_odd(body, width, path, first, lines)
    return values.reshape(-1, width)


def _fit(line: bytes, width: int, path: Path, index: int) -> bytes:
    """Give a line as many cells as there are columns; only empty ones may come or go."""
    parts = line.split(b"\t")
    if len(parts) < width:
        return line + b"\t" * (width - len(parts))
    if any(part.strip() for part in parts[width:]):
        raise RecordingError(
            f"{path}:{index + 1}: got {len(parts)} columns, expected {width}; is the file damaged?"
        )
    return b"\t".join(parts[:width])


def _blank_out(line: bytes, columns: tuple[int, ...]) -> bytes:
    parts = line.split(b"\t")
    for column in columns:
        parts[column] = b""
    return b"\t".join(parts)


def _parse_odd(
    body: list[bytes], width: int, path: Path, first: int, lines: TextLines
) -> FloatArray:
    """Parse cells one by one; refuse what is no number."""
    values = np.empty((len(body), width))
    for row, line in enumerate(body):
        for column, cell in enumerate(lines.decode(line).split("\t")):
            text = cell.strip()
            if text.lower() in _MISSING:
                values[row, column] = np.nan
                continue
            try:
                values[row, column] = parse_number(text)
            except ValueError:
                values[row, column] = np.inf
            if np.isinf(values[row, column]):
                raise RecordingError(
                    f"{path}:{first + row + 1}: column {column + 1}: got {text!r:.60}, expected a "
                    "number or nothing"
                )
    return values


def _look_for_cut(
    body: list[bytes],
    cells: Cells,
    above: list[str],
    width: int,
    is_ended: bool,
    path: Path,
    first: int,
    partial: bool,
) -> list[bytes]:
    """Refuse a last line that was cut, or take it away."""
    rows = [cells.tabbed(line.encode("utf-8", "replace")) for line in above]
    if is_ended or not rows:
        return body
    n_tabs = body[-1].count(b"\t")
    if n_tabs < min(row.count(b"\t") for row in rows):
        reason = f"got {n_tabs + 1} columns, expected {width}"
    elif n_tabs < width and _has_fewer_digits(body[-1], rows, n_tabs):
        reason = "the line ends before those above it do"
    else:
        return body
    if not partial:
        raise RecordingError(f"{path}:{first + len(body)}: {reason}; is the file cut? {TAKE}")
    return body[:-1]


def _has_fewer_digits(line: bytes, above: list[bytes], n_tabs: int) -> bool:
    """Tell whether the last cell of a line lacks digits that all those above it have."""
    column = [row.split(b"\t")[n_tabs].strip() for row in above if row.count(b"\t") >= n_tabs]
    last = line.split(b"\t")[-1].strip()
    if not last:
        return all(column)
    digits = [len(found[1]) for found in map(_DECIMAL.fullmatch, column) if found]
    return len(digits) == len(column) and len(last.partition(b".")[2]) < min(digits)

"""The sections of a C3D file: header, parameters, frames. Every byte is checked before it is used.

Libraries that read C3D trust the file, and damaged ones end the whole program.

References
----------
Motion Lab Systems: The C3D File Format User Guide, 2008.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.exceptions import RecordingError
from besman.io.recordings.c3d_counts import (
    BLOCK,
    MAX_FRAMES,
    Layout,
    find_analog_words,
    find_last_frame,
)
from besman.io.warning import warn_of_file

_MAGIC = 0x50
_INTEL, _DEC, _MIPS = 84, 85, 86
_BODY_NUMBERS = 17
_CHAR, _BYTE, _INTEGER, _FLOAT = -1, 1, 2, 4

Values = list[str] | list[float]


@dataclass(frozen=True)
class C3dSections:
    """What a C3D file holds about its points.

    Attributes
    ----------
    parameters : dict of str to list
        Values by ``GROUP:NAME`` in capitals: text without blanks around it, or numbers.
    points : array, shape (T, M, 4)
        Coordinates in the file's units, and the residual: negative in a gap.
    bodies : array, shape (T', N, 17), or None
        Of a file without points the 16 numbers of each body's place and turn, column by column, and
        the residual. C-Motion's group ROTATION, which Theia3D writes.
    rate_hz : float
        Frames per second in the header.
    first_frame : int
        Number of the first frame; some programs count from 0.
    notes : tuple of str
        What was concluded where the file contradicts itself.
    """

    parameters: dict[str, Values]
    points: npt.NDArray[np.float64]
    rate_hz: float
    first_frame: int
    notes: tuple[str, ...] = ()
    bodies: npt.NDArray[np.float64] | None = None


class _Entry(NamedTuple):
    """A group (negative number) or parameter, and where the next one is (-1: nowhere)."""

    group: int
    name: str
    values: Values
    next_at: int


def read_sections(content: bytes, path: Path, partial: bool = False) -> C3dSections:
    """Take a C3D file apart.

    Parameters
    ----------
    content : bytes
        The whole file.
    path : Path
        Named in errors.
    partial : bool
        Take the whole frames of a file that was cut.

    Returns
    -------
    C3dSections

    Raises
    ------
    RecordingError
        If the file is cut, damaged, holds no points, or more frames than its format can count.
    """
    if len(content) < BLOCK or content[1] != _MAGIC:
        raise RecordingError(
            f"{path}: no C3D header; expected {BLOCK} bytes with 0x50 as the second, "
            f"got {len(content)} bytes; is the file cut?"
        )
    start = (content[0] - 1) * BLOCK
    if start < BLOCK or start + 4 > len(content):
        raise RecordingError(f"{path}: the file ends before its parameters; is it cut?")
    processor = content[start + 3]
    if processor not in (_INTEL, _DEC, _MIPS):
        raise RecordingError(
            f"{path}: byte order {processor} is unknown; expected 84 (Intel), 85 (DEC), 86 (MIPS)"
        )
    parameters = _read_parameters(content, start + 4, processor, path)
    if not any(content[2:4]) and _whole(parameters, "ROTATION:USED"):
        return _read_bodies(content, processor, parameters, path, partial)
    found = _read_points(content, processor, parameters, path, partial)
    n_points = found.points.shape[1]
    declared = parameters.get("POINT:USED", [n_points])
    if declared != [n_points]:
        raise RecordingError(
            f"{path}: the header counts {n_points} points and POINT:USED {declared}; "
            "expected the same number"
        )
    return found


def _read_layout(
    content: bytes, processor: int, parameters: dict[str, Values], path: Path
) -> tuple[Layout, float, float]:
    """Return what the header says: counts, scale and frames per second."""
    order = ">" if processor == _MIPS else "<"
    n_points, n_analog, first, last = struct.unpack_from(f"{order}4H", content, 2)
    data_block, n_samples = struct.unpack_from(f"{order}2H", content, 16)
    if n_points == 0:
        rest = ", but analog channels (of force plates, muscles, ...)" if n_analog else ""
        raise RecordingError(f"{path}: the header counts no points{rest}; expected at least one")
    _check_frames(first, last, path)
    scale, rate_hz = _floats(content[12:16] + content[20:24], processor).tolist()
    told = parameters.get("POINT:SCALE", ())
    if scale == 0 and len(told) == 1 and isinstance(told[0], float):
        scale = told[0]
    data_block = data_block or _whole(parameters, "POINT:DATA_START")
    if not np.isfinite(scale) or scale == 0:
        raise RecordingError(f"{path}: the scale in the header is {scale:g}; is the file damaged?")
    word_bytes = 4 if scale < 0 else 2
    layout = Layout(n_points, n_analog, n_samples, first, last, data_block, word_bytes)
    return layout, scale, rate_hz


def _read_points(
    content: bytes,
    processor: int,
    parameters: dict[str, Values],
    path: Path,
    partial: bool,
) -> C3dSections:
    """Return the points, shape (T, M, 4), and what is known of them."""
    order = ">" if processor == _MIPS else "<"
    layout, scale, rate_hz = _read_layout(content, processor, parameters, path)
    n_points, data_block, size = layout.n_points, layout.data_block, layout.word_bytes
    room = len(content) - (data_block - 1) * BLOCK
    layout = layout._replace(last=find_last_frame(layout, parameters, room))
    n_analog, note = find_analog_words(layout, parameters, room, path)
    width = 4 * n_points + n_analog
    frames = (layout.first, layout.last)
    n_frames = _check_length(len(content), data_block, width * size, frames, path, partial)
    at = (data_block - 1) * BLOCK
    data = content[at : at + n_frames * width * size]
    # What was recorded beside the points is left out before it is decoded.
    words = np.frombuffer(data, f"V{size}").reshape(n_frames, width)[:, : 4 * n_points]
    data = words.tobytes() if width > 4 * n_points else data
    if scale < 0:
        numbers = _floats(data, processor)
    else:
        numbers = np.frombuffer(data, f"{order}i2").astype(np.float64)
    points = numbers.reshape(n_frames, n_points, 4)
    if scale > 0:
        points[..., :3] *= scale
    return C3dSections(parameters, points, rate_hz, layout.first, (note,) if note else ())


def _read_bodies(
    content: bytes,
    processor: int,
    parameters: dict[str, Values],
    path: Path,
    partial: bool,
) -> C3dSections:
    """Return the bodies of a file without points."""
    first, last = struct.unpack_from(f"{'>' if processor == _MIPS else '<'}2H", content, 6)
    _check_frames(first, last, path)
    (rate_hz,) = _floats(content[20:24], processor).tolist()
    n_bodies, block = (_whole(parameters, f"ROTATION:{key}") for key in ("USED", "DATA_START"))
    ratio = max(1, _whole(parameters, "ROTATION:RATIO"))
    frames = (first, first + (last - first + 1) * ratio - 1)
    frame_bytes = 4 * _BODY_NUMBERS * n_bodies
    n_frames = _check_length(len(content), block, frame_bytes, frames, path, partial)
    at = (block - 1) * BLOCK
    numbers = _floats(content[at : at + n_frames * frame_bytes], processor)
    bodies = numbers.reshape(n_frames, n_bodies, _BODY_NUMBERS)
    points = np.empty((n_frames, 0, 4))
    return C3dSections(parameters, points, rate_hz * ratio, (first - 1) * ratio + 1, (), bodies)


def _check_frames(first: int, last: int, path: Path) -> None:
    if last < first:
        raise RecordingError(
            f"{path}: frames {first} to {last}; expected frames that count up, at most {MAX_FRAMES}"
        )


def _whole(parameters: dict[str, Values], name: str) -> int:
    """Return a parameter that is one whole number; 0 where it is none."""
    values = parameters.get(name, ())
    value = values[0] if len(values) == 1 else 0.0
    return int(value) if isinstance(value, float) and 0 <= value <= MAX_FRAMES else 0


def _check_length(
    n_bytes: int,
    data_block: int,
    frame_bytes: int,
    frames: tuple[int, int],
    path: Path,
    partial: bool,
) -> int:
    """Return how many frames there are; refuse fewer than the file says, or more than it can."""
    first, last = frames
    n_frames = last - first + 1
    room = n_bytes - (data_block - 1) * BLOCK
    n_there = max(0, room) // frame_bytes
    if data_block < 2 or n_there < n_frames:
        what = f"the file ends after {n_there} of {n_frames} frames"
        if not partial or data_block < 2 or n_there == 0:
            take = " --partial takes what is there" if n_there else ""
            raise RecordingError(f"{path}: {what}; is it cut?{take}")
        warn_of_file(f"{path.name}: {what}")
        return n_there
    excess = room - n_frames * frame_bytes
    wrapped = excess >= (MAX_FRAMES + 1) * frame_bytes
    if wrapped or (last == MAX_FRAMES and excess >= frame_bytes + BLOCK):
        raise RecordingError(
            f"{path}: got about {room // frame_bytes} frames; C3D counts up to {MAX_FRAMES}, "
            "so the frames cannot be told apart: export parts, or TSV"
        )
    return n_frames


def _read_parameters(content: bytes, at: int, processor: int, path: Path) -> dict[str, Values]:
    """Follow the parameter section to its end."""
    groups: dict[int, str] = {}
    found: list[_Entry] = []
    while at >= 0:
        try:
            entry = _read_entry(content, at, processor)
        except (struct.error, IndexError, ValueError):
            raise RecordingError(
                f"{path}: a parameter at byte {at} cannot be read; is the file cut or damaged?"
            ) from None
        if entry is None:
            break
        if entry.group < 0:
            groups[-entry.group] = entry.name
        else:
            found.append(entry)
        at = entry.next_at
    return {f"{groups.get(entry.group, '')}:{entry.name}": entry.values for entry in found}


def _read_entry(content: bytes, at: int, processor: int) -> _Entry | None:
    """Read one group or parameter, None at the end of the section."""
    name_length, group = struct.unpack_from("2b", content, at)
    at += 2 + abs(name_length)
    if name_length == 0 or group == 0:
        return None
    name = content[at - abs(name_length) : at].decode("latin-1").strip().upper()
    (offset,) = struct.unpack_from(">H" if processor == _MIPS else "<H", content, at)
    next_at = at + offset if offset else -1
    at += 2
    values: Values = []
    if group > 0:
        kind, n_sides = struct.unpack_from("bB", content, at)
        sides = list(content[at + 2 : at + 2 + n_sides])
        at += 2 + n_sides
        n_bytes = abs(kind) * math.prod(sides)
        values = _decode(content[at : at + n_bytes], kind, sides, processor)
        at += n_bytes
    # Some programs leave out the description with the byte of its length.
    if next_at != at:
        at += 1 + content[at]
    if at > len(content) or 0 <= next_at < at:
        raise ValueError
    return _Entry(group, name, values, next_at)


def _decode(data: bytes, kind: int, sides: list[int], processor: int) -> Values:
    """Return the values of a parameter."""
    if kind == _CHAR:
        length = sides[0] if sides else 1
        rows = [data[start : start + length] for start in range(0, len(data), max(1, length))]
        return [row.decode("utf-8", "replace").strip(" \0") for row in rows]
    if kind == _BYTE:
        return [float(value) for value in data]
    if kind == _INTEGER:
        order = ">" if processor == _MIPS else "<"
        return [float(value) for value in np.frombuffer(data, f"{order}u2")]
    if kind == _FLOAT:
        return [float(value) for value in _floats(data, processor)]
    raise ValueError


def _floats(data: bytes, processor: int) -> npt.NDArray[np.float64]:
    """Decode single precision numbers of one of three processors."""
    # Bytes that are no number, as text in their place, may be NaN of the kind that signals.
    with np.errstate(invalid="ignore"):
        return _decode_floats(data, processor)


def _decode_floats(data: bytes, processor: int) -> npt.NDArray[np.float64]:
    if processor == _DEC:
        # The halves are swapped and the exponent counts from two more.
        halves = np.frombuffer(data, "<u2").reshape(-1, 2)[:, ::-1]
        return np.ascontiguousarray(halves).view("<f4").ravel().astype(np.float64) / 4.0
    return np.frombuffer(data, ">f4" if processor == _MIPS else "<f4").astype(np.float64)

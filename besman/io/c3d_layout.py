"""What a C3D file says of itself, checked before a library walks through it.

References
----------
Motion Lab Systems: The C3D File Format User Guide, 2008 (header, parameter and data sections).
"""

from __future__ import annotations

import math
import struct
from pathlib import Path

from besman.exceptions import RecordingError

MAX_FRAMES = 65_535
_BLOCK = 512
_MAGIC = 0x50
_INTEL, _DEC, _MIPS = 84, 85, 86
_ELEMENT_BYTES = {-1: 1, 1: 1, 2: 2, 4: 4}


def check_layout(content: bytes, path: Path) -> None:
    """Refuse a C3D file whose sections do not fit into it.

    Parameters
    ----------
    content : bytes
        The whole file.
    path : Path
        Named in errors.

    Raises
    ------
    RecordingError
        If the file is cut, damaged, holds no points, or more frames than its format can count.
    """
    if len(content) < _BLOCK or content[1] != _MAGIC:
        raise RecordingError(
            f"{path}: no C3D header; expected {_BLOCK} bytes with 0x50 as the second, "
            f"got {len(content)} bytes; is the file cut?"
        )
    order, integers = _walk_parameters(content, path)
    words = struct.unpack_from(f"{order}12H", content)
    n_points, n_analog, first, last = words[1:5]
    declared = integers.get("POINT:USED", n_points)
    if n_points == 0 or declared != n_points:
        raise RecordingError(
            f"{path}: the header counts {n_points} points and POINT:USED {declared}; "
            "expected the same number, at least 1"
        )
    n_channels, n_subframes = integers.get("ANALOG:USED", 0), words[9]
    if n_analog and n_channels * n_subframes != n_analog:
        raise RecordingError(
            f"{path}: the header counts {n_analog} analog values a frame, expected "
            f"ANALOG:USED {n_channels} times {n_subframes}"
        )
    if first == 0 or last < first:
        raise RecordingError(
            f"{path}: frames {first} to {last}; expected frames that count up from 1, at most "
            f"{MAX_FRAMES}"
        )
    is_float = integers["header scale sign"] < 0
    frame_bytes = (4 * n_points + n_analog) * (4 if is_float else 2)
    _check_length(len(content), words[8], frame_bytes, first, last, path)


def _check_length(
    n_bytes: int, data_block: int, frame_bytes: int, first: int, last: int, path: Path
) -> None:
    """Refuse a file that holds fewer frames than it says, or more than it can say."""
    n_frames = last - first + 1
    room = n_bytes - (data_block - 1) * _BLOCK
    if data_block < 2 or room < n_frames * frame_bytes:
        raise RecordingError(
            f"{path}: the file ends after {max(0, room) // frame_bytes} of {n_frames} frames; "
            "is it cut?"
        )
    excess = room - n_frames * frame_bytes
    wrapped = excess >= 65_536 * frame_bytes
    if wrapped or (last == MAX_FRAMES and excess >= frame_bytes + _BLOCK):
        raise RecordingError(
            f"{path}: got about {room // frame_bytes} frames; C3D counts up to {MAX_FRAMES}, "
            "so the frames cannot be told apart: export parts, or TSV"
        )


def _walk_parameters(content: bytes, path: Path) -> tuple[str, dict[str, int]]:
    """Follow the parameter section to its end; return byte order and the integers needed."""
    start = (content[0] - 1) * _BLOCK
    if start < _BLOCK or start + 4 > len(content):
        raise RecordingError(f"{path}: the file ends before its parameters; is it cut?")
    processor = content[start + 3]
    if processor not in (_INTEL, _DEC, _MIPS):
        raise RecordingError(
            f"{path}: byte order {processor} is unknown; expected 84 (Intel), 85 (DEC), 86 (MIPS)"
        )
    order = ">" if processor == _MIPS else "<"
    # Which byte of a float holds its sign depends on the processor.
    sign = content[{_INTEL: 15, _DEC: 13, _MIPS: 12}[processor]] & 0x80
    integers = {"header scale sign": -1 if sign else 1}
    groups: dict[int, str] = {}
    found: list[tuple[int, str, int]] = []
    at = start + 4
    while True:
        entry = _read_entry(content, at, order, path)
        if entry is None:
            break
        group, name, value, at = entry
        if group < 0:
            groups[-group] = name
        elif value is not None:
            found.append((group, name, value))
        if at < 0:
            break
    integers.update({f"{groups.get(group, '')}:{name}": value for group, name, value in found})
    return order, integers


def _read_entry(
    content: bytes, at: int, order: str, path: Path
) -> tuple[int, str, int | None, int] | None:
    """Read one group or parameter: group number, name, integer if it is one, next position."""
    try:
        name_length, group = struct.unpack_from("2b", content, at)
        n_name = abs(name_length)
        if n_name == 0 or group == 0:
            return None
        name = content[at + 2 : at + 2 + n_name].decode("latin-1").upper()
        pointer = at + 2 + n_name
        (offset,) = struct.unpack_from(f"{order}H", content, pointer)
        after = pointer + offset if offset else -1
        end, value = pointer + 2, None
        if group > 0:
            kind, n_dimensions = struct.unpack_from("bB", content, end)
            sides = content[end + 2 : end + 2 + n_dimensions]
            end += 2 + n_dimensions
            n_bytes = _ELEMENT_BYTES[kind] * math.prod(sides)
            if kind == 2 and n_bytes == 2:
                (value,) = struct.unpack_from(f"{order}H", content, end)
            end += n_bytes
        end += 1 + content[end]
    except (struct.error, IndexError, KeyError):
        raise RecordingError(
            f"{path}: a parameter at byte {at} cannot be read; is the file cut or damaged?"
        ) from None
    if end > len(content) or 0 <= after < end:
        raise RecordingError(
            f"{path}: a parameter at byte {at} does not fit; is the file cut or damaged?"
        )
    return group, name, value, after

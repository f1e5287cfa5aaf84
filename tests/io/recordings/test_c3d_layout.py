"""The sections of a C3D file, put together here byte by byte for each processor."""

import struct
from pathlib import Path

import numpy as np
import pytest

from besman.exceptions import RecordingError
from besman.io.recordings.c3d_layout import read_sections

PATH = Path("a.c3d")
INTEL, DEC, MIPS = 84, 85, 86


def floats(values, processor):
    if processor == DEC:
        # Four times the number, with its halves swapped.
        words = (np.asarray(values, "<f4") * 4).view("<u2").reshape(-1, 2)[:, ::-1]
        return np.ascontiguousarray(words).tobytes()
    return np.asarray(values, ">f4" if processor == MIPS else "<f4").tobytes()


def entry(group, name, order, data=None):
    """A group (negative) or a parameter of whole numbers."""
    body = b"" if data is None else struct.pack("bBB", 2, 1, len(data)) + struct.pack(f"{order}{len(data)}h", *data)  # fmt: skip  # noqa: E501
    body += b"\0"
    return (
        struct.pack("bb", len(name), group) + name + struct.pack(f"{order}H", 2 + len(body)) + body
    )


def file(points, processor=INTEL, scale=-1.0, used=None):
    """Frames of points (T, M, 4) as a file of three blocks of 512 bytes and more."""
    order = ">" if processor == MIPS else "<"
    n_frames, n_points, _ = points.shape
    head = bytearray(512)
    head[:2] = 2, 0x50
    struct.pack_into(f"{order}5H", head, 2, n_points, 0, 7, 6 + n_frames, 10)
    head[12:16] = floats([scale], processor)
    struct.pack_into(f"{order}H", head, 16, 3)
    head[20:24] = floats([50.0], processor)
    section = bytes([1, 0x50, 1, processor]) + entry(-1, b"POINT", order)
    section += entry(1, b"USED", order, [used or n_points]) + b"\0\0"
    if scale < 0:
        data = floats(points.ravel(), processor)
    else:
        data = np.round(points / [scale, scale, scale, 1]).astype(f"{order}i2").tobytes()
    return bytes(head) + section.ljust(512, b"\0") + data


@pytest.fixture
def points():
    return np.random.default_rng(0).integers(-400, 400, (5, 3, 4)).astype(float)


def test_where_the_header_has_no_start_of_the_frames_the_parameter_counts(points):
    content = bytearray(file(points))
    content[16:18] = b"\0\0"
    used = entry(1, b"USED", "<", [3])
    at = content.index(used) + len(used)
    more = entry(1, b"DATA_START", "<", [3])
    content[at : at + len(more)] = more
    np.testing.assert_array_equal(read_sections(bytes(content), PATH).points, points)


@pytest.mark.parametrize("processor", [INTEL, DEC, MIPS])
@pytest.mark.parametrize("scale", [-1.0, 0.5])
def test_points_come_back_from_every_processor(points, processor, scale):
    found = read_sections(file(points, processor, scale), PATH)
    np.testing.assert_allclose(found.points, points)
    assert (found.rate_hz, found.first_frame) == (50.0, 7)
    assert found.parameters["POINT:USED"] == [3.0]


def test_a_cut_at_any_byte_is_an_error_of_ours(points):
    whole = file(points)
    for length in range(0, len(whole), 13):
        with pytest.raises(RecordingError, match=r"is it cut|is the file cut|cut or damaged"):
            read_sections(whole[:length], PATH)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda whole: whole[:1] + b"\0" + whole[2:], "no C3D header"),
        (lambda whole: whole[:515] + b"\1" + whole[516:], "byte order 1 is unknown"),
        (lambda whole: whole[:2] + b"\0\0" + whole[4:], "the header counts no points"),
        (lambda whole: whole[:6] + b"\0\0" + whole[8:], "ends after 5 of 12 frames"),
        (lambda whole: whole[:12] + bytes(4) + whole[16:], "the scale in the header is 0"),
    ],
)
def test_a_damaged_header_is_named(points, change, message):
    with pytest.raises(RecordingError, match=message):
        read_sections(change(file(points)), PATH)


def test_two_counts_of_the_points_must_agree(points):
    with pytest.raises(RecordingError, match=r"counts 3 points and POINT:USED \[4.0\]"):
        read_sections(file(points, used=4), PATH)

"""Frames whose analog words are counted in three ways, put together byte by byte."""

import struct
from pathlib import Path

import numpy as np
import pytest

from besman.exceptions import RecordingError
from besman.io.recordings.c3d_counts import MAX_FRAMES
from besman.io.recordings.c3d_layout import read_sections

PATH = Path("a.c3d")
POINTS = np.random.default_rng(0).normal(size=(40, 3, 4)).astype("<f4")


def parameter(name, values, kind="h", described=True):
    data = struct.pack(f"<{len(values)}{kind}", *values)
    body = bytes([{"h": 2, "f": 4}[kind], 1, len(values)]) + data + (b"\0" if described else b"")
    return struct.pack("<bb", len(name), 1) + name + struct.pack("<H", 2 + len(body)) + body


def file(said, samples, used, there, frames=(1, 40), extra=b"", described=True, n_bytes=None):
    """Forty frames with `there` analog words each; the header says `said`."""
    head = bytearray(512)
    head[:2] = 2, 0x50
    struct.pack_into("<4H", head, 2, 3, said, *frames)
    struct.pack_into("<fHHf", head, 12, -1.0, 3, samples, 100.0)
    section = bytes([1, 0x50, 1, 84]) + struct.pack("<bb", 6, -1) + b"ANALOG" + b"\x03\0\0"
    if used is not None:
        section += parameter(b"USED", [used], described=described)
    section += extra + b"\0\0"
    analog = np.full((len(POINTS), there), 7.5, "<f4")
    data = np.concatenate([POINTS.reshape(len(POINTS), -1), analog], axis=1).tobytes()
    data = data[:n_bytes]
    return bytes(head) + section.ljust(512, b"\0") + data.ljust(-(-len(data) // 512) * 512, b"\0")


@pytest.mark.parametrize(
    ("said", "samples", "used", "there"),
    [(10, 5, 2, 10), (2, 5, 2, 10), (0, 5, 2, 10), (2, 1, 2, 2), (6, 0, None, 6), (10, 5, 0, 10)],
)
def test_the_reading_that_fits_the_file_is_taken(said, samples, used, there):
    found = read_sections(file(said, samples, used, there), PATH)
    np.testing.assert_array_equal(found.points, POINTS)
    assert bool(found.notes) == (said != there)


def test_the_rates_tell_samples_that_the_header_does_not():
    rates = parameter(b"RATE", [500.0], "f") + struct.pack("<bb", 5, -2) + b"POINT" + b"\x03\0\0"
    rates += parameter(b"RATE", [100.0], "f").replace(b"\x04\x01RATE", b"\x04\x02RATE")
    found = read_sections(file(2, 1, 2, 10, extra=rates), PATH)
    np.testing.assert_array_equal(found.points, POINTS)
    assert found.notes == (
        "the header counts 2 analog words a frame; 10 are there, as the length of the file says",
    )


def test_three_opinions_are_an_error():
    with pytest.raises(RecordingError, match=r"counts 2 analog words .* ANALOG:USED 3 channels"):
        read_sections(file(2, 5, 3, 7), PATH)


def test_a_cut_file_is_none_whose_counts_are_wrong():
    with pytest.raises(RecordingError, match=r"ends after \d+ of 40 frames; is it cut"):
        read_sections(file(10, 5, 2, 10, n_bytes=1500), PATH)


def test_a_parameter_without_the_byte_of_its_description():
    found = read_sections(file(10, 5, 2, 10, described=False), PATH)
    assert found.parameters["ANALOG:USED"] == [2.0]


def test_more_frames_than_the_header_can_count():
    n_frames = MAX_FRAMES + 465
    points = np.arange(n_frames * 4, dtype="<f4").reshape(n_frames, 1, 4)
    head = bytearray(512)
    head[:2] = 2, 0x50
    struct.pack_into("<4H", head, 2, 1, 0, 1, 65_535)
    struct.pack_into("<fHHf", head, 12, -1.0, 3, 0, 100.0)
    section = bytes([1, 0x50, 1, 84]) + struct.pack("<bb", 5, -1) + b"TRIAL" + b"\x03\0\0"
    for name, number in ((b"ACTUAL_START_FIELD", 1), (b"ACTUAL_END_FIELD", n_frames)):
        low, high = number % 65_536, number // 65_536
        entry = parameter(name, [0, 0])
        section += entry[:-5] + struct.pack("<2H", low, high) + b"\0"
    content = bytes(head) + (section + b"\0\0").ljust(512, b"\0") + points.tobytes()
    np.testing.assert_array_equal(read_sections(content, PATH).points, points)

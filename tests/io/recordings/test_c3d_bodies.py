"""C3D that holds segments in place of points (group ROTATION), put together here byte by byte."""

import struct

import ezc3d
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from besman.exceptions import RecordingError
from besman.io.recordings.formats import read_recording

CONCLUDING = pytest.mark.filterwarnings("ignore::besman.exceptions.RecordingWarning")
PLACES = {
    "head": [0, 0, 1.6], "torso": [0, 0, 1.4], "pelvis": [0, 0, 1.0],
    "l_uarm": [0, 0.2, 1.42], "l_larm": [0, 0.25, 1.1], "l_hand": [0.1, 0.3, 0.85],
    "r_uarm": [0, -0.2, 1.42], "r_larm": [0, -0.25, 1.1], "r_hand": [0.1, -0.3, 0.85],
    "l_thigh": [0, 0.1, 0.95], "l_foot": [0, 0.1, 0.08],
    "r_thigh": [0, -0.1, 0.95], "r_foot": [0, -0.1, 0.08],
}  # fmt: skip
N_FRAMES, N_BODIES, WIDTH, BLOCK = 12, len(PLACES), 16, 512
WALK = np.array(list(PLACES.values())) + 0.05 * np.sin(np.arange(N_FRAMES) / 10)[:, None, None]
TURNS = Rotation.random(N_FRAMES * N_BODIES, rng=1).as_matrix().reshape(N_FRAMES, N_BODIES, 3, 3)


def floats(values):
    return np.asarray(values, "<f4").tobytes()


def entry(group, name, kind=None, sides=(), data=b""):
    body = b"" if kind is None else struct.pack("bB", kind, len(sides)) + bytes(sides) + data
    body += b"\0"
    return struct.pack("bb", len(name), group) + name + struct.pack("<H", 2 + len(body)) + body


def whole(group, name, value):
    return entry(group, name, 2, (), struct.pack("<H", value))


def file(scale=1.0, ratio=1, first=1, unseen=()):
    numbers = np.zeros((N_FRAMES, N_BODIES, 17))
    matrices = np.tile(np.eye(4), (N_FRAMES, N_BODIES, 1, 1))
    matrices[..., :3, :3], matrices[..., :3, 3] = TURNS, scale * WALK
    numbers[..., :16] = matrices.swapaxes(-1, -2).reshape(N_FRAMES, N_BODIES, 16)
    for frame, body in unseen:
        numbers[frame, body] = [*16 * [0.0], -1.0]
    head = bytearray(BLOCK)
    head[:2] = 2, 0x50
    struct.pack_into("<5H", head, 2, 0, 0, first, first + N_FRAMES // ratio - 1, 10)
    head[12:16], head[20:24] = floats([-1.0]), floats([60.0])
    struct.pack_into("<H", head, 16, 4)
    labels = "".join(f"{name}_4X4".ljust(WIDTH) for name in PLACES).encode()
    section = bytes([1, 0x50, 2, 84]) + entry(-1, b"POINT") + whole(1, b"USED", 0)
    section += entry(-2, b"ROTATION") + whole(2, b"USED", N_BODIES) + whole(2, b"DATA_START", 4)
    section += whole(2, b"RATIO", ratio) + entry(2, b"RATE", 4, (), floats([60.0 * ratio]))
    section += entry(2, b"LABELS", -1, (WIDTH, N_BODIES), labels) + b"\0\0"
    data = floats(numbers)
    return bytes(head) + section.ljust(2 * BLOCK, b"\0") + data + b"\0" * (-len(data) % BLOCK)


@CONCLUDING
@pytest.mark.parametrize(("scale", "units"), [(1.0, "m"), (1000.0, "mm")])
@pytest.mark.parametrize(("ratio", "first"), [(1, 1), (1, 31), (2, 3)])
def test_segments_have_places_and_turns(tmp_path, scale, units, ratio, first):
    path = tmp_path / "a.c3d"
    path.write_bytes(file(scale, ratio, first, unseen=[(4, 2)]))
    found = read_recording(path)
    places = np.array(WALK)
    places[4, 2] = np.nan
    assert found.names == tuple(PLACES)
    np.testing.assert_allclose(found.positions, places, atol=5e-7)
    turned = Rotation.from_quat(found.orientations.reshape(-1, 4), scalar_first=True).as_matrix()
    turned = turned.reshape(TURNS.shape)
    kept = np.isfinite(places).all(axis=-1)
    np.testing.assert_allclose(turned[kept], TURNS[kept], atol=1e-6)
    assert (found.origin.units, found.rate_hz) == (units, 60.0 * ratio)
    assert found.time[0] == pytest.approx((first - 1) / 60.0)


@CONCLUDING
def test_ezc3d_reads_the_same(tmp_path):
    path = tmp_path / "a.c3d"
    path.write_bytes(file())
    other = ezc3d.c3d(str(path))["data"]["rotations"].transpose(3, 2, 0, 1)
    np.testing.assert_allclose(read_recording(path).positions, other[..., :3, 3], atol=1e-9)
    np.testing.assert_allclose(other[..., :3, :3], TURNS, atol=1e-6)


@CONCLUDING
def test_what_is_cut_is_one_line(tmp_path):
    path = tmp_path / "a.c3d"
    path.write_bytes(file()[: 3 * BLOCK + 5 * 17 * 4 * N_BODIES + 7])
    with pytest.raises(RecordingError, match="the file ends after 5 of 12 frames; is it cut"):
        read_recording(path)
    assert len(read_recording(path, partial=True).time) == 5
    content = file().replace(b"DATA_START", b"DATA_STARX")
    path.write_bytes(content)
    with pytest.raises(RecordingError, match="of 12 frames; is it cut"):
        read_recording(path)
    content = bytearray(file())
    struct.pack_into("<2H", content, 6, 9, 4)
    path.write_bytes(content)
    with pytest.raises(RecordingError, match="frames 9 to 4; expected frames that count up"):
        read_recording(path)

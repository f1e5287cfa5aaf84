"""C3D that holds segments in place of points (group ROTATION), put together byte by byte."""

import struct

import numpy as np
from scipy.spatial.transform import Rotation

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


def _floats(values):
    return np.asarray(values, "<f4").tobytes()


def _entry(group, name, kind=None, sides=(), data=b""):
    body = b"" if kind is None else struct.pack("bB", kind, len(sides)) + bytes(sides) + data
    body += b"\0"
    return struct.pack("bb", len(name), group) + name + struct.pack("<H", 2 + len(body)) + body


def _whole(group, name, value):
    return _entry(group, name, 2, (), struct.pack("<H", value))


def segments_file(scale=1.0, ratio=1, first=1, unseen=()):
    """Return a whole file: lengths times `scale`; places (frame, segment) that were not seen."""
    numbers = np.zeros((N_FRAMES, N_BODIES, 17))
    matrices = np.tile(np.eye(4), (N_FRAMES, N_BODIES, 1, 1))
    matrices[..., :3, :3], matrices[..., :3, 3] = TURNS, scale * WALK
    numbers[..., :16] = matrices.swapaxes(-1, -2).reshape(N_FRAMES, N_BODIES, 16)
    for frame, body in unseen:
        numbers[frame, body] = [*16 * [0.0], -1.0]
    head = bytearray(BLOCK)
    head[:2] = 2, 0x50
    struct.pack_into("<5H", head, 2, 0, 0, first, first + N_FRAMES // ratio - 1, 10)
    head[12:16], head[20:24] = _floats([-1.0]), _floats([60.0])
    struct.pack_into("<H", head, 16, 4)
    labels = "".join(f"{name}_4X4".ljust(WIDTH) for name in PLACES).encode()
    section = bytes([1, 0x50, 2, 84]) + _entry(-1, b"POINT") + _whole(1, b"USED", 0)
    section += _entry(-2, b"ROTATION") + _whole(2, b"USED", N_BODIES) + _whole(2, b"DATA_START", 4)
    section += _whole(2, b"RATIO", ratio) + _entry(2, b"RATE", 4, (), _floats([60.0 * ratio]))
    section += _entry(2, b"LABELS", -1, (WIDTH, N_BODIES), labels) + b"\0\0"
    data = _floats(numbers)
    return bytes(head) + section.ljust(2 * BLOCK, b"\0") + data + b"\0" * (-len(data) % BLOCK)

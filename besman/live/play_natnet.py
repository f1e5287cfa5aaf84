"""A recording, served as OptiTrack Motive serves a capture: NatNet 3.1 over loopback, by unicast.

For trying what follows a stream without a laboratory. What it speaks is as much of the protocol as
a client that asks for markers needs, as the client of ``natnet`` reads it.
"""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Callable

import numpy as np

from besman.exceptions import WebError
from besman.geometry.gaps import find_seen
from besman.live.natnet_source import PORT
from besman.live.play_qtm import AS_SENT, Delays
from besman.live.playing import schedule_frames
from besman.records import FloatArray, Recording

_HOST = "127.0.0.1"
_CONNECT, _SERVER_INFO, _ASK_MODEL, _MODEL, _FRAME = 0, 1, 4, 5, 7
_PROTOCOL = (3, 1, 0, 0)
_SET = b"person\0"


def play_as_natnet(
    recording: Recording,
    delays: Delays = AS_SENT,
    port: int = PORT,
    say: Callable[[str], None] = lambda line: None,
) -> None:
    """Serve a recording, y up, to the first client that asks what there is; return when it is over.

    Times in frames are those of this machine's clock (`time.perf_counter`) when a frame was due at
    the recording's own pace.

    Parameters
    ----------
    recording : Recording
        Without names its markers are unlabelled.
    delays : Delays
    port : int
        0 for any that is free.
    say : callable
        Is told where it listens, and when it plays.

    Raises
    ------
    WebError
        If the port is taken.
    """
    server = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        server.bind((_HOST, port))
    except OSError as error:
        server.close()
        raise WebError(f"port {port}: cannot be listened at: {error.strerror}") from None
    with server:
        say(f"waiting at natnet://{_HOST}:{server.getsockname()[1]}")
        client = _wait_for_client(server, recording)
        say(f"playing {len(recording.time) / recording.rate_hz:.1f} s")
        _play(server, client, recording, delays)


def _wait_for_client(server: socket.socket, recording: Recording) -> tuple[str, int]:
    """Answer until somebody has asked what markers there are; return who."""
    while True:
        request, (host, port) = server.recvfrom(1 << 16)
        client = (str(host), int(port))
        kind = int.from_bytes(request[:2], "little")
        if kind == _CONNECT:
            about = b"besman play".ljust(256, b"\0") + bytes((1, 0, 0, 0)) + bytes(_PROTOCOL)
            server.sendto(_pack(_SERVER_INFO, about), client)
        elif kind == _ASK_MODEL:
            server.sendto(_pack(_MODEL, _describe(recording)), client)
            return client


def _play(
    server: socket.socket, client: tuple[str, int], recording: Recording, delays: Delays
) -> None:
    times, rows = schedule_frames(
        len(recording.time),
        recording.rate_hz,
        delays.pace,
        delays.lose,
        delays.late_s,
        delays.seed,
    )
    begun = time.perf_counter()
    # y up, as Motive's own setting has it: x stays, and what was z is y.
    turned = recording.positions[:, :, [0, 2, 1]] * [1.0, 1.0, -1.0]
    for at, row in zip(times.tolist(), rows.tolist(), strict=True):
        time.sleep(max(0.0, begun + at - time.perf_counter()))
        due = begun + row / recording.rate_hz
        named = any(recording.names)
        server.sendto(_pack(_FRAME, _describe_frame(row, due, turned[row], named)), client)


def _pack(kind: int, body: bytes) -> bytes:
    return struct.pack("<HH", kind, len(body)) + body


def _describe(recording: Recording) -> bytes:
    """Return the description of one set of markers; of none where they have no names."""
    if not any(recording.names):
        return struct.pack("<I", 0)
    names = b"".join((name or "").encode() + b"\0" for name in recording.names)
    return struct.pack("<II", 1, 0) + _SET + struct.pack("<I", len(recording.names)) + names


def _describe_frame(number: int, due_s: float, places: FloatArray, named: bool) -> bytes:
    """Return a frame: a set of markers or unlabelled ones, none of anything else, and its time."""
    seen = find_seen(places)
    sets, loose = b"", b""
    if named:
        # One that is hidden is at the origin.
        shown = np.where(seen[:, np.newaxis], places, 0.0).astype("<f4").tobytes()
        sets = _SET + struct.pack("<I", len(places)) + shown
    else:
        loose = places[seen].astype("<f4").tobytes()
    counts = struct.pack("<II", number, int(named)) + sets
    counts += struct.pack("<I", len(loose) // 12) + loose + struct.pack("<5I", 0, 0, 0, 0, 0)
    return counts + struct.pack("<IIdQQQH", 0, 0, due_s, 0, 0, 0, 0)

"""Live streams, whole and broken: what a network sends, and sources that say what a file holds.

A stream is a file of JSON; what its sources make of any number is what the wires can carry.
"""

import json
import math
import struct
from functools import cache

import numpy as np
from fuzz.mutations import LEAVES, cut, flip, splice, tree
from fuzz.odd_values import NAMES
from places import SAMPLE

N_FRAMES, RATE_HZ = 70, 50.0


@cache
def sample():
    """Return names and positions (T, M, 3), metres, of a person who is about to throw."""
    from besman.io.recordings.formats import read_recording

    recording = read_recording(SAMPLE / "subject1.tsv")
    return recording.names, recording.positions[100 : 100 + 2 * N_FRAMES : 2]


@cache
def stream():
    names, positions = sample()
    packets = [
        [row, row / RATE_HZ, np.round(frame, 4).tolist()] for row, frame in enumerate(positions)
    ]
    content = {"names": names, "rate_hz": RATE_HZ, "packets": packets}
    return {"a.json": json.dumps(content).encode()}


@cache
def qtm():
    """Return what QTM says of itself, and packets of the protocol as they come."""
    names, positions = sample()
    labels = "".join(f"<Label><Name>{name}</Name></Label>" for name in names)
    settings = (
        f"<QTM_Parameters_Ver_1.19><General><Frequency>{RATE_HZ:g}</Frequency></General><The_3D>"
        f"<AxisUpwards>+Z</AxisUpwards><Labels>{len(names)}</Labels>{labels}</The_3D>"
        "</QTM_Parameters_Ver_1.19>"
    )
    packets = []
    for row, frame in enumerate(positions):
        body = (1e3 * frame).astype("<f4").tobytes()
        head = struct.pack(
            "<qIIIIIhh", 20_000 * row, row + 1, 1, 16 + len(body), 1, len(names), 0, 0
        )
        packets.append(struct.pack("<II", 8 + len(head + body), 3) + head + body)
    return {"a.xml": settings.encode(), "a.bin": b"".join(packets)}


@cache
def natnet():
    """Return datagrams of NatNet, each behind its length, as `besman play` serves them."""
    from besman.live import play_natnet
    from besman.records import Recording

    names, positions = sample()
    recording = Recording(
        np.arange(len(positions)) / RATE_HZ, positions, tuple(names), RATE_HZ, "x"
    )
    about = b"x".ljust(256, b"\0") + bytes((1, 0, 0, 0, 3, 1, 0, 0))
    turned = positions[:, :, [0, 2, 1]] * [1.0, 1.0, -1.0]
    sent = [play_natnet._pack(1, about), play_natnet._pack(5, play_natnet._describe(recording))]
    sent += [
        play_natnet._pack(7, play_natnet._describe_frame(row, row / RATE_HZ, frame, True))
        for row, frame in enumerate(turned)
    ]
    return {"a.bin": join(sent)}


def join(datagrams):
    return b"".join(struct.pack("<I", len(one)) + one for one in datagrams)


def split(content):
    """Return datagrams; what is cut counts as one."""
    found = []
    while len(content) >= 4:
        end = 4 + min(int.from_bytes(content[:4], "little"), 1 << 16)
        found.append(content[4:end])
        content = content[end:]
    return found


def break_datagrams(rng, content):
    """Break datagrams: counts and other fields, bytes anywhere, ends, order."""
    changed = [bytearray(one) for one in split(content)]
    for _ in range(rng.choice((1, 1, 2, 4))):
        at = rng.randrange(min(len(changed), rng.choice((2, 99))))
        one = changed[at]
        action = rng.randrange(7)
        if action == 0:
            del changed[at]
        elif action == 1:
            changed.insert(rng.randrange(len(changed)), bytearray(one))
        elif action == 2:
            del one[rng.randrange(len(one) + 1) :]
            one[2:4] = max(0, len(one) - 4).to_bytes(2, "little")
        elif action == 3 and len(one) > 8:
            one[:] = rng.choice((cut, flip, splice))(rng, bytes(one))
        elif len(one) >= 12:
            # Kind and size, frame, counts, names, coordinates, and the time at the end.
            place = rng.choice(
                (0, 4, 8, 12, 19, 23, len(one) - 34, len(one) - 30, rng.randrange(len(one) - 4))
            )
            value = rng.choice(
                (0, 1, 2, 10, 2**16, 2**31, 2**32 - 1, 0x7FC00000, 0x7F800000, 0x47C35000)
            )
            for other in changed[at : at + rng.choice((1, 1, 5, 99))]:
                if 0 <= place <= len(other) - 4:
                    other[place : place + 4] = value.to_bytes(4, "little")
        changed = changed or [bytearray(4)]
    return join(changed)


@cache
def lsl():
    names, positions = sample()
    content = {
        "labels": [f"{name}_{axis}" for name in names for axis in "XYZ"],
        "types": [f"Position{axis}" for _ in names for axis in "XYZ"],
        "units": ["meters"] * (3 * len(names)),
        "rate_hz": RATE_HZ,
        "samples": [
            [row / RATE_HZ, np.round(frame, 4).ravel().tolist()]
            for row, frame in enumerate(positions)
        ],
    }
    return {"a.json": json.dumps(content).encode()}


def break_stream(rng, content):
    """Break a stream: its head, times, numbers, order, frames, or one value anywhere."""
    about = json.loads(content)
    rows = about["packets" if "packets" in about else "samples"]
    for _ in range(rng.choice((1, 1, 2, 3))):
        at = rng.randrange(len(rows))
        _CHANGES[rng.randrange(len(_CHANGES))](rng, about, rows, at)
    if rng.random() < 0.3:
        about = tree(rng, about)
    return json.dumps(about).encode("utf-8", "surrogatepass")


def _head(rng, about, rows, at):
    key = rng.choice([key for key in about if about[key] is not rows])
    if isinstance(about[key], list) and about[key]:
        about[key][rng.randrange(len(about[key]))] = rng.choice((*NAMES, None))
    else:
        about[key] = rng.choice(LEAVES)


def _lose(rng, about, rows, at):
    del rows[at : at + rng.choice((1, 3, 20, 60))]
    if not rows:
        rows.append([0, 0.0, []])


def _twice(rng, about, rows, at):
    rows.insert(rng.randrange(len(rows)), rows[at])


def _swap(rng, about, rows, at):
    other = rng.randrange(len(rows))
    rows[at], rows[other] = rows[other], rows[at]


def _count(rng, about, rows, at):
    """Let numbers or times jump, of one packet or of all from there on."""
    column = rng.randrange(len(rows[at]) - 1)
    new, last = rng.choice(LEAVES), at + rng.choice((1, 1, 3, len(rows)))
    for row in rows[at:last]:
        both = isinstance(new, int | float) and isinstance(row[column], int | float)
        row[column] = row[column] + new if both else new


def _place(rng, about, rows, at):
    """Let coordinates of some frames be something else."""
    value = rng.choice((None, 0.0, 1e30, 1e300, float("inf"), float("nan"), 99.999, 2000.0, -3.0))
    factor = rng.choice((0.0, 1e3, 1e-3, -1.0))
    for row in rows[at : at + rng.choice((1, 1, 4, len(rows)))]:
        flat = row[-1]
        if not isinstance(flat, list) or not flat:
            continue
        if rng.random() < 0.5:
            flat[rng.randrange(len(flat))] = value
        else:
            row[-1] = [
                [factor * x if isinstance(x, float) else x for x in one]
                if isinstance(one, list)
                else factor * one
                if isinstance(one, float)
                else one
                for one in flat
            ]


_CHANGES = (_head, _lose, _twice, _swap, _count, _count, _place, _place, _place)


def break_packets(rng, content):
    """Break packets: bytes anywhere, fields of their heads, places, order."""
    if rng.random() < 0.2:
        return rng.choice((cut, flip, splice))(rng, content)
    size = len(content) // N_FRAMES
    changed = [bytearray(content[at : at + size]) for at in range(0, len(content), size)]
    for _ in range(rng.choice((1, 1, 2, 4))):
        at = rng.randrange(len(changed))
        action = rng.randrange(6)
        if action == 0:
            del changed[at]
        elif action == 1:
            changed.insert(rng.randrange(len(changed)), changed[at])
        elif action == 2:
            # Size, type, time, frame, components, size, type, count of markers.
            place = rng.choice((0, 4, 8, 12, 16, 20, 24, 28, 32))
            for one in changed[at : at + rng.choice((1, 1, 5, 99))]:
                value = rng.choice((0, 1, 2, 12, 14, 255, 2**31, 2**32 - 1))
                one[place : place + 4] = value.to_bytes(4, "little")
        elif action == 3:
            short = changed[at]
            del short[-rng.choice((1, 4, 12)) :]
            short[:4] = len(short).to_bytes(4, "little")
        else:
            place = 40 + 4 * rng.randrange((size - 40) // 4)
            value = rng.choice((0.0, 1e30, -3e38, 99999.0, math.nan, math.inf, 2e6))
            changed[at][place : place + 4] = np.float32(value).tobytes()
        changed = changed or [bytearray(content[:size])]
    return b"".join(changed)


def number(value):
    """Return a value as the float that a wire carries; NaN of what is none."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return math.nan
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def places(value, n):
    """Return positions (n, 3) of any tree; what is missing was not seen."""
    found = np.full((n, 3), np.nan)
    for row, one in zip(range(n), value if isinstance(value, list) else (), strict=False):
        flat = one if isinstance(one, list) else [one]
        for axis, coordinate in zip(range(3), flat, strict=False):
            found[row, axis] = number(coordinate)
    return found


def texts(value):
    return [None if one is None else str(one) for one in value] if isinstance(value, list) else []

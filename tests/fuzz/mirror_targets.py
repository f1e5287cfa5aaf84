"""What lies behind streams: an arm that does what a hand does, and bags that are being written."""

import json
import tempfile
import warnings
from contextlib import nullcontext
from functools import cache
from pathlib import Path
from unittest import mock

import numpy as np
from fuzz import binary_mutations, stream_targets, streams
from fuzz.target import Target
from growing_bags import McapWriter, SqliteWriter
from places import SAMPLE

from besman.exceptions import RecordingWarning


@cache
def _mirror_plan():
    """Place an arm by the first seconds of the sample, once."""
    from besman.following.frame_stream import FrameStream
    from besman.following.hand_placement import MirrorPlan, learn_placement
    from besman.following.hand_stream import HandStream
    from besman.live.file_source import FileSource
    from besman.robot.model import load_robot

    stream = FrameStream(FileSource(SAMPLE / "subject1.tsv", 0.0), "right_arm")
    rate_hz = stream.open().rate_hz
    hand, poses = HandStream(stream.blank, "right"), []

    def take(frame):
        poses.append(hand.take(frame.markers))
        return []

    with mock.patch("besman.following.frame_stream.keep_meanwhile", nullcontext):
        list(stream.run(take))
    robot = load_robot("ur5")
    rows = [row for row, one in enumerate(poses[:1000]) if one is not None]
    seen = np.array([poses[row] for row in rows])
    placement = learn_placement(robot, np.array(rows) / rate_hz, seen)
    return MirrorPlan(robot, "right_arm", placement=placement)


def mirror(folder):
    """Let an arm do what the hand of a stream does; return lines, its set-points, and the arm."""
    from besman.following.mirror import Mirror

    source = stream_targets.Told(json.loads((folder / "a.json").read_bytes()))
    given = []
    twin = Mirror(source, _mirror_plan(), by_frames=True, take=given.append)
    twin.open()
    with mock.patch("besman.following.frame_stream.keep_meanwhile", nullcontext):
        lines = list(twin.run())
    for line in lines:
        if line.get("kind") == "notice":
            warnings.warn(line["text"], RecordingWarning, stacklevel=1)
    return lines, [np.concatenate(parts) for parts in zip(*given, strict=True)], twin.robot


def of_mirror(folder, found):
    """Return what an arm must not be told."""
    from besman.robot.limits import check_limits

    lines, samples, robot = found
    if not samples:
        return []
    problems = set()
    if not all(np.isfinite(one).all() for one in samples):
        problems.add("set-points that are no numbers")
    elif not check_limits(robot, *samples).kept:
        problems.add("set-points beyond a limit")
    if np.abs(samples[1][-1]).max() > 1e-9:
        problems.add("an arm that does not rest at the end")
    if np.abs(np.diff(samples[0], axis=0)).max(initial=0.0) > 1e-2:
        problems.add("an arm that jumps")
    try:
        json.dumps(lines, allow_nan=False)
    except ValueError:
        problems.add("a line that is no JSON")
    return sorted(problems)


@cache
def growing(ending, chunk_bytes=None):
    """Return a bag without its end, of a person's markers."""
    from besman.io.log_content import LoggedMarkers
    from besman.io.ros_logs import MARKERS, marker_messages

    names, positions = streams.sample()
    time = 1.0 + np.arange(len(positions)) / streams.RATE_HZ
    messages, definition = marker_messages(LoggedMarkers(time, positions, names), Path("x"))
    rows = [("/markers", MARKERS, definition, at, data) for at, data in messages]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"a{ending}"
        if ending == ".db3":
            writer = SqliteWriter(path, "DELETE")
            writer.write_all(rows)
            writer.close()
        else:
            writer = McapWriter(path, chunk_bytes, "NONE")
            for one in rows:
                writer.write(*one)
            writer.abandon()
        return {path.name: path.read_bytes()}


def follow_growing(ending, folder):
    from besman.live.bag_source import BagSource

    source = BagSource(folder / f"a{ending}", from_start=True, wait_s=0.03)
    with mock.patch("besman.live.growing_sqlite._TORN_S", 0.03):
        return stream_targets.follow(source, folder)


def _bag(ending, chunk_bytes, share):
    name = f"a{ending}"
    return Target(
        lambda: growing(ending, chunk_bytes),
        {name: binary_mutations.bag},
        lambda folder: follow_growing(ending, folder),
        stream_targets.of_stream,
        share,
    )


BEHIND_STREAMS = {
    "mirror": Target(streams.stream, {"a.json": streams.break_stream}, mirror, of_mirror, 3),
    "growing MCAP": _bag(".mcap", None, 3),
    "growing MCAP in chunks": _bag(".mcap", 20_000, 2),
    "growing SQLite": _bag(".db3", None, 2),
    "address bag": stream_targets.address("bag:a_bag?topic=/markers&from=start&wait=3"),
}

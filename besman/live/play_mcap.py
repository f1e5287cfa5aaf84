"""A recording, written as MCAP at its own pace, as a recorder of ROS 2 writes topics.

For trying what follows a growing bag without ROS. Each message is there at once, as with the
storage preset "fastwrite" of rosbag2.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from besman.exceptions import FileError, why_not_there
from besman.io.log_content import LoggedMarkers
from besman.io.ros_logs import MARKERS, marker_messages
from besman.live.play_qtm import AS_SENT, Delays
from besman.live.playing import schedule_frames
from besman.records import Recording

TOPIC = "/person/markers"
"""Markers are written to it, as in logs of runs."""


def play_as_mcap(
    recording: Recording,
    path: Path,
    delays: Delays = AS_SENT,
    say: Callable[[str], None] = lambda line: None,
    chunk_bytes: int | None = None,
) -> None:
    """Write a recording as ``visualization_msgs/MarkerArray``; return when it is over.

    Times in headers are those of this machine's clock (`time.perf_counter`) when a frame was due
    at the recording's own pace, times of logging those of the day.

    Parameters
    ----------
    recording : Recording
        Without names its markers are told apart by numbers.
    path : Path
        Not there yet.
    delays : Delays
    say : callable
        Is told when it plays.
    chunk_bytes : int, optional
        Messages are written in chunks of so many bytes; each by itself if not given.

    Raises
    ------
    FileError
        If the library is not installed, or the file is there, or cannot be written.
    """
    try:
        from mcap.writer import Writer
    except ImportError as error:
        reason = why_not_there(error, "mcap", "besman[ros]")
        raise FileError(f"{path}: cannot be written: {reason}") from None
    n, rate_hz = len(recording.time), recording.rate_hz
    times, rows = schedule_frames(n, rate_hz, delays.pace, delays.lose, delays.late_s, delays.seed)
    # Made before it begins, but for the moment of that.
    begun = time.perf_counter() + 0.2 + 5e-6 * recording.positions.size
    due = begun + np.arange(n) / rate_hz
    messages, definition = marker_messages(
        LoggedMarkers(due, recording.positions, recording.names), path
    )
    try:
        with path.open("xb") as file:
            writer = Writer(file, chunk_size=chunk_bytes or 1, use_chunking=chunk_bytes is not None)
            writer.start(profile="ros2", library="besman play")
            schema = writer.register_schema(MARKERS, "ros2msg", definition.encode())
            channel = writer.register_channel(TOPIC, "cdr", schema)
            say(f"playing {n / rate_hz:.1f} s into {path}")
            for at, row in zip(times.tolist(), rows.tolist(), strict=True):
                time.sleep(max(0.0, begun + at - time.perf_counter()))
                logged = time.time_ns()
                writer.add_message(channel, logged, messages[row][1], logged, row)
                # What is written can be read at once.
                file.flush()
            writer.finish()
    except FileExistsError:
        raise FileError(f"{path}: is there already; expected a new name") from None
    except OSError as error:
        raise FileError(f"{path}: cannot be written: {error.strerror}") from None

"""A recording, announced as a stream of Lab Streaming Layer on this machine.

For trying what follows a stream without a laboratory.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from besman.exceptions import WebError, why_not_there
from besman.live.play_qtm import AS_SENT, Delays
from besman.live.playing import schedule_frames
from besman.records import Recording

# Streams are found on this machine alone.
_ONLY_HERE = "[multicast]\nResolveScope = machine\n[log]\nlevel = -2\n"
_AFTERWARDS_S = 0.5


def announce_only_here() -> None:
    """Have liblsl look for streams, and announce them, on this machine alone.

    To be called before anything else of it; where it has begun already it stays as it was.

    Raises
    ------
    WebError
        If it is not installed.
    """
    try:
        import pylsl
    except (ImportError, RuntimeError) as error:
        reason = (
            why_not_there(error, "pylsl", "besman[lsl]")
            if isinstance(error, ImportError)
            else str(error)
        )
        raise WebError(f"--as lsl: {reason}") from None
    pylsl.set_config_content(_ONLY_HERE)


def play_as_lsl(
    recording: Recording,
    name: str,
    delays: Delays = AS_SENT,
    say: Callable[[str], None] = lambda line: None,
    wait_s: float = 3600.0,
) -> None:
    """Announce a stream, play the recording to the first who listens; return when it is over.

    Stamps are those of liblsl's clock when a frame was due at the recording's own pace.

    Parameters
    ----------
    recording : Recording
    name : str
        Of the stream.
    delays : Delays
    say : callable
        Is told when it is announced, and when it plays.
    wait_s : float
        How long to wait for a listener.

    Raises
    ------
    WebError
        If liblsl is not installed, or nobody listened.
    """
    announce_only_here()
    import pylsl

    rate_hz = recording.rate_hz
    n_channels = 3 * len(recording.names)
    about = pylsl.StreamInfo(name, "MoCap", n_channels, rate_hz, "float32", f"besman play {name}")
    if any(recording.names):
        labels = [f"{marker or ''}_{axis}" for marker in recording.names for axis in "XYZ"]
        about.set_channel_labels(labels)
        about.set_channel_types([f"Position{label[-1]}" for label in labels])
    about.set_channel_units("meters")
    outlet = pylsl.StreamOutlet(about)
    say(f"waiting as lsl:{name}")
    deadline = time.perf_counter() + wait_s
    while not outlet.wait_for_consumers(0.2):
        if time.perf_counter() > deadline:
            raise WebError(f"lsl:{name}: nobody listened within {wait_s:g} s")
    say(f"playing {len(recording.time) / recording.rate_hz:.1f} s")
    times, rows = schedule_frames(
        len(recording.time),
        recording.rate_hz,
        delays.pace,
        delays.lose,
        delays.late_s,
        delays.seed,
    )
    begun, begun_lsl = time.perf_counter(), pylsl.local_clock()
    samples = recording.positions.astype(np.float32).reshape(len(recording.time), -1)
    for at, row in zip(times.tolist(), rows.tolist(), strict=True):
        time.sleep(max(0.0, begun + at - time.perf_counter()))
        outlet.push_sample(samples[row], begun_lsl + row / rate_hz)
    # What is on its way arrives.
    time.sleep(_AFTERWARDS_S)

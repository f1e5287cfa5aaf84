"""A recording as a stream, at its own pace or faster."""

from __future__ import annotations

import time
from pathlib import Path

from besman.io.recordings.formats import read_recording
from besman.live.stream import Packet, StreamFormat
from besman.records import Recording


class FileSource:
    """``file://PATH``.

    Parameters
    ----------
    path : Path
    pace : float
        Seconds of the recording in a second; 0: as fast as it is read.

    Attributes
    ----------
    is_paced : bool
        Whether frames come as time passes.
    """

    def __init__(self, path: Path, pace: float) -> None:
        self._path, self._pace = path, pace
        self._recording: Recording | None = None
        self._row = 0
        self._begun_s = 0.0
        self.is_paced = pace > 0
        self.ended = False

    def open(self) -> StreamFormat:
        """Read the recording; see `besman.live.stream.Source.open`."""
        recording = self._recording = read_recording(self._path)
        self.ended = not len(recording.time)
        return StreamFormat(recording.source, recording.names, recording.rate_hz)

    def start(self) -> None:
        """Let the first frame be due."""
        self._begun_s = time.perf_counter()

    def read(self, timeout_s: float) -> Packet | None:
        """Return the next frame when it is due."""
        if self._recording is None or self.ended:
            return None
        at_s = self._row / self._recording.rate_hz
        if self._pace > 0:
            wait_s = self._begun_s + at_s / self._pace - time.perf_counter()
            time.sleep(max(0.0, min(wait_s, timeout_s)))
            if wait_s > timeout_s:
                return None
        packet = Packet(at_s, self._recording.positions[self._row], time.perf_counter(), self._row)
        self._row += 1
        self.ended = self._row == len(self._recording.time)
        return packet

    def close(self) -> None:
        """Do nothing: the file was read."""

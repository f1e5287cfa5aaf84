"""Markers of a ROS 2 bag that is being written: topics as a live source, without ROS.

The extra ``ros``. ``ros2 bag record`` writes, this reads behind it: what is read is as late as the
writer lets it be. Messages of an MCAP file are written in chunks, of some seconds by default, one
by one with ``--storage-preset-profile fastwrite``; into SQLite as they come.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path

from besman.exceptions import RecordingError, why_not_there
from besman.io.recordings.conventions import turn
from besman.io.recordings.lengths import UNIT_M, in_metres
from besman.io.ros_messages import RawMessage
from besman.live.growing_bag import GrowingBag
from besman.live.ros_frames import RosFrames, Timed
from besman.live.stream import Packet, StreamFormat
from besman.records import Axis

_POLL_S = 0.004
# Of many topics, what is enough to tell names and rate.
_KEPT = 5000


class BagSource:
    """``bag:PATH`` or ``mcap:PATH``.

    Parameters
    ----------
    path : Path
        The folder that rosbag2 writes, or a file.
    topics : tuple of str
        Which topics are taken; by default those of markers, else of poses.
    from_start : bool
        Whether what was written before is given too. A bag that was closed is given whole.
    units, up : str, optional
        Where they are not those of ROS: metres, z up.
    wait_s : float
        How long to wait for the bag, and for what is next in it, seconds.
    """

    def __init__(
        self,
        path: Path,
        topics: tuple[str, ...] = (),
        from_start: bool = False,
        units: str | None = None,
        up: Axis | None = None,
        wait_s: float = 10.0,
    ) -> None:
        self._name = f"bag:{path}"
        self._path, self._from_start, self._wait_s = path, from_start, wait_s
        self._scale = 1.0 if units is None else UNIT_M[units]
        self._up: Axis = up or "z"
        self._bag = GrowingBag(path)
        self._frames = RosFrames(self._name, topics)
        self._packets: deque[Packet] = deque()
        self._last_s = 0.0
        self._over = False

    @property
    def ended(self) -> bool:
        """See `besman.live.stream.Source.ended`."""
        return self._over and not self._packets

    def open(self) -> StreamFormat:
        """Wait for the bag, and for enough messages to tell names and rate; see `Source.open`."""
        for library, package in (("rosbags", "rosbags"), ("mcap", "mcap")):
            try:
                __import__(library)
            except ImportError as error:
                reason = why_not_there(error, package, "besman[ros]")
                raise RecordingError(f"{self._name}: {reason}") from None
        deadline = time.perf_counter() + self._wait_s
        while not self._bag.find_files():
            if time.perf_counter() > deadline:
                raise RecordingError(
                    f"{self._name}: no bag there within {self._wait_s:g} s; expected an .mcap or "
                    ".db3 file, or the folder that ros2 bag record writes"
                )
            time.sleep(_POLL_S)
        try:
            return self._find_format(deadline)
        except BaseException:
            self.close()
            raise

    def start(self) -> None:
        """Do nothing: what is written is there to be read."""
        self._last_s = time.perf_counter()

    def read(self, timeout_s: float) -> Packet | None:
        """Return the next packet; see `Source.read`."""
        deadline = time.perf_counter() + timeout_s
        while not self._packets and not self._over:
            self._take(self._bag.read_new())
            if self._packets or self._over:
                break
            left_s = deadline - time.perf_counter()
            if left_s <= 0:
                return None
            time.sleep(min(left_s, _POLL_S))
        if not self._packets:
            return None
        return self._packets.popleft()

    def close(self) -> None:
        """Let the files go."""
        self._over = True
        self._bag.close()

    def _find_format(self, deadline: float) -> StreamFormat:
        """Read until it is told what comes; what is to be given waits."""
        is_past = not (self._from_start or self._is_closed())
        if is_past:
            self._bag.skip_files()
        kept: deque[RawMessage] = deque(maxlen=_KEPT if is_past else None)
        given: list[RawMessage] = []
        found: StreamFormat | None = None
        while found is None or is_past:
            new = self._bag.read_new()
            kept.extend(new)
            if not is_past:
                given += new
            # What is there when nothing new comes is the past.
            is_past = is_past and bool(new)
            if not is_past:
                found = self._frames.describe(kept, self._bag.definitions)
            if found is None and not new:
                self._wait(deadline, kept)
        self._take(given)
        return found

    def _is_closed(self) -> bool:
        """Tell whether nobody writes the bag any more, by its own words."""
        if self._path.is_dir():
            return self._bag.is_closed
        with self._path.open("rb") as file:
            # An MCAP file that was closed ends as it begins.
            begin = file.read(8)
            file.seek(-8, 2)
            return begin.startswith(b"\x89MCAP0") and file.read() == begin

    def _wait(self, deadline: float, kept: deque[RawMessage]) -> None:
        """Wait a moment for what comes next."""
        if self._bag.ended or time.perf_counter() > deadline:
            # Says which topics are not those that are needed.
            why = "ended" if self._bag.ended else f"had within {self._wait_s:g} s"
            raise RecordingError(
                f"{self._name}: {why} no more than {len(kept)} messages; expected markers at some "
                "rate. MCAP is written in chunks: ros2 bag record --storage-preset-profile "
                "fastwrite, or ?wait=SECONDS"
            )
        time.sleep(_POLL_S)

    def _take(self, messages: list[RawMessage]) -> None:
        """Make packets of new messages, and note when there are none any more."""
        now = time.perf_counter()
        for message in messages:
            self._put(self._frames.take(message), now)
        if messages:
            self._last_s = now
        if self._bag.ended or (self._last_s and now - self._last_s > self._wait_s):
            self._put(self._frames.flush(), now)
            self._over = True

    def _put(self, frames: Iterator[Timed], now: float) -> None:
        for stamp_ns, positions, number in frames:
            places = in_metres(positions, self._scale)
            places = turn(places, self._up) if self._up != "z" else places
            self._packets.append(Packet(stamp_ns * 1e-9, places, now, number))

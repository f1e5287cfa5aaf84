"""Following a stream while it comes."""

from __future__ import annotations

import gc
import time
from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

import numpy as np

from besman.exceptions import BesmanError, FileError, RecordingError
from besman.following.follower import Follower
from besman.following.news import content_of_forecast, content_of_piece
from besman.following.plans import FollowPlan, make_follower
from besman.following.stream_labels import StreamChecks, StreamLabels
from besman.live.alignment import Aligner, Frame
from besman.live.capture import CaptureFile
from besman.live.stream import Source, StreamFormat
from besman.person.marker_set import load_marker_set
from besman.records import FloatArray

# How long a read waits: little where packets wait for one that is missing.
_IDLE_S, _WAITING_S = 0.05, 0.005
_WARM_S = 8.0
_KEPT = 60_000
_PATIENCE_S = 2.0


class LiveFollower:
    """Follows a source; says what changes, what comes next and how the stream fares.

    Parameters
    ----------
    source : Source
    plan : FollowPlan
        What is followed.
    horizon_blocks, steady_s
        See `besman.following.follower.Follower`.
    patience_s : float
        How long a packet may be late; see `besman.live.alignment.Aligner`.

    Attributes
    ----------
    times : array, shape (3, n)
        Seconds that each of the last frames took, of no more than 60 000: from its arrival until
        all that follows from it was taken; the same from the time in its packet, of use where the
        source's clock is `time.perf_counter` of this machine; and what of it this thread computed.
    """

    def __init__(
        self,
        source: Source,
        plan: FollowPlan,
        horizon_blocks: int | None = 20,
        steady_s: float = 0.2,
        patience_s: float = 0.06,
    ) -> None:
        self._source, self._plan = source, plan
        self._horizon, self._steady_s, self._patience_s = horizon_blocks, steady_s, patience_s
        # A session of hours must not fill the memory.
        self._times = np.empty((3, _KEPT))
        self._n_taken = 0
        self.follower: Follower | None = None
        self._n_waited = self._n_pushed = 0
        self._capture: CaptureFile | None = None
        self._failed: FileError | None = None

    def open(self, make_capture: Any = None) -> StreamFormat:
        """Connect to the source.

        Parameters
        ----------
        make_capture : callable, optional
            Makes the `CaptureFile` of what comes, of names and rate.

        Raises
        ------
        BesmanError
            If nobody answers, or the stream lacks a marker that is needed.
        """
        self._warm_up()
        found = self._format = self._source.open()
        # What is missing is said before anything is recorded.
        self._labels = StreamLabels(found, load_marker_set(self._plan.label.markers))
        self._checks = StreamChecks(found, self._labels, next(iter(self._plan.earlier), None))
        blank = self._labels.blank
        self.follower = make_follower(self._plan, blank, self._horizon, self._steady_s)
        self._aligner = Aligner(found.rate_hz, len(found.names), self._patience_s)
        if make_capture is not None:
            self._capture = make_capture(found.names, found.rate_hz)
        return found

    def run(self) -> Iterator[dict[str, Any]]:
        """Follow until the source ends or `stop` is called; yield what becomes known.

        Raises
        ------
        BesmanError
            As `Follower.push`; if the stream cannot be read any more, or be recorded.
        """
        aligner, restarts = self._aligner, 0
        # Nothing of what was made so far is looked through for garbage while packets wait.
        gc.collect()
        gc.freeze()
        self._source.start()
        try:
            while not self._source.ended:
                packet = self._source.read(_WAITING_S if aligner.waits else _IDLE_S)
                if packet is not None:
                    frames = aligner.take(packet)
                else:
                    frames = aligner.release(time.perf_counter())
                if aligner.delivery.restarts > restarts:
                    restarts = aligner.delivery.restarts
                    yield {"kind": "notice", "text": "the source began anew"}
                yield from self._take_all(frames)
        except BaseException:
            self._close()
            raise
        finally:
            gc.unfreeze()
        yield from self.end_now()

    def end_now(self) -> Iterator[dict[str, Any]]:
        """Let everything be final, and the recording whole; yield what becomes known by it.

        Raises
        ------
        BesmanError
            As `run`.
        """
        try:
            yield from self._take_all(self._aligner.flush())
            yield from self._finish()
        finally:
            self._close()
        yield {"kind": "end", **self.summary()}
        if self._failed is not None:
            raise self._failed

    @property
    def times(self) -> FloatArray:
        """How long the last frames took; see the class."""
        return self._times[:, : min(self._n_taken, _KEPT)]

    def summary(self) -> dict[str, Any]:
        """Return what became of the packets, and how long each frame took."""
        since_arrival = self.times[0] if self._n_taken else np.array([np.nan])
        median, high = 1e3 * np.percentile(since_arrival, (50, 99.9))
        return {
            "frames": self._n_pushed,
            **asdict(self._aligner.delivery),
            "latency_ms": {"median": float(median), "p99_9": float(high)},
        }

    def _take_all(self, frames: list[Frame]) -> Iterator[dict[str, Any]]:
        for frame in frames:
            begun_s = time.thread_time()
            yield from self._take(frame)
            busy_s, now = time.thread_time() - begun_s, time.perf_counter()
            row = now - frame.arrived_s, now - frame.sent_s, busy_s
            self._times[:, self._n_taken % _KEPT] = row
            self._n_taken += 1

    def _take(self, frame: Frame) -> Iterator[dict[str, Any]]:
        """Take one frame; nothing is followed before every required marker was seen together."""
        assert self.follower is not None
        positions = frame.positions
        if not self._n_pushed:
            missing = self._labels.find_unseen(positions)
            if missing is not None:
                yield from self._wait_for(missing)
                return
        self._checks.look_at(positions)
        yield from self._record(positions)
        rate_hz = self._format.rate_hz
        changes = self.follower.push(self._labels.label(positions))
        self._n_pushed += 1
        at_s = self._n_pushed / rate_hz
        for change in changes:
            piece = content_of_piece(change.piece, rate_hz)
            yield {"time_s": at_s, "status": change.status, **piece}
        for forecast in self.follower.look_ahead():
            yield {"kind": "next", **content_of_forecast(forecast, rate_hz)}

    def _finish(self) -> Iterator[dict[str, Any]]:
        if self.follower is None or not self._n_pushed:
            raise RecordingError(
                f"{self._format.source}: ended before every required marker was seen together"
            )
        rate_hz = self._format.rate_hz
        for change in self.follower.finish():
            piece = content_of_piece(change.piece, rate_hz)
            yield {"time_s": self._n_pushed / rate_hz, "status": change.status, **piece}

    def _wait_for(self, missing: str) -> Iterator[dict[str, Any]]:
        """Say once what is waited for."""
        self._n_waited += 1
        if self._n_waited == round(_PATIENCE_S * self._format.rate_hz):
            yield {"kind": "notice", "text": f"waiting until marker {missing} is seen"}

    def _record(self, positions: FloatArray) -> Iterator[dict[str, Any]]:
        """Record a frame; where that fails the stream is followed all the same."""
        if self._capture is None:
            return
        try:
            self._capture.add(positions)
        except FileError as error:
            self._failed = error
            self._close()
            yield {"kind": "notice", "text": f"{error}; the stream is followed on"}

    def _close(self) -> None:
        self._source.close()
        capture, self._capture = self._capture, None
        if capture is not None:
            capture.close()

    def _warm_up(self) -> None:
        """Have kernels loaded before the first packet, by a movement that was recorded earlier."""
        if not self._plan.earlier:
            return
        one = self._plan.earlier[0]
        n = min(len(one.time), round(_WARM_S * one.rate_hz))
        follower = make_follower(self._plan, one, self._horizon, self._steady_s)
        try:
            for sample in one.positions[:n]:
                follower.push(sample)
                follower.look_ahead()
        except BesmanError:
            # An earlier recording that cannot be followed does not concern this one.
            return

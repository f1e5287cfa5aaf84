"""Following a stream while it comes."""

from __future__ import annotations

import gc
import time
from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

import numpy as np

from besman.exceptions import BesmanError
from besman.following.follower import Follower
from besman.following.frame_stream import FrameStream, MakeCapture, NamedFrame
from besman.following.news import content_of_forecast, content_of_piece
from besman.following.plans import FollowPlan, make_follower
from besman.live.stream import Source, StreamFormat
from besman.records import FloatArray

_WARM_S = 8.0
_KEPT = 60_000


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
        self._plan, self._horizon, self._steady_s = plan, horizon_blocks, steady_s
        earlier = next(iter(plan.earlier), None)
        self._stream = FrameStream(source, plan.label.markers, earlier, patience_s)
        # A session of hours must not fill the memory.
        self._times = np.empty((3, _KEPT))
        self._n_taken = 0
        self.follower: Follower | None = None

    def open(self, make_capture: MakeCapture | None = None) -> StreamFormat:
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
        self._format = self._stream.open(make_capture)
        blank = self._stream.blank
        self.follower = make_follower(self._plan, blank, self._horizon, self._steady_s)
        self._stream.begin_recording()
        return self._format

    def run(self) -> Iterator[dict[str, Any]]:
        """Follow until the source ends or `stop` is called; yield what becomes known.

        Raises
        ------
        BesmanError
            As `Follower.push`; if the stream cannot be read any more, or be recorded.
        """
        # Nothing of what was made so far is looked through for garbage while packets wait.
        gc.collect()
        gc.freeze()
        self._stream.start()
        try:
            while not self._stream.ended:
                yield from self._take_all(self._stream.read())
        except BaseException:
            self._stream.close()
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
            yield from self._take_all(self._stream.flush())
            yield from self._finish()
        finally:
            self._stream.close()
        yield {"kind": "end", **self.summary()}
        self._stream.raise_failure()

    @property
    def times(self) -> FloatArray:
        """How long the last frames took; see the class."""
        return self._times[:, : min(self._n_taken, _KEPT)]

    def summary(self) -> dict[str, Any]:
        """Return what became of the packets, and how long each frame took."""
        since_arrival = self.times[0] if self._n_taken else np.array([np.nan])
        median, high = 1e3 * np.percentile(since_arrival, (50, 99.9))
        return {
            "frames": self._stream.n_frames,
            **asdict(self._stream.delivery),
            "latency_ms": {"median": float(median), "p99_9": float(high)},
        }

    def _take_all(self, news: Iterator[NamedFrame | str]) -> Iterator[dict[str, Any]]:
        begun_s = time.thread_time()
        for one in news:
            if isinstance(one, str):
                yield {"kind": "notice", "text": one}
                continue
            yield from self._take(one)
            busy_s, now = time.thread_time() - begun_s, time.perf_counter()
            row = now - one.arrived_s, now - one.sent_s, busy_s
            self._times[:, self._n_taken % _KEPT] = row
            self._n_taken += 1
            begun_s = time.thread_time()

    def _take(self, frame: NamedFrame) -> Iterator[dict[str, Any]]:
        """Take one frame."""
        assert self.follower is not None
        rate_hz = self._format.rate_hz
        changes = self.follower.push(frame.markers)
        at_s = self._stream.n_frames / rate_hz
        for change in changes:
            piece = content_of_piece(change.piece, rate_hz)
            yield {"time_s": at_s, "status": change.status, **piece}
        for forecast in self.follower.look_ahead():
            yield {"kind": "next", **content_of_forecast(forecast, rate_hz)}

    def _finish(self) -> Iterator[dict[str, Any]]:
        assert self.follower is not None
        rate_hz = self._format.rate_hz
        for change in self.follower.finish():
            piece = content_of_piece(change.piece, rate_hz)
            at_s = self._stream.n_frames / rate_hz
            yield {"time_s": at_s, "status": change.status, **piece}

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

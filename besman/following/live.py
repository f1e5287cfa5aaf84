"""Following a stream while it comes."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from besman.exceptions import BesmanError
from besman.following.follower import Follower
from besman.following.frame_stream import FrameStream, MakeCapture, NamedFrame, Told
from besman.following.json_events import content_of_forecast, content_of_piece
from besman.following.pieces import Change
from besman.following.plans import FollowPlan, learn_names_of, make_follower
from besman.live.stream import Source, StreamFormat
from besman.records import FloatArray

_WARM_S = 8.0
_SPEED_OVER_S = 0.1


class Present(NamedTuple):
    """What is shown of the present.

    Attributes
    ----------
    time_s : float
        Of the stream.
    names : tuple of str, length M
    markers : array, shape (M, 3)
        Laboratory frame, metres; NaN where not seen.
    confidence : dict of str to float
        How sure each name is, where names were found.
    speed_m_s : float
        Of the hands that are segmented; NaN where one is not seen.
    delay_ms : float
        How long the packet before took to become what was told.
    """

    time_s: float
    names: tuple[str, ...]
    markers: FloatArray
    confidence: dict[str, float]
    speed_m_s: float
    delay_ms: float


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
        self._stream = FrameStream(
            source, plan.label.markers, earlier, patience_s, learn_names=learn_names_of(plan)
        )
        self.follower: Follower | None = None
        self._places: deque[FloatArray] = deque(maxlen=2)
        self._present = Present(0.0, (), np.empty((0, 3)), {}, 0.0, float("nan"))

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
        hands = [name for arm in self.follower.arms for name in arm.hands]
        self._hands = [blank.markers.index(name) for name in hands]
        self._places = deque(maxlen=1 + max(1, round(_SPEED_OVER_S * self._format.rate_hz)))
        self._stream.begin_recording()
        return self._format

    def run(self) -> Iterator[dict[str, Any]]:
        """Follow until the source ends or `stop` is called; yield what becomes known.

        Raises
        ------
        BesmanError
            As `Follower.push`; if the stream cannot be read any more, or be recorded.
        """
        yield from self._stream.run(self._take, finish=self._finish)
        yield from self._tell_end()

    def end_now(self) -> Iterator[dict[str, Any]]:
        """Let everything be final, and the recording whole; yield what becomes known by it.

        Raises
        ------
        BesmanError
            As `run`.
        """
        yield from self._stream.end(self._take, self._finish)
        yield from self._tell_end()

    @property
    def times(self) -> FloatArray:
        """How long the last frames took; see `besman.following.frame_stream.FrameStream.times`."""
        return self._stream.times

    def summary(self) -> dict[str, Any]:
        """Return what became of the packets, and how long each frame took."""
        return self._stream.summary()

    def look(self) -> Present:
        """Return the present, from any thread."""
        return self._present

    def _tell_end(self) -> Iterator[dict[str, Any]]:
        yield {"kind": "end", **self.summary()}
        self._stream.raise_failure()

    def _take(self, frame: NamedFrame) -> Told:
        """Take one frame."""
        assert self.follower is not None
        told = self._tell_changes(self.follower.push(frame.markers))
        rate_hz = self._format.rate_hz
        self._places.append(frame.markers[self._hands])
        way_m = self._places[-1] - self._places[0]
        seconds = (len(self._places) - 1) / rate_hz
        self._present = Present(
            self._stream.n_frames / rate_hz,
            self._stream.blank.markers,
            frame.markers,
            self._stream.confidence,
            float(np.linalg.norm(way_m)) / seconds if seconds else 0.0,
            1e3 * self._stream.last_delay_s,
        )
        for forecast in self.follower.look_ahead():
            told.append({"kind": "next", **content_of_forecast(forecast, rate_hz)})
        return told

    def _finish(self) -> Told:
        assert self.follower is not None
        return self._tell_changes(self.follower.finish())

    def _tell_changes(self, changes: tuple[Change, ...]) -> Told:
        rate_hz = self._format.rate_hz
        at_s = self._stream.n_frames / rate_hz
        return [
            {"time_s": at_s, "status": one.status, **content_of_piece(one.piece, rate_hz)}
            for one in changes
        ]

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

"""Frames of a source with the names of a marker set, in order, checked and recorded."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, replace
from typing import Any, NamedTuple

import numpy as np

from besman.exceptions import FileError, RecordingError
from besman.following.impossible_samples import SampleGate
from besman.following.stream_labels import StreamChecks, StreamLabels
from besman.following.stream_names import LearnNames, StreamNames, needs_names
from besman.io.recordings.plausibility import check_names, check_rate
from besman.live.alignment import Aligner, Frame
from besman.live.capture import CaptureFile
from besman.live.stream import Source, StreamFormat
from besman.person.marker_set import load_marker_set
from besman.records import FloatArray, LabelledRecording
from besman.stages.label.model_from_pose import model_from_pose
from besman.work.garbage import keep_meanwhile

# How long a read waits: little where packets wait for one that is missing.
_IDLE_S, _WAITING_S = 0.05, 0.005
_PATIENCE_S = 2.0
_KEPT = 60_000

Told = list[dict[str, Any]]

MakeCapture = Callable[[Sequence[str | None], float], CaptureFile]


class NamedFrame(NamedTuple):
    """One frame of a person.

    Attributes
    ----------
    markers : array, shape (M, 3)
        Those of `FrameStream.blank`, metres; NaN where one was not seen.
    arrived_s, sent_s : float
        As of `besman.live.alignment.Frame`.
    """

    markers: FloatArray
    arrived_s: float
    sent_s: float


class FrameStream:
    """Reads a source; nothing is given before every required marker was seen together.

    Points without a name are named as they come, see `besman.following.stream_names`.

    Parameters
    ----------
    source : Source
    markers : str
        Name or path of the marker set.
    earlier : LabelledRecording, optional
        See `besman.following.stream_labels.StreamChecks`.
    patience_s : float
        How long a packet may be late; see `besman.live.alignment.Aligner`.
    idle_s : float
        How long a read waits for a packet.
    learn_names : callable
        Returns what the markers of a set look like, where points have no name; by default as in the
        set's own pose.

    Attributes
    ----------
    n_frames : int
        Frames that were given.
    blank : LabelledRecording
        One frame: what to expect; from `open` on.
    is_timed : bool
        Whether frames count in `times`.
    """

    def __init__(
        self,
        source: Source,
        markers: str,
        earlier: LabelledRecording | None = None,
        patience_s: float = 0.06,
        idle_s: float = _IDLE_S,
        learn_names: LearnNames = model_from_pose,
    ) -> None:
        self._source, self._markers, self._earlier = source, markers, earlier
        self._patience_s, self._idle_s, self._learn = patience_s, idle_s, learn_names
        self.n_frames, self.is_timed = 0, True
        self._n_waited = self._n_restarts = 0
        self._capture: CaptureFile | None = None
        self._failed: FileError | None = None
        self._names: StreamNames | None = None
        self._unseen: str | None = None
        # A session of hours must not fill the memory.
        self._times, self._n_timed = np.empty((3, _KEPT)), 0

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
        found = self._source.open()
        check_rate(found.rate_hz, found.source)
        found = self.format = replace(found, names=check_names(found.names, found.source))
        # What is missing is said before anything is recorded.
        marker_set, named = load_marker_set(self._markers), found
        if needs_names(found, marker_set):
            self._names = StreamNames(found, marker_set, self._learn(marker_set))
            named = self._names.format
        self._labels = StreamLabels(named, marker_set)
        self._checks = StreamChecks(named, self._labels, self._earlier)
        self.blank = self._labels.blank
        is_named = self._names is None
        self._gate, self._n_hidden = SampleGate(found.names, found.rate_hz, is_named), 0
        self._aligner = Aligner(found.rate_hz, len(found.names), self._patience_s)
        self._make_capture = make_capture
        return found

    def begin_recording(self) -> None:
        """Make the file of what is captured, if there is to be one.

        Raises
        ------
        FileError
            If it is there already, or cannot be written.
        """
        if self._make_capture is not None:
            self._capture = self._make_capture(self.format.names, self.format.rate_hz)

    def run(
        self,
        take: Callable[[NamedFrame], Told],
        between: Callable[[], Told] = list,
        finish: Callable[[], Told] = list,
    ) -> Iterator[dict[str, Any]]:
        """Have packets sent, and give frames until nothing will come any more.

        Parameters
        ----------
        take : callable
            Is given each frame, and returns what is to be told of it.
        between : callable
            Returns what is to be told besides, whenever a packet came or was waited for.
        finish : callable
            As of `end`.

        Yields
        ------
        dict
            What is to be told.

        Raises
        ------
        BesmanError
            If the stream cannot be read any more, or is no person in metres, z up.
        """
        # Nothing of what was made so far is looked through for garbage while packets wait.
        with keep_meanwhile():
            self._source.start()
            try:
                while not self._source.ended:
                    yield from self._pass_on(self._read(), take)
                    yield from between()
            except BaseException:
                self.close()
                raise
        yield from self.end(take, finish)

    def end(
        self, take: Callable[[NamedFrame], Told], finish: Callable[[], Told] = list
    ) -> Iterator[dict[str, Any]]:
        """Give the frames that wait for one that is missing, and make the recording whole.

        Parameters
        ----------
        take : callable
            As of `run`.
        finish : callable
            Returns what is to be told at the end.

        Raises
        ------
        BesmanError
            As `run`; if there was no frame at all.
        """
        try:
            yield from self._pass_on(self._give(self._aligner.flush()), take)
            if not self.n_frames:
                why = f": {self._names.waits_for}" if self._names is not None else ""
                raise RecordingError(
                    f"{self.format.source}: ended before every required marker was seen together"
                    + why
                )
            yield from finish()
        finally:
            self.close()

    @property
    def times(self) -> FloatArray:
        """Seconds of each of the last frames, of no more than 60 000, shape (3, n).

        From its arrival until `take` had returned; the same from the time in its packet, of use
        where the source's clock is `time.perf_counter` of this machine; and what of it this thread
        computed.
        """
        return self._times[:, : min(self._n_timed, _KEPT)]

    @property
    def confidence(self) -> dict[str, float]:
        """How sure the name of each marker is, where names were not given but found."""
        return {} if self._names is None else self._names.confidence

    @property
    def last_delay_s(self) -> float:
        """Seconds from the arrival of the last frame until `take` had returned."""
        return float(self._times[0, (self._n_timed - 1) % _KEPT])

    def summary(self) -> dict[str, Any]:
        """Return what became of the packets, and how long each frame took."""
        since_arrival = self.times[0] if self._n_timed else np.array([np.nan])
        median, high = 1e3 * np.percentile(since_arrival, (50, 99.9))
        return {
            "frames": self.n_frames,
            **asdict(self._aligner.delivery),
            "latency_ms": {"median": float(median), "p99_9": float(high)},
        }

    def _read(self) -> Iterator[NamedFrame | dict[str, Any]]:
        """Wait for a packet, not for long; yield frames, and what else is worth saying."""
        packet = self._source.read(_WAITING_S if self._aligner.waits else self._idle_s)
        if packet is not None:
            frames = self._aligner.take(packet)
        else:
            frames = self._aligner.release(time.perf_counter())
        if self._aligner.delivery.restarts > self._n_restarts:
            self._n_restarts = self._aligner.delivery.restarts
            yield _notice("the source began anew")
        yield from self._give(frames)

    def _pass_on(
        self,
        news: Iterator[NamedFrame | dict[str, Any]],
        take: Callable[[NamedFrame], Told],
    ) -> Iterator[dict[str, Any]]:
        begun_s = time.thread_time()
        for one in news:
            if isinstance(one, dict):
                yield one
                continue
            told = take(one)
            busy_s, now = time.thread_time() - begun_s, time.perf_counter()
            row = now - one.arrived_s, now - one.sent_s, busy_s
            if self.is_timed:
                self._times[:, self._n_timed % _KEPT] = row
                self._n_timed += 1
            yield from told
            begun_s = time.thread_time()

    def close(self) -> None:
        """Let the source go, and make the recording whole."""
        self._source.close()
        capture, self._capture = self._capture, None
        if capture is not None:
            capture.close()

    def raise_failure(self) -> None:
        """Say why the recording ended early, if it did.

        Raises
        ------
        FileError
            The disk was full, or gone.
        """
        if self._failed is not None:
            raise self._failed

    def _give(self, frames: list[Frame]) -> Iterator[NamedFrame | dict[str, Any]]:
        for frame in frames:
            recorded, seen = self._gate.take(frame.positions)
            if self._gate.hidden and not self._n_hidden:
                yield _notice(self._gate.first)
            self._n_hidden = self._gate.hidden
            positions: FloatArray | None = seen
            changes: Told = []
            if self._names is not None:
                positions, changes = self._names.take(seen)
            elif not self.n_frames:
                self._checks.check_distances(frame.positions)
            if positions is None or (not self.n_frames and self._find_unseen(positions)):
                self._n_waited += 1
                if self._n_waited == round(_PATIENCE_S * self.format.rate_hz):
                    yield _notice(self._say_waiting())
                continue
            self._checks.look_at(positions)
            yield from self._record(recorded)
            self.n_frames += 1
            if changes:
                at_s = self.n_frames / self.format.rate_hz
                yield {"kind": "names", "time_s": at_s, "changes": changes}
            yield NamedFrame(self._labels.label(positions), frame.arrived_s, frame.sent_s)

    def _find_unseen(self, positions: FloatArray) -> bool:
        """Tell whether a required marker is not seen, and remember which."""
        self._unseen = self._labels.find_unseen(positions)
        return self._unseen is not None

    def _say_waiting(self) -> str:
        """Say what did not come, once it was waited for long enough."""
        if self._unseen is not None:
            return f"waiting until marker {self._unseen} is seen"
        assert self._names is not None
        return f"waiting until a person is found among unnamed markers: {self._names.waits_for}"

    def _record(self, positions: FloatArray) -> Iterator[dict[str, Any]]:
        """Record a frame; where that fails the stream is read all the same."""
        if self._capture is None:
            return
        try:
            self._capture.add(positions)
        except FileError as error:
            self._failed = error
            capture, self._capture = self._capture, None
            capture.close()
            yield _notice(f"{error}; the stream is followed on")


def _notice(text: str) -> dict[str, Any]:
    return {"kind": "notice", "text": text}

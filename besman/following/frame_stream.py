"""Frames of a source with the names of a marker set, in order, checked and recorded."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

from besman.exceptions import FileError, RecordingError
from besman.following.impossible_samples import SampleGate
from besman.following.stream_labels import StreamChecks, StreamLabels
from besman.io.recordings.sense import check_names, check_rate
from besman.live.alignment import Aligner, Delivery, Frame
from besman.live.capture import CaptureFile
from besman.live.stream import Source, StreamFormat
from besman.person.marker_set import load_marker_set
from besman.records import FloatArray, LabelledRecording

# How long a read waits: little where packets wait for one that is missing.
_IDLE_S, _WAITING_S = 0.05, 0.005
_PATIENCE_S = 2.0

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

    Attributes
    ----------
    n_frames : int
        Frames that were given.
    blank : LabelledRecording
        One frame: what to expect; from `open` on.
    """

    def __init__(
        self,
        source: Source,
        markers: str,
        earlier: LabelledRecording | None = None,
        patience_s: float = 0.06,
        idle_s: float = _IDLE_S,
    ) -> None:
        self._source, self._markers, self._earlier = source, markers, earlier
        self._patience_s, self._idle_s = patience_s, idle_s
        self.n_frames = 0
        self._n_waited = self._n_restarts = 0
        self._capture: CaptureFile | None = None
        self._failed: FileError | None = None

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
        self._labels = StreamLabels(found, load_marker_set(self._markers))
        self._checks = StreamChecks(found, self._labels, self._earlier)
        self.blank = self._labels.blank
        self._gate, self._n_hidden = SampleGate(found.names, found.rate_hz), 0
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

    def start(self) -> None:
        """Have packets sent."""
        self._source.start()

    @property
    def ended(self) -> bool:
        """Whether nothing will come any more."""
        return self._source.ended

    @property
    def delivery(self) -> Delivery:
        """What became of the packets."""
        return self._aligner.delivery

    def read(self) -> Iterator[NamedFrame | str]:
        """Wait for a packet, not for long; yield frames, and in words what else is worth saying.

        Raises
        ------
        BesmanError
            If the stream cannot be read any more, or is no person in metres, z up.
        """
        packet = self._source.read(_WAITING_S if self._aligner.waits else self._idle_s)
        if packet is not None:
            frames = self._aligner.take(packet)
        else:
            frames = self._aligner.release(time.perf_counter())
        if self._aligner.delivery.restarts > self._n_restarts:
            self._n_restarts = self._aligner.delivery.restarts
            yield "the source began anew"
        yield from self._give(frames)

    def flush(self) -> Iterator[NamedFrame | str]:
        """Yield the frames that wait for one that is missing.

        Raises
        ------
        BesmanError
            As `read`; if there was no frame at all.
        """
        yield from self._give(self._aligner.flush())
        if not self.n_frames:
            raise RecordingError(
                f"{self.format.source}: ended before every required marker was seen together"
            )

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

    def _give(self, frames: list[Frame]) -> Iterator[NamedFrame | str]:
        for frame in frames:
            recorded, positions = self._gate.take(frame.positions)
            if self._gate.hidden and not self._n_hidden:
                yield self._gate.first
            self._n_hidden = self._gate.hidden
            if not self.n_frames:
                self._checks.check_distances(frame.positions)
            missing = None if self.n_frames else self._labels.find_unseen(positions)
            if missing is not None:
                self._n_waited += 1
                if self._n_waited == round(_PATIENCE_S * self.format.rate_hz):
                    yield f"waiting until marker {missing} is seen"
                continue
            self._checks.look_at(positions)
            yield from self._record(recorded)
            self.n_frames += 1
            yield NamedFrame(self._labels.label(positions), frame.arrived_s, frame.sent_s)

    def _record(self, positions: FloatArray) -> Iterator[str]:
        """Record a frame; where that fails the stream is read all the same."""
        if self._capture is None:
            return
        try:
            self._capture.add(positions)
        except FileError as error:
            self._failed = error
            capture, self._capture = self._capture, None
            capture.close()
            yield f"{error}; the stream is followed on"

"""The segmentation stage: recordings to building blocks."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field

from besman.exceptions import SegmentationError
from besman.records import LabelledRecording, Segments
from besman.segmentation.signals import prepare_signals, resample
from besman.segmentation.vmci import VmciModel, find_change_points, merge_single_samples
from besman.stage import Stage, Work


class SegmentConfig(Stage):
    """Velocity-based multiple change-point inference, exact.

    Attributes
    ----------
    rate_hz : float
        Rate at which the movement is looked at; the thesis takes 20 Hz for slow and 30 Hz for fast
        movements. A recording with a lower rate is taken as it is.
    markers : tuple of str
        Markers of the hand (or hands) whose speed is bell-shaped.
    n_centres : int
        Positions that the peak of a bell may have in its segment.
    longest_s : float, optional
        Greatest duration of a segment, seconds.
    border_probability : float, optional
        Probability of a border at a sample; one over the number of samples if not given.
    """

    method: Literal["vmci"] = "vmci"
    rate_hz: float = Field(default=20.0, gt=0)
    markers: Annotated[tuple[str, ...], Field(min_length=1)] = ("hand_top",)
    n_centres: int = Field(default=3, ge=1)
    longest_s: float | None = Field(default=None, gt=0)
    border_probability: float | None = Field(default=None, gt=0, lt=1)

    def run(
        self, recordings: tuple[LabelledRecording, ...], work: Work = Work()
    ) -> tuple[Segments, ...]:
        """Segment recordings.

        Parameters
        ----------
        recordings : tuple of LabelledRecording
            What to segment.
        work : Work
            How to run.

        Returns
        -------
        tuple of Segments
            One each, with bounds at the recording's own rate; together they cover the recording.

        Raises
        ------
        SegmentationError
            If a marker was not seen throughout or a recording is too short.
        """
        results = []
        for index, recording in enumerate(recordings):
            results.append(self._segment(recording))
            work.progress((index + 1) / len(recordings))
        return tuple(results)

    def _segment(self, recording: LabelledRecording) -> Segments:
        paths = _gather(recording, self.markers)
        rate_hz = min(self.rate_hz, recording.rate_hz)
        samples = resample(recording.time, paths, rate_hz)
        if len(samples) < 2:
            raise SegmentationError(
                f"{recording.source}: lasts {len(paths) / recording.rate_hz:.3g} s, which is "
                f"{len(samples)} sample at {rate_hz:g} Hz; expected at least 2"
            )
        signals = prepare_signals(samples)
        if not signals.moves:
            # Nothing moves: one segment, and no evidence to weigh it by.
            return _to_segments(np.array([0, len(samples)]), float("nan"), rate_hz, recording)
        longest = None if self.longest_s is None else max(2, round(self.longest_s * rate_hz))
        found = find_change_points(
            signals.positions,
            signals.speeds,
            self.border_probability or 1.0 / len(samples),
            longest,
            VmciModel(n_centres=self.n_centres),
        )
        borders = merge_single_samples(found.borders)
        return _to_segments(borders, found.log_probability, rate_hz, recording)


def _gather(recording: LabelledRecording, markers: tuple[str, ...]) -> npt.NDArray[np.float64]:
    """Stack the paths of markers, shape (T, m, 3); refuse gaps."""
    if len(recording.time) < 2:
        raise SegmentationError(
            f"{recording.source}: got {len(recording.time)} samples; expected at least 2"
        )
    paths = np.stack([recording.marker(name) for name in markers], axis=1)
    seen = np.isfinite(paths).all(axis=2)
    if not seen.all():
        row, column = np.argwhere(~seen)[0]
        raise SegmentationError(
            f"{recording.source}: marker {markers[column]!r} was not seen in frame "
            f"{recording.first_frame + row}; expected no gaps"
        )
    return paths


def _to_segments(
    borders: npt.NDArray[np.int64],
    log_evidence: float,
    rate_hz: float,
    recording: LabelledRecording,
) -> Segments:
    """Bring borders at the reduced rate to rows of the recording."""
    rows = np.round(borders * (recording.rate_hz / rate_hz)).astype(np.int64)
    rows[-1] = len(recording.time)
    return Segments(
        bounds=np.stack([rows[:-1], rows[1:]], axis=1),
        log_evidence=log_evidence,
        rate_hz=recording.rate_hz,
        source=recording.source,
        first_frame=recording.first_frame,
    )

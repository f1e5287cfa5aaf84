"""The segmentation stage: recordings to building blocks."""

from __future__ import annotations

from abc import abstractmethod
from typing import Literal

import numpy as np
from pydantic import Field

from besman.config.stage import Work
from besman.person.body import find_back
from besman.records import LabelledRecording, Segments
from besman.stages.segment.hand_segmentation import SegmentingStage
from besman.stages.segment.sampling import (
    gather_gapless_paths,
    sample_paths,
    spread_over_rows,
    to_segments,
)
from besman.stages.segment.signals import measure_scaling, prepare_signals
from besman.stages.segment.valley_online import OnlineMovements, Pace, measure_pace
from besman.stages.segment.valley_vmci import EVIDENCE_HZ, MovementsAndRests, find_movements
from besman.stages.segment.valleys import ValleyShape
from besman.stages.segment.vmci import (
    VmciModel,
    find_change_points,
    merge_single_samples,
    weigh_borders,
)
from besman.stages.segment.vmci_online import OnlineVmci
from besman.stages.segment.walking import take_from_person

# A hand sways no faster while its person stands; nobody reaches anywhere as slowly.
HAND_SHAPE = ValleyShape(least=0.02)
"""What counts as a valley and as a rest of a hand."""


class SegmentConfig(SegmentingStage):
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
        samples, rate_hz = sample_paths(recording, self.markers, self.rate_hz)
        signals = prepare_signals(samples)
        if not signals.moves:
            # Nothing moves: one segment, and no evidence to weigh it by.
            return to_segments(np.array([0, len(samples)]), rate_hz, recording, float("nan"))
        longest = None if self.longest_s is None else max(2, round(self.longest_s * rate_hz))
        found = find_change_points(
            signals.positions,
            signals.speeds,
            self.border_probability or 1.0 / len(samples),
            longest,
            VmciModel(n_centres=self.n_centres),
        )
        weights = weigh_borders(
            signals.positions,
            signals.speeds,
            self.border_probability or 1.0 / len(samples),
            longest,
            VmciModel(n_centres=self.n_centres),
        )
        borders = merge_single_samples(found.borders)
        return to_segments(borders, rate_hz, recording, found.log_probability, weights.probability)


class _OneByOne(SegmentingStage):
    """A method that is quick enough to look at one recording after the other."""

    def run(
        self, recordings: tuple[LabelledRecording, ...], work: Work = Work()
    ) -> tuple[Segments, ...]:
        """Segment recordings; as `SegmentConfig.run`."""
        results = []
        for index, recording in enumerate(recordings):
            results.append(self._segment(recording))
            work.progress((index + 1) / len(recordings))
        return tuple(results)

    @abstractmethod
    def _segment(self, recording: LabelledRecording) -> Segments:
        """Segment one recording."""


class VmciOnlineConfig(_OneByOne):
    """Velocity-based multiple change-point inference, sample by sample.

    Attributes
    ----------
    rate_hz, markers, n_centres, border_probability
        As in `SegmentConfig`.
    longest_s : float
        Greatest duration of a segment, seconds.
    calibration_s : float, optional
        The scaling is measured on so many seconds from the start, as a live stream has to; on the
        whole recording if not given, which gives the segments of `vmci`.
    """

    method: Literal["vmci_online"] = "vmci_online"
    rate_hz: float = Field(default=20.0, gt=0)
    n_centres: int = Field(default=3, ge=1)
    longest_s: float = Field(default=10.0, gt=0)
    border_probability: float | None = Field(default=None, gt=0, lt=1)
    calibration_s: float | None = Field(default=None, gt=0)

    def _segment(self, recording: LabelledRecording) -> Segments:
        samples, rate_hz = sample_paths(recording, self.markers, self.rate_hz)
        known = samples
        if self.calibration_s is not None:
            known = samples[: max(2, round(self.calibration_s * rate_hz))]
        scaling = measure_scaling(known)
        n_rows = len(recording.time)
        borders = [0]
        if np.isfinite(scaling.step).any():
            online = OnlineVmci(
                scaling,
                self.border_probability or 1.0 / len(samples),
                recording.rate_hz,
                rate_hz,
                self.longest_s,
                VmciModel(n_centres=self.n_centres),
            )
            for sample in gather_gapless_paths(recording, self.markers):
                borders += online.update(sample)
            borders += online.finish()
        rows = np.array([*borders, n_rows], dtype=np.int64)
        return Segments(
            bounds=np.stack([rows[:-1], rows[1:]], axis=1),
            log_evidence=float("nan"),
            rate_hz=recording.rate_hz,
            source=recording.source,
            first_frame=recording.first_frame,
        )


class ValleyVmciConfig(_OneByOne):
    """vMCI over the valleys of the speed, with rests; see `besman.stages.segment.valley_vmci`.

    Attributes
    ----------
    markers : tuple of str
        Markers of the hand (or hands) whose speed is bell-shaped.
    longest_s : float, optional
        Greatest duration of a movement, seconds.
    """

    method: Literal["valley_vmci"] = "valley_vmci"
    longest_s: float | None = Field(default=None, gt=0)

    def find(self, recording: LabelledRecording) -> MovementsAndRests:
        """Find movements and rests, whose borders may lie between frames.

        Raises
        ------
        SegmentationError
            As `run`.
        """
        paths = gather_gapless_paths(recording, self.markers)
        back = find_back(recording.markers)
        if back:
            places = [recording.marker(name) for name in back]
            paths = take_from_person(paths, places, recording.rate_hz)
        return find_movements(recording.time, paths, self.longest_s, shape=HAND_SHAPE)

    def _segment(self, recording: LabelledRecording) -> Segments:
        found = self.find(recording)
        n_rows, rate_hz = len(recording.time), recording.rate_hz
        rows = np.round(found.borders_s * rate_hz).astype(np.int64)
        rows[-1] = n_rows
        # Borders on the grid that fall on one row of a slow recording are one.
        rows = np.unique(np.minimum(rows, n_rows))
        expected = np.zeros(int(np.ceil(n_rows / rate_hz * EVIDENCE_HZ)) + 1)
        for places, probability in zip(
            found.candidates_s, found.candidate_probability, strict=True
        ):
            at = np.unique(np.round(places * EVIDENCE_HZ).astype(np.int64))
            expected[at] = np.maximum(expected[at], probability)
        return Segments(
            bounds=np.stack([rows[:-1], rows[1:]], axis=1),
            log_evidence=found.log_probability,
            rate_hz=rate_hz,
            source=recording.source,
            first_frame=recording.first_frame,
            border_probability=spread_over_rows(expected, EVIDENCE_HZ, recording),
        )


class ValleyOnlineConfig(_OneByOne):
    """Movements and rests as of `valley_vmci`, sample by sample, as a stream has to.

    See `besman.stages.segment.valley_online`. People who walk are looked at as from the laboratory.

    Attributes
    ----------
    markers, longest_s
        As in `ValleyVmciConfig`.
    calibration_s : float, optional
        How fast the person moves is measured on so many seconds from the start; on the whole
        recording if not given, which gives the segments of `valley_vmci`.
    """

    method: Literal["valley_online"] = "valley_online"
    longest_s: float | None = Field(default=None, gt=0)
    calibration_s: float | None = Field(default=None, gt=0)

    def measure(self, recording: LabelledRecording, markers: tuple[str, ...] | None = None) -> Pace:
        """Measure how fast markers move, those of the stage if none are named."""
        paths = gather_gapless_paths(recording, markers or self.markers)
        n = len(paths)
        if self.calibration_s is not None:
            n = min(n, max(2, round(self.calibration_s * recording.rate_hz)))
        return measure_pace(recording.time[:n], paths[:n], HAND_SHAPE)

    def _segment(self, recording: LabelledRecording) -> Segments:
        pace, borders = self.measure(recording), [0]
        if np.isfinite(pace.change).any():
            online = OnlineMovements(pace, recording.rate_hz, self.longest_s, HAND_SHAPE)
            for sample in gather_gapless_paths(recording, self.markers):
                borders += online.update(sample)
            borders += online.finish()
        rows = np.unique([*borders, len(recording.time)])
        return Segments(
            bounds=np.stack([rows[:-1], rows[1:]], axis=1),
            log_evidence=float("nan"),
            rate_hz=recording.rate_hz,
            source=recording.source,
            first_frame=recording.first_frame,
        )

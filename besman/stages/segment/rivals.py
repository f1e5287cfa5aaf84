"""Stages of the methods that the default is compared with (thesis 4.4.2)."""

from __future__ import annotations

from abc import abstractmethod
from itertools import pairwise
from typing import Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field

from besman.config.stage import Work
from besman.exceptions import SegmentationError
from besman.records import LabelledRecording, LabelledSegments, Segments
from besman.stages.segment.hand_segmentation import SegmentingStage
from besman.stages.segment.sampling import sample_paths, to_rows, to_segments
from besman.stages.segment.signals import Signals, prepare_signals
from besman.stages.segment.vmci import merge_single_samples

IntArray = npt.NDArray[np.int64]


class _Rival(SegmentingStage):
    """What all have: markers, and a rate at which they look.

    Attributes
    ----------
    rate_hz : float
        Rate at which the movement is looked at. A recording with a lower rate is taken as it is.
    markers : tuple of str
        Markers of the hand (or hands).
    """

    rate_hz: float = Field(default=20.0, gt=0)


class _OneByOne(_Rival):
    """Methods that take every recording by itself."""

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
            samples, rate_hz = sample_paths(recording, self.markers, self.rate_hz)
            signals = prepare_signals(samples)
            borders, evidence = np.array([0, len(samples)]), float("nan")
            if signals.moves:
                borders, evidence = self._find(signals, rate_hz)
            results.append(to_segments(borders, rate_hz, recording, evidence))
            work.progress((index + 1) / len(recordings))
        return tuple(results)

    @abstractmethod
    def _find(self, signals: Signals, rate_hz: float) -> tuple[IntArray, float]:
        """Return borders (first 0, last T) and their log-probability."""


class MciConfig(_OneByOne):
    """Multiple change-point inference on positions alone, exact.

    Attributes
    ----------
    rate_hz, markers
        As of every rival.
    border_probability : float, optional
        Probability of a border at a sample; one over the number of samples if not given.
    longest_s : float, optional
        Greatest duration of a segment, seconds.
    """

    method: Literal["mci"] = "mci"
    border_probability: float | None = Field(default=None, gt=0, lt=1)
    longest_s: float | None = Field(default=None, gt=0)

    def _find(self, signals: Signals, rate_hz: float) -> tuple[IntArray, float]:
        from besman.stages.segment.mci import find_position_changes

        probability = self.border_probability or 1.0 / len(signals.positions)
        longest = None if self.longest_s is None else max(2, round(self.longest_s * rate_hz))
        found = find_position_changes(signals.positions, probability, longest=longest)
        return merge_single_samples(found.borders), found.log_probability


class LocminConfig(_OneByOne):
    """Borders at local minima of the speed.

    Attributes
    ----------
    rate_hz, markers
        As of every rival; of several markers the mean speed is taken.
    window_s : float
        Window in which a minimum is the lowest value, seconds in all.
    """

    method: Literal["locmin"] = "locmin"
    window_s: float = Field(default=0.2, gt=0)

    def _find(self, signals: Signals, rate_hz: float) -> tuple[IntArray, float]:
        return _find_minima(signals, self.window_s, rate_hz), float("nan")


class _Together(_Rival):
    """Methods that take all recordings together and give their segments clusters."""

    def run(
        self, recordings: tuple[LabelledRecording, ...], work: Work = Work()
    ) -> tuple[Segments, ...]:
        """Segment recordings; see `run_labelled`."""
        return self._run(recordings, work)[0]

    def run_labelled(
        self, recordings: tuple[LabelledRecording, ...], work: Work = Work()
    ) -> tuple[LabelledSegments, ...]:
        """Segment recordings and name the cluster of every segment.

        Parameters
        ----------
        recordings : tuple of LabelledRecording
            What to segment, together: a name means the same in all of them.
        work : Work
            How to run.

        Returns
        -------
        tuple of LabelledSegments
            One each, labels ``cluster1``, ``cluster2``...; distances are NaN.

        Raises
        ------
        SegmentationError
            If a marker was not seen throughout or a recording is too short.
        """
        return self._run(recordings, work)[1]

    def _run(
        self, recordings: tuple[LabelledRecording, ...], work: Work
    ) -> tuple[tuple[Segments, ...], tuple[LabelledSegments, ...]]:
        sampled = [sample_paths(each, self.markers, self.rate_hz) for each in recordings]
        rates = {rate_hz for _, rate_hz in sampled}
        if len(rates) > 1:
            raise SegmentationError(
                f"{self.method}: recordings come at {', '.join(f'{r:g}' for r in sorted(rates))} "
                "Hz; they are taken together and need one rate: set rate_hz to the lowest"
            )
        signals = [prepare_signals(paths) for paths, _ in sampled]
        moving = [index for index, each in enumerate(signals) if each.moves]
        borders = [np.array([0, len(paths)]) for paths, _ in sampled]
        clusters = [np.zeros(1, dtype=np.int64) for _ in sampled]
        evidence = float("nan")
        if moving:
            paths = [_stack_paths(sampled[index][0]) for index in moving]
            found = self._find([signals[k] for k in moving], paths, sampled[0][1], work)
            for index, edges, names in zip(moving, found[0], found[1], strict=True):
                borders[index], clusters[index] = edges, names
            evidence = found[2]
        segments = tuple(
            to_segments(edges, rate_hz, recording, evidence)
            for recording, edges, (_, rate_hz) in zip(recordings, borders, sampled, strict=True)
        )
        labelled = tuple(
            _label(recording, edges, names, rate_hz)
            for recording, edges, names, (_, rate_hz) in zip(
                recordings, borders, clusters, sampled, strict=True
            )
        )
        return segments, labelled

    @abstractmethod
    def _find(
        self,
        signals: list[Signals],
        paths: list[npt.NDArray[np.float64]],
        rate_hz: float,
        work: Work,
    ) -> tuple[list[IntArray], list[IntArray], float]:
        """Return borders and clusters of every recording, and a log-probability."""


class BpArHmmConfig(_Together):
    """Beta-process autoregressive hidden Markov model (Fox 2009), all recordings together.

    Attributes
    ----------
    rate_hz, markers
        As of every rival; all recordings need one rate.
    sweeps : int
        Draws of all unknowns; the most probable draw is returned.
    seed : int
        Of the random numbers.
    """

    method: Literal["bp_ar_hmm"] = "bp_ar_hmm"
    sweeps: int = Field(default=500, ge=1)
    seed: int = Field(default=0, ge=0)

    def _find(
        self,
        signals: list[Signals],
        paths: list[npt.NDArray[np.float64]],
        rate_hz: float,
        work: Work,
    ) -> tuple[list[IntArray], list[IntArray], float]:
        from besman.stages.segment.bp_ar_hmm import infer_shared_states

        found = infer_shared_states(
            [each.positions for each in signals], self.sweeps, self.seed, progress=work.progress
        )
        borders, clusters = [], []
        for states in found.states:
            changes = np.flatnonzero(np.diff(states)) + 1
            edges = merge_single_samples(np.concatenate([[0], changes, [len(states)]]))
            borders.append(edges)
            clusters.append(
                np.array([np.bincount(states[a:b]).argmax() for a, b in pairwise(edges)])
            )
        return borders, clusters, found.log_probability


class ProbsConfig(_Together):
    """Probabilistic segmentation (Lioutikov 2017) with DMPs, all recordings together.

    Attributes
    ----------
    rate_hz, markers
        As of every rival; all recordings need one rate.
    window_s : float
        Window of the local minima of the speed that are the cuts, seconds in all.
    longest_s : float
        Greatest duration of a segment, seconds.
    most_primitives : int
        Greatest number of primitives that is tried.
    n_weights : int
        Weights of a DMP for each axis.
    iterations : int
        Greatest number of iterations for each number of primitives.
    seed : int
        Of the start.
    """

    method: Literal["probs"] = "probs"
    window_s: float = Field(default=0.1, gt=0)
    longest_s: float = Field(default=3.0, gt=0)
    most_primitives: int = Field(default=8, ge=1)
    n_weights: int = Field(default=5, ge=2)
    iterations: int = Field(default=50, ge=1)
    seed: int = Field(default=0, ge=0)

    def _find(
        self,
        signals: list[Signals],
        paths: list[npt.NDArray[np.float64]],
        rate_hz: float,
        work: Work,
    ) -> tuple[list[IntArray], list[IntArray], float]:
        from besman.stages.segment.probs import segment_with_primitives

        found = segment_with_primitives(
            paths,
            [_find_minima(each, self.window_s, rate_hz) for each in signals],
            max(2, round(self.longest_s * rate_hz)),
            self.n_weights,
            self.most_primitives,
            self.iterations,
            self.seed,
            work.progress,
        )
        return list(found.borders), list(found.primitives), found.log_probability


def _find_minima(signals: Signals, window_s: float, rate_hz: float) -> IntArray:
    from besman.stages.segment.locmin import find_speed_minima

    half = max(1, round(window_s * rate_hz / 2))
    return merge_single_samples(find_speed_minima(signals.speeds.mean(axis=1), half))


def _stack_paths(paths: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Paths of all markers about their mean, shape (T, 3 * m), metres."""
    flat = paths.reshape(len(paths), -1)
    centred: npt.NDArray[np.float64] = flat - flat.mean(axis=0)
    return centred


def _label(
    recording: LabelledRecording, borders: IntArray, clusters: IntArray, rate_hz: float
) -> LabelledSegments:
    rows = to_rows(borders, rate_hz, recording)
    return LabelledSegments(
        bounds=np.stack([rows[:-1], rows[1:]], axis=1),
        labels=tuple(f"cluster{number + 1}" for number in clusters),
        distances=np.full(len(clusters), np.nan),
        rate_hz=recording.rate_hz,
        source=recording.source,
        first_frame=recording.first_frame,
    )

"""What comes next: the order of blocks, how long they take, and how the present one began."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.classifiers.block_order import BlockOrder
from besman.classifiers.novelty import UNKNOWN
from besman.exceptions import RecognitionError, nearest
from besman.following.beginnings import Beginnings, Example, FirstParts, end_rows
from besman.following.rests import Rests
from besman.records import LabelledRecording, LabelledSegments
from besman.records.layers import IDLE
from besman.stages.recognize.model import Recipe

FloatArray = npt.NDArray[np.float64]

# Of times whose logarithms are normal; one alone says nothing of their spread.
_LEAST_LOG_SPREAD = 0.1
_USUAL_LOG_SPREAD = 0.3


@dataclass(frozen=True, eq=False)
class Outlook:
    """How probable it is what a block is that has begun, and which movement follows it.

    Attributes
    ----------
    labels : tuple of str, length K
        All movements, sorted, and ``idle`` at the end.
    now : array, shape (K,)
        Probability of the block that has begun.
    following : array, shape (K - 1,)
        Probability of the next movement; a rest is none.
    """

    labels: tuple[str, ...]
    now: FloatArray
    following: FloatArray

    @property
    def label(self) -> str:
        """The most probable block."""
        return self.labels[int(self.now.argmax())]

    @property
    def next_label(self) -> str:
        """The movement that follows most probably."""
        return self.labels[int(self.following.argmax())]


class Foresight:
    """Learns from named blocks; foresees the block that has begun, and the next movement.

    Movements follow each other by a Markov model of variable order; rests between them stand beside
    it, see `besman.following.rests.Rests`. What was seen of a block is told by
    `besman.following.beginnings.Beginnings`; Bayes' rule joins both.

    Parameters
    ----------
    recordings : sequence of LabelledRecording
        Of those with one name the first counts.
    blocks : sequence of LabelledSegments
        Blocks of each recording in the order of time, rests among them as ``idle``.
    recipe : Recipe
        Of the recognition.
    longest_context : int
        See `besman.classifiers.block_order.BlockOrder`.

    Attributes
    ----------
    labels : tuple of str
        As of `Outlook`.

    Raises
    ------
    RecognitionError
        If blocks have no recording, or no movement has a name.
    """

    def __init__(
        self,
        recordings: Sequence[LabelledRecording],
        blocks: Sequence[LabelledSegments],
        recipe: Recipe,
        longest_context: int = 3,
    ) -> None:
        by_source = {recording.source: recording for recording in reversed(recordings)}
        examples, sequences = [], []
        for found in blocks:
            if found.source not in by_source:
                raise RecognitionError(
                    f"blocks of {found.source!r} have no recording; "
                    f"{nearest(found.source, by_source)}"
                )
            sequences.append([label for label in found.labels if label != IDLE])
            for (start, end), label in zip(found.bounds.tolist(), found.labels, strict=True):
                if label != UNKNOWN:
                    examples.append(Example(by_source[found.source], (start, end), label))
        movements = {label for sequence in sequences for label in sequence} - {UNKNOWN}
        self._order = BlockOrder(sequences, tuple(movements), longest_context)
        self.labels = (*self._order.labels, IDLE)
        self._rests = _learn_rests(by_source, blocks, recipe)
        self._gaps = _measure_gaps(blocks)
        self._beginnings = Beginnings(examples, recipe)
        self._columns = [self.labels.index(label) for label in self._beginnings.labels]
        self.recipe = recipe

    def parts(self, markers: Sequence[str], source: str) -> FirstParts:
        """Make what extracts the features of a block that has begun, see `FirstParts`."""
        return FirstParts(self.recipe, markers, source)

    def expect(
        self, before: Sequence[str], speed_m_s: float = float("nan")
    ) -> tuple[FloatArray, FloatArray]:
        """Return what the blocks so far say.

        Parameters
        ----------
        before : sequence of str
            Labels of the blocks so far, rests among them.
        speed_m_s : float
            Of the hand as the last of them ended, `FirstParts.end_speed`; NaN if not known.

        Returns
        -------
        now : array, shape (K,)
            Probability of the block after them.
        following : array, shape (K, K - 1)
            For each block that it may be, of the movement that follows it.
        """
        movements = [label for label in before if label != IDLE]
        rest = self._rests.probability(before, speed_m_s)
        now = self._order.probabilities(movements)
        rows = [self._order.probabilities([*movements, label]) for label in self._order.labels]
        return np.append((1 - rest) * now, rest), np.stack([*rows, now])

    def weigh(
        self, expected: tuple[FloatArray, FloatArray], seen: FloatArray | None = None
    ) -> Outlook:
        """Join what the blocks so far say with what was seen of the block that has begun.

        Parameters
        ----------
        expected : pair of array
            Of `expect`.
        seen : array, shape (N_POINTS, C), optional
            Of `FirstParts.extract`.

        Returns
        -------
        Outlook
        """
        now, following = expected
        densities = None if seen is None else self._beginnings.log_densities(seen)
        if densities is not None:
            # Nothing speaks for a class without an example that could be cut.
            every = np.full(len(now), densities.min())
            every[self._columns] = densities
            joined = np.log(now) + every
            now = np.exp(joined - np.logaddexp.reduce(joined))
        return Outlook(self.labels, now, now @ following)

    def pace(self, labels: Sequence[str], starts_s: Sequence[float]) -> float:
        """Return how slow somebody is, beside those who were learnt from.

        Parameters
        ----------
        labels : sequence of str, length B
            Blocks so far, the one that has begun last or not among them.
        starts_s : sequence of float, length B
            Where they begin, seconds.

        Returns
        -------
        float
            Mean logarithm of the times between movements over the usual ones, drawn towards 0 as by
            one more movement at the usual pace.
        """
        slower = [
            gap - self._gaps[label][0]
            for label, gap in _log_gaps(labels, starts_s)
            if label in self._gaps
        ]
        return sum(slower) / (len(slower) + 1)

    def seconds_to_next(self, label: str, elapsed_s: float, pace: float = 0.0) -> float:
        """Return when the next movement starts, in the median, if a block goes on for so long.

        Parameters
        ----------
        label : str
            The block that goes on.
        elapsed_s : float
            Seconds since it began.
        pace : float
            Of `pace`.

        Returns
        -------
        float
            Seconds from now; NaN if no movement ever followed that block.
        """
        if label not in self._gaps:
            return float("nan")
        from scipy.special import ndtr, ndtri

        centre, spread = self._gaps[label][0] + pace, self._gaps[label][1]
        passed = ndtr((np.log(max(elapsed_s, 1e-6)) - centre) / spread)
        median = ndtri(min(passed + 0.5 * (1.0 - passed), 1.0 - 1e-12))
        return max(0.0, float(np.exp(centre + spread * median)) - elapsed_s)


def _learn_rests(
    recordings: Mapping[str, LabelledRecording],
    blocks: Sequence[LabelledSegments],
    recipe: Recipe,
) -> Rests:
    """Learn when somebody rests, from blocks and how fast the hand was as each began."""
    parts = {
        found.source: FirstParts(recipe, recordings[found.source].markers, found.source)
        for found in blocks
    }

    def end_speed(found: LabelledSegments, row: int) -> float:
        recording = recordings[found.source]
        ending = recording.positions[max(0, row - end_rows(recording.rate_hz)) : row]
        return parts[found.source].end_speed(ending, recording.rate_hz)

    return Rests(blocks, end_speed)


def _log_gaps(labels: Sequence[str], starts_s: Sequence[float]) -> list[tuple[str, float]]:
    """Return of each block the logarithm of the seconds to the next movement, where one follows."""
    gaps = []
    for k, label in enumerate(labels):
        later = next((j for j in range(k + 1, len(labels)) if labels[j] != IDLE), None)
        if later is not None and labels[later] != UNKNOWN and starts_s[later] > starts_s[k]:
            gaps.append((label, float(np.log(starts_s[later] - starts_s[k]))))
    return gaps


def _measure_gaps(blocks: Sequence[LabelledSegments]) -> dict[str, tuple[float, float]]:
    """Return mean and spread of the logarithm of the seconds to the next movement, by label."""
    times: defaultdict[str, list[float]] = defaultdict(list)
    for found in blocks:
        for label, gap in _log_gaps(found.labels, (found.bounds[:, 0] / found.rate_hz).tolist()):
            times[label].append(gap)
    return {
        label: (
            float(np.mean(own)),
            max(float(np.std(own)), _LEAST_LOG_SPREAD) if len(own) > 1 else _USUAL_LOG_SPREAD,
        )
        for label, own in times.items()
    }

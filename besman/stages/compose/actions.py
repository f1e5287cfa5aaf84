"""Actions of every level: candidates between borders, their class, and the best grouping."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from besman.classifiers.nearest_neighbour import classify, fit_scale, scale
from besman.exceptions import LabellingError, RecognitionError, nearest
from besman.geometry.frames import back_frame
from besman.person.body import find_back
from besman.records import LabelledRecording, Record, freeze
from besman.stages.compose.vhms import GroupingSearch

FloatArray = npt.NDArray[np.float64]
Rows = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class LevelModel(
    Record,
    stored_as="besman.hierarchy.actions:LevelModel",
    finite=("examples", "low", "span"),
):
    """What was learnt of the actions of one level.

    Attributes
    ----------
    examples : array, shape (N, P * C)
        Scaled paths of the examples.
    labels : tuple of str, length N
        Their classes.
    low, span : array, shape (C,)
        Smallest value of every channel over the examples, and the range.
    markers : tuple of str
        Markers whose paths are looked at, of one arm or of both; C is three times their number.
    n_points : int
        Points P that every path is interpolated to.
    """

    examples: FloatArray
    labels: tuple[str, ...]
    low: FloatArray
    span: FloatArray
    markers: tuple[str, ...]
    n_points: int

    def __post_init__(self) -> None:
        freeze(self, {"examples": ("N", "W"), "low": ("C",), "span": ("C",)})


@dataclass(frozen=True, eq=False)
class Level:
    """Actions of one level of one recording.

    Attributes
    ----------
    borders : int array, shape (A + 1,)
        Rising rows.
    labels : tuple of str, length A
    uncertainties : array, shape (A,)
        Distance of each action to its nearest example.
    fitness : float
        Minus the mean of the uncertainties.
    """

    borders: Rows
    labels: tuple[str, ...]
    uncertainties: FloatArray
    fitness: float


def gather_paths(recording: LabelledRecording, markers: Sequence[str]) -> FloatArray:
    """Return the paths of markers, shape (T, M, 3), metres; NaN where not seen.

    Raises
    ------
    RecognitionError
        If the recording has no such marker.
    """
    missing = [name for name in markers if name not in recording.markers]
    if missing:
        raise RecognitionError(
            f"{recording.source}: no marker {missing[0]!r}; "
            f"{nearest(missing[0], recording.markers)}"
        )
    return recording.positions[:, [recording.markers.index(name) for name in markers]]


def cut_paths(
    recording: LabelledRecording, spans: npt.ArrayLike, markers: Sequence[str], n_points: int
) -> FloatArray:
    """Cut many spans out of a recording and bring them to one length.

    Between samples the path is a straight line: only samples inside a span count, so that a span
    looks the same while a recording runs and afterwards. At 30 Hz and 5 m/s^2 that is off by less
    than a millimetre.

    Parameters
    ----------
    recording : LabelledRecording
        Its markers on the back, or the chest and shoulders of a suit, are the frame; without them
        positions are taken as they are (an exoskeleton measures from its own base).
    spans : int array, shape (S, 2)
        Half-open rows.
    markers : sequence of str
    n_points : int

    Returns
    -------
    array, shape (S, n_points, 3 * M)
        Metres in the back frame at the first sample of each span.

    Raises
    ------
    RecognitionError
        If a marker is missing or was not seen in a span, or a span has less than two samples.
    """
    rows = np.asarray(spans, dtype=np.int64).reshape(-1, 2)
    too_short = np.diff(rows, axis=1)[:, 0] < 2
    outside = (rows[:, 0] < 0) | (rows[:, 1] > len(recording.time))
    if (too_short | outside).any():
        start, end = rows[np.argmax(too_short | outside)]
        raise RecognitionError(
            f"{recording.source}: got segment [{start}, {end}); expected at least 2 samples "
            f"inside [0, {len(recording.time)})"
        )
    if len(rows) == 0:
        return np.empty((0, n_points, 3 * len(markers)))
    paths = gather_paths(recording, markers)
    _check_seen(recording, paths, rows, markers)
    first, last = recording.time[rows[:, 0]], recording.time[rows[:, 1] - 1]
    share = np.linspace(0.0, 1.0, n_points)
    times = first[:, np.newaxis] + (last - first)[:, np.newaxis] * share
    left = np.searchsorted(recording.time, times, side="right") - 1
    left = np.clip(left, rows[:, :1], rows[:, 1:] - 2)
    step = recording.time[left + 1] - recording.time[left]
    weight = ((times - recording.time[left]) / step)[..., np.newaxis, np.newaxis]
    cut = paths[left] * (1.0 - weight) + paths[left + 1] * weight
    if names := find_back(recording.markers):
        back = gather_paths(recording, names)[rows[:, 0]]
        try:
            rotation, origin = back_frame(back[:, 0], back[:, 1], back[:, 2])
        except LabellingError as error:
            raise RecognitionError(f"{recording.source}: {error}") from None
        cut = (cut - origin[:, np.newaxis, np.newaxis]) @ rotation[:, np.newaxis]
    flat: FloatArray = cut.reshape(len(rows), n_points, -1)
    return flat


def _check_seen(
    recording: LabelledRecording, paths: FloatArray, rows: Rows, markers: Sequence[str]
) -> None:
    """Refuse gaps inside a span."""
    gone = np.asarray(np.isnan(paths).any(axis=2))
    missed = np.append(0, np.cumsum(gone.any(axis=1)))
    bad = missed[rows[:, 1]] > missed[rows[:, 0]]
    if bad.any():
        start, end = rows[np.argmax(bad)]
        row, column = np.argwhere(gone[start:end])[0]
        raise RecognitionError(
            f"{recording.source}: marker {markers[column]!r} was not seen in frame "
            f"{recording.first_frame + start + row}; expected no gaps inside a segment"
        )


def train_level(
    recordings: Sequence[LabelledRecording],
    spans: Sequence[npt.ArrayLike],
    labels: Sequence[Sequence[str]],
    markers: Sequence[str],
    n_points: int = 25,
) -> LevelModel:
    """Learn the actions of one level from labelled examples.

    Parameters
    ----------
    recordings : sequence of LabelledRecording
    spans : sequence of int array, shape (S, 2)
        Half-open rows of the examples in each recording.
    labels : sequence of sequences of str
        Their classes.
    markers : sequence of str
    n_points : int

    Returns
    -------
    LevelModel

    Raises
    ------
    RecognitionError
        If there are no examples, or a path cannot be cut.
    """
    names = tuple(label for part in labels for label in part)
    if not names:
        raise RecognitionError("compose: a level has no examples to learn from; expected some")
    values = np.concatenate(
        [
            cut_paths(recording, rows, markers, n_points)
            for recording, rows in zip(recordings, spans, strict=True)
        ]
    )
    low, span = fit_scale(values, (values.shape[2],))
    return LevelModel(scale(values, low, span), names, low, span, tuple(markers), n_points)


def name_spans(
    recording: LabelledRecording, spans: npt.ArrayLike, model: LevelModel
) -> tuple[tuple[str, ...], FloatArray]:
    """Give each span, shape (S, 2), the class of its nearest example, and the distance to it."""
    values = cut_paths(recording, spans, model.markers, model.n_points)
    return classify(scale(values, model.low, model.span), model.examples, model.labels)


def compose_level(
    recording: LabelledRecording,
    borders: npt.ArrayLike,
    model: LevelModel,
    longest: int | None = None,
) -> Level:
    """Group the blocks of one level to the actions of the next.

    Parameters
    ----------
    recording : LabelledRecording
    borders : int array, shape (n + 1,)
        Rising rows: the borders of n blocks.
    model : LevelModel
    longest : int, optional
        Most blocks in one action.

    Returns
    -------
    Level

    Raises
    ------
    RecognitionError
        If there are no blocks, or a path cannot be cut.

    References
    ----------
    Thesis algorithm 1, steps 3 to 5.
    """
    rows = np.asarray(borders, dtype=np.int64)
    n_blocks = len(rows) - 1
    if n_blocks < 1:
        raise RecognitionError(f"{recording.source}: compose: got no blocks; expected at least 1")
    reach = n_blocks if longest is None else min(n_blocks, longest)
    search = GroupingSearch(longest)
    ends, lengths = np.meshgrid(np.arange(1, n_blocks + 1), np.arange(1, reach + 1), indexing="ij")
    allowed = lengths <= ends
    starts = (ends - lengths)[allowed]
    spans = np.stack([rows[starts], rows[ends[allowed]]], axis=1)
    labels, uncertainties = name_spans(recording, spans, model)
    at = np.full(allowed.shape, -1)
    at[allowed] = np.arange(len(spans))
    for end in range(n_blocks):
        search.add(uncertainties[at[end, : search.reach]])
    best = search.best()
    chosen = [at[end - 1, end - start - 1] for start, end in pairwise(best.borders)]
    return Level(
        rows[list(best.borders)],
        tuple(labels[index] for index in chosen),
        uncertainties[chosen],
        best.fitness,
    )


def compose_levels(
    recording: LabelledRecording,
    borders: npt.ArrayLike,
    models: Sequence[LevelModel],
    longest: int | None = None,
) -> tuple[Level, ...]:
    """Group blocks to actions, those to higher actions, and so on; see `compose_level`.

    Raises
    ------
    RecognitionError
        If there is no level, or as in `compose_level`.
    """
    if not models:
        raise RecognitionError("compose: got no levels; expected at least 1")
    levels: list[Level] = []
    for model in models:
        levels.append(compose_level(recording, borders, model, longest))
        borders = levels[-1].borders
    return tuple(levels)

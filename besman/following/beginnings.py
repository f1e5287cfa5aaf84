"""Which block is beginning, told by the first part of its movement."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.classifiers.nearest_neighbour import fit_spread, scale
from besman.exceptions import LabellingError
from besman.geometry.frames import back_frame
from besman.person.body import find_body
from besman.records import LabelledRecording
from besman.stages.recognize.features import count_channels, stretch_features
from besman.stages.recognize.model import Recipe
from besman.stages.recognize.stretches import Stretch

FloatArray = npt.NDArray[np.float64]

SHARES = tuple(k / 10 for k in range(1, 11))
"""How much of an example was to be seen, of its samples."""

N_POINTS = 6
"""Points that a first part is looked at in: few, because it is looked at again and again."""

END_S = 0.05
"""Over how long it is looked at how fast a movement ends, seconds."""

LEAST_SAMPLES = 3
_MOST_EXAMPLES = 24
# Of these shares an example is taken for a stretch to be told, when the sharpness is chosen.
_TOLD_SHARES = (1, 3, 5)
_SHARPNESS = tuple(2.0**k for k in range(-1, 9))


class FirstParts:
    """Makes features of a movement that has only begun, without interpolating it.

    Parameters
    ----------
    recipe : Recipe
        How the recognition makes features; the hand's orientation, which takes longest and tells no
        more here, is left out. If it is all there is, displacements stand in for it.
    markers : sequence of str, length M
        Columns of positions.
    source : str
        Named in errors.

    Raises
    ------
    RecognitionError
        If there is no person.
    """

    def __init__(self, recipe: Recipe, markers: Sequence[str], source: str) -> None:
        if not set(recipe.objects) <= set(markers):
            recipe = recipe.without_objects()
        without = tuple(name for name in recipe.features if name != "hand_orientation")
        self.features = without or ("displacements",)
        self.markers, self.objects = recipe.markers, recipe.objects
        body = find_body(markers, source)
        self._arms, self._back = body.arms_of(recipe.markers), body.back
        of_arms = [name for arm in self._arms for name in (*arm.markers, *arm.cluster)]
        names = (*body.back, *recipe.markers, *recipe.objects, *of_arms)
        self._names = tuple(dict.fromkeys(names))
        self.columns = [list(markers).index(name) for name in self._names]

    @property
    def widths(self) -> tuple[int, ...]:
        """Channels of each feature."""
        return count_channels(self.features, self.markers)

    def extract(self, positions: FloatArray, rate_hz: float) -> FloatArray | None:
        """Compute the features of a stretch that begins with a block.

        Parameters
        ----------
        positions : array, shape (n, M, 3)
            Metres, laboratory frame; NaN where a marker is not seen.
        rate_hz : float

        Returns
        -------
        array, shape (N_POINTS, C), or None
            None if it is too short, or a marker is not seen in it.
        """
        n = len(positions)
        if n < LEAST_SAMPLES:
            return None
        rows = np.round(np.linspace(0, n - 1, N_POINTS)).astype(np.int64)
        seen = positions[rows[:, np.newaxis], self.columns]
        if not np.isfinite(seen).all():
            return None
        try:
            back2lab, origin = back_frame(*seen[0, :3])
            paths = ((seen - origin) @ back2lab)[np.newaxis]
            stretch = Stretch(
                {name: paths[:, :, k] for k, name in enumerate(self._names)},
                np.array([(n - 1) / (N_POINTS - 1) / rate_hz]),
                self._arms,
                back=self._back,
            )
            found = stretch_features(stretch, self.features, self.markers, self.objects)
        except LabellingError:
            return None
        return np.asarray(found[0])

    def end_speed(self, positions: FloatArray, rate_hz: float) -> float:
        """Return how fast the hand is at the end of a stretch; of several the fastest.

        Parameters
        ----------
        positions : array, shape (n, M, 3)
            As of `extract`; at least `end_rows` of them.
        rate_hz : float

        Returns
        -------
        float
            Metres per second; NaN if the stretch is too short, or a hand is not seen.
        """
        n = end_rows(rate_hz)
        if len(positions) < n:
            return float("nan")
        hands = [self.columns[self._names.index(arm.hand)] for arm in self._arms]
        ways = np.linalg.norm(positions[-1, hands] - positions[-n, hands], axis=1)
        return float(np.max(ways)) * rate_hz / (n - 1)


def end_rows(rate_hz: float) -> int:
    """Return how many samples `FirstParts.end_speed` looks at."""
    return 1 + max(1, round(END_S * rate_hz))


class Example(NamedTuple):
    """A block to learn from.

    Attributes
    ----------
    recording : LabelledRecording
    bounds : pair of int
        Half-open rows.
    label : str
    """

    recording: LabelledRecording
    bounds: tuple[int, int]
    label: str


class Beginnings:
    """The density of first parts of each class, out of examples that are cut off everywhere.

    How much of a block was seen is not known while it goes on: the first tenths of all examples are
    compared, and the density of a class is the mean over them of ``exp(-s d^2)``, `d` being the
    root mean square difference of features in their spreads. The sharpness `s` is the one with the
    least log loss when the examples of a recording are told by those of all others.

    Parameters
    ----------
    examples : sequence of Example
        Of each class 24 at most are kept, evenly spaced in their order.
    recipe : Recipe
        Of the recognition.

    Attributes
    ----------
    labels : tuple of str, length K
        Classes, sorted.
    sharpness : float

    Raises
    ------
    RecognitionError
        If a recording shows no person.
    """

    def __init__(self, examples: Sequence[Example], recipe: Recipe) -> None:
        values: list[FloatArray] = []
        labels: list[str] = []
        sources: list[str] = []
        for example in _thin_out(examples):
            recording = example.recording
            parts = FirstParts(recipe, recording.markers, recording.source)
            cut = _cut_parts(parts, example)
            if cut is not None and (not values or cut.shape == values[0].shape):
                values.append(cut)
                labels.append(example.label)
                sources.append(recording.source)
                self._widths = parts.widths
        self.labels = tuple(sorted(set(labels)))
        self.sharpness = 1.0
        if not values:
            return
        order = np.argsort(labels, kind="stable")
        own = np.stack(values)[order]
        n, k = own.shape[:2]
        every = own.reshape(n * k, *own.shape[2:])
        self._scaling = fit_spread(every, self._widths)
        self._vectors = scale(every, *self._scaling)
        self._squares = np.sum(self._vectors**2, axis=1)
        codes = np.searchsorted(self.labels, np.array(labels)[order])
        self._starts = np.searchsorted(np.repeat(codes, k), np.arange(len(self.labels)))
        self.sharpness = self._choose_sharpness(codes, np.array(sources)[order], k)

    def log_densities(self, values: FloatArray) -> FloatArray | None:
        """Return the logarithm of the density of each class, up to a constant.

        Parameters
        ----------
        values : array, shape (N_POINTS, C)
            Of `FirstParts.extract`.

        Returns
        -------
        array, shape (K,), or None
            None if the features are others than those of the examples.
        """
        if not self.labels or values.shape[1] != len(self._scaling[0]):
            return None
        vector = scale(values[np.newaxis], *self._scaling)[0]
        apart = (self._squares - 2 * self._vectors @ vector + vector @ vector) / len(vector)
        return self._mean_of_classes(-self.sharpness * apart, self._starts)

    def _mean_of_classes(self, exponents: FloatArray, starts: npt.NDArray[np.int64]) -> FloatArray:
        """Return logarithms of the mean exponential of each class; exponents of shape (..., E)."""
        counts = np.diff([*starts, exponents.shape[-1]])
        peaks = np.maximum.reduceat(exponents, starts, axis=-1)
        raised = np.exp(exponents - np.repeat(peaks, counts, axis=-1))
        total = np.add.reduceat(raised, starts, axis=-1)
        return np.asarray(peaks + np.log(total / counts))

    def _choose_sharpness(
        self, codes: npt.NDArray[np.int64], sources: npt.NDArray[np.str_], k: int
    ) -> float:
        """Choose the sharpness that tells the examples of a recording best by those of others."""
        if len(self.labels) < 2:
            return 1.0
        if len(set(sources.tolist())) < 2:
            sources = np.arange(len(codes)).astype(str)
        told = np.add.outer(k * np.arange(len(codes)), _TOLD_SHARES)
        chosen = self._vectors[told.ravel()]
        apart = np.sum(chosen**2, axis=1)[:, np.newaxis] + self._squares
        apart = np.maximum(apart - 2 * chosen @ self._vectors.T, 0.0) / chosen.shape[1]
        own = np.repeat(sources, len(_TOLD_SHARES))[:, np.newaxis] == np.repeat(sources, k)
        truth = np.repeat(codes, len(_TOLD_SHARES))
        losses = []
        for sharpness in _SHARPNESS:
            exponents = np.where(own, -1e6, -sharpness * apart)
            found = self._mean_of_classes(exponents, self._starts)
            known = found.max(axis=1, keepdims=True) > -1e5
            found = np.where(known, found, 0.0)
            found -= np.logaddexp.reduce(found, axis=1, keepdims=True)
            losses.append(-np.mean(found[np.arange(len(found)), truth]))
        return float(_SHARPNESS[int(np.argmin(losses))])


def _thin_out(examples: Sequence[Example]) -> list[Example]:
    """Keep a number of examples of each class, evenly spaced."""
    kept: list[Example] = []
    for label in dict.fromkeys(example.label for example in examples):
        own = [example for example in examples if example.label == label]
        n = min(len(own), _MOST_EXAMPLES)
        kept += [own[k] for k in np.round(np.linspace(0, len(own) - 1, n)).astype(int)]
    return kept


def _cut_parts(parts: FirstParts, example: Example) -> FloatArray | None:
    """Return the features of all first parts, shape (len(SHARES), N_POINTS, C)."""
    start, end = example.bounds
    cut = []
    for share in SHARES:
        n = max(LEAST_SAMPLES, round(share * (end - start)))
        part = parts.extract(
            example.recording.positions[start : start + n], example.recording.rate_hz
        )
        if part is None:
            return None
        cut.append(part)
    return np.stack(cut)

"""Recognition without examples: the throw of each recording has a name, no other movement has."""

from __future__ import annotations

import warnings
from typing import Any, ClassVar, Literal

import numpy as np
import numpy.typing as npt

from besman.config.stage import Items, Stage, Truth, Work
from besman.exceptions import RecognitionError, RecordingWarning
from besman.person.body import find_body
from besman.person.release import find_release, hand_energy
from besman.records import LabelledRecording, LabelledSegments, Segments
from besman.records.layers import SIDES, Side

FloatArray = npt.NDArray[np.float64]

OTHER = "other"
# Movement is told over this time: a keypoint that jumps for a frame at 30 Hz is no throw.
_WINDOW_S = 0.1
# As between 2.0 and 2.24 m/s: hands that throw together differ less.
_HARDER_J_KG = 0.5


class OneThrowConfig(Stage):
    """Name the movement in which the hand throws, once in each recording.

    For recordings of one throw each, which need no examples then: what the hand holds would fly
    highest in it, by the height and the speed of the hand; see `besman.person.release`.

    Attributes
    ----------
    label : str
        Its name; all other segments are ``other``.
    arm : "right" or "left"
        The arm whose hand counts.
    """

    model: ClassVar[None] = None
    learns: ClassVar[bool] = False

    method: Literal["one_throw"] = "one_throw"
    label: str = "throw"
    arm: Side = "right"

    @property
    def labels(self) -> tuple[str, str]:
        """All names that it gives."""
        return self.label, OTHER

    def items(
        self,
        recordings: tuple[LabelledRecording, ...],
        segments: tuple[Segments | LabelledSegments, ...],
    ) -> Items:
        """Count the segments."""
        return Items(sum(len(found.bounds) for found in segments), "segments")

    def figures(
        self, recognized: tuple[LabelledSegments, ...], truth: Truth, *records: Any
    ) -> dict[str, Any]:
        """Return the counts by label."""
        labels = [label for found in recognized for label in found.labels]
        return {"counts": {label: labels.count(label) for label in sorted(set(labels))}}

    def run(
        self,
        recordings: tuple[LabelledRecording, ...],
        segments: tuple[Segments | LabelledSegments, ...],
        work: Work = Work(),
    ) -> tuple[LabelledSegments, ...]:
        """Name segments.

        Parameters
        ----------
        recordings : tuple of LabelledRecording
        segments : tuple of Segments or LabelledSegments
            Of each recording, in the same order; labels are not looked at.
        work : Work

        Returns
        -------
        tuple of LabelledSegments
            Uncertainty 0. A recording in whose segments the hand is not seen has none, if others
            have.

        Raises
        ------
        RecognitionError
            If a recording does not show the arm, or none shows its hand in a segment.

        Warns
        -----
        RecordingWarning
            Of a recording without a throw, and where the other hand throws harder.
        """
        named = tuple(
            self._name(recording, found)
            for recording, found in zip(recordings, segments, strict=True)
        )
        without = [one for one in named if self.label not in one.labels]
        messages = [
            f"{one.source}: the {self.arm} hand is seen to throw in none of "
            f"{len(one.bounds)} segments"
            for one in without
        ]
        if messages and len(without) == len(named):
            raise RecognitionError(f"{messages[0]}; expected one")
        for message in messages:
            warnings.warn(message, RecordingWarning, stacklevel=2)
        self._compare_hands(recordings)
        return named

    def _compare_hands(self, recordings: tuple[LabelledRecording, ...]) -> None:
        """Warn if the other hand throws harder in most recordings that show both."""
        harder = []
        for recording in recordings:
            arms = find_body(recording.markers, recording.source).arms
            best = {
                arm.side: np.fmax.reduce(
                    _throwing_energy(recording.marker(arm.hand), recording.rate_hz), initial=-np.inf
                )
                for arm in arms
            }
            if len(best) == len(SIDES):
                other = next(side for side in SIDES if side != self.arm)
                harder.append(best[other] > best[self.arm] + _HARDER_J_KG)
        if sum(harder) > len(harder) / 2:
            other = next(side for side in SIDES if side != self.arm)
            warnings.warn(
                f"the {other} hand throws harder than the {self.arm} one in {sum(harder)} of "
                f"{len(harder)} recordings: --set recognize.arm={other} --set select.arm={other} "
                "follows it",
                RecordingWarning,
                stacklevel=3,
            )

    def _name(
        self, recording: LabelledRecording, found: Segments | LabelledSegments
    ) -> LabelledSegments:
        """Name the segments of one recording."""
        body = find_body(recording.markers, recording.source)
        arm = next((one for one in body.arms if one.side == self.arm), None)
        if arm is None:
            raise RecognitionError(
                f"{recording.source}: the {self.arm} arm is not complete; got "
                f"{', '.join(recording.markers)}"
            )
        row = find_release(_throwing_energy(recording.marker(arm.hand), recording.rate_hz))
        inside = [row is not None and start <= row < stop for start, stop in found.bounds]
        labels = [self.label if thrown else OTHER for thrown in inside]
        none = np.zeros(len(labels))
        place = (found.rate_hz, found.source, found.first_frame)
        return LabelledSegments(found.bounds, tuple(labels), none, *place)


def _throwing_energy(path: FloatArray, rate_hz: float) -> FloatArray:
    """Return a hand's energy as of `hand_energy`, (T,), of its path (T, 3); NaN where unknown."""
    from scipy.ndimage import median_filter

    half = max(1, round(_WINDOW_S / 2 * rate_hz))
    energy = np.full(len(path), np.nan)
    seen = np.isfinite(path).all(axis=1)
    if len(path) <= 2 * half or not seen.any():
        return energy
    rows = np.arange(len(path))
    whole = np.stack([np.interp(rows, rows[seen], one[seen]) for one in path.T], axis=1)
    steady = median_filter(whole, size=(2 * (half // 2) + 3, 1), mode="nearest")
    steady[~seen] = np.nan
    way = np.linalg.norm(steady[2 * half :] - steady[: -2 * half], axis=1)
    energy[half:-half] = hand_energy(steady[half:-half, 2], way * rate_hz / (2 * half))
    return energy

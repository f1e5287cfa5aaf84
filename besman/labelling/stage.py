"""Stage: from a recording's trajectories to the markers of a set."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import Field

from besman.exceptions import LabellingError
from besman.labelling.gaps import BoolArray, fill_gaps, find_runs
from besman.labelling.marker_set import MarkerSet
from besman.records import FloatArray, LabelledRecording, Recording
from besman.stage import Stage, Work


class LabelConfig(Stage):
    """Take named trajectories for markers and fill short gaps.

    Attributes
    ----------
    method : "named"
        Trajectories carry names.
    markers : str
        A marker set of ``configs/markers`` or the path of one.
    longest_gap_s : float
        Gaps up to this length are filled. A longer one is an error in a required marker, and
        stays a gap in an optional one.
    """

    method: Literal["named"] = "named"
    markers: str = "right_arm"
    longest_gap_s: float = Field(default=0.25, ge=0.0)

    def run(
        self, recordings: tuple[Recording, ...], marker_set: MarkerSet, work: Work = Work()
    ) -> tuple[LabelledRecording, ...]:
        """Label recordings.

        Parameters
        ----------
        recordings : tuple of Recording
        marker_set : MarkerSet
            What `markers` names.
        work : Work

        Returns
        -------
        tuple of LabelledRecording
            Markers in the order of the set; trajectories that are no marker are left out.

        Raises
        ------
        LabellingError
            If a required marker is not there or has a gap that is too long.
        """
        labelled = []
        for number, recording in enumerate(recordings, start=1):
            labelled.append(self._label(recording, marker_set))
            work.progress(number / len(recordings))
        return tuple(labelled)

    def _label(self, recording: Recording, marker_set: MarkerSet) -> LabelledRecording:
        """Label one recording."""
        columns = marker_set.match(recording.names, recording.source)
        # A length in seconds that is a whole number of samples must not lose one to rounding.
        longest = int(np.floor(self.longest_gap_s * recording.rate_hz + 1e-6))
        fillings = [fill_gaps(recording.positions[:, index], longest) for index in columns.values()]
        positions = np.stack([filling[0] for filling in fillings], axis=1)
        for index, marker in enumerate(columns):
            if marker in marker_set.required:
                self._refuse_gap(positions[:, index], marker, recording)
        return LabelledRecording(
            time=recording.time,
            positions=positions,
            markers=tuple(columns),
            filled=np.stack([filling[1] for filling in fillings], axis=1),
            rate_hz=recording.rate_hz,
            source=recording.source,
            first_frame=recording.first_frame,
        )

    def _refuse_gap(self, positions: FloatArray, marker: str, recording: Recording) -> None:
        """Raise an error if a required marker still has a gap."""
        runs = find_runs(np.isnan(positions[:, 0]))
        if len(runs) == 0:
            return
        start, end = runs[np.argmax(runs[:, 1] - runs[:, 0])]
        first, last = recording.first_frame + start, recording.first_frame + end - 1
        raise LabellingError(
            f"{recording.source}: marker {marker!r} is not seen in frames {first} to {last} "
            f"({(end - start) / recording.rate_hz:.3g} s); gaps up to longest_gap_s = "
            f"{self.longest_gap_s:g} s are filled"
        )


def label_results(
    recordings: tuple[Recording, ...],
    labelled: tuple[LabelledRecording, ...],
    marker_set: MarkerSet,
) -> dict[str, Any]:
    """Figures of the stage for ``results.json``.

    Parameters
    ----------
    recordings : tuple of Recording
    labelled : tuple of LabelledRecording
        What the stage made of them.
    marker_set : MarkerSet

    Returns
    -------
    dict
        ``n_recordings``; ``fragments``: unbroken stretches of trajectories; ``named_share``:
        named share of all samples seen; ``filled_samples``; ``review``: what a person should look
        at: trajectories that were left out, as ``{"recording", "trajectory", "reason"}``.
    """
    fragments = seen_samples = named_samples = filled_samples = 0
    review = []
    for recording, result in zip(recordings, labelled, strict=True):
        seen: BoolArray = np.all(np.isfinite(recording.positions), axis=2)
        fragments += sum(len(find_runs(column)) for column in seen.T)
        seen_samples += int(seen.sum())
        named_samples += int((np.isfinite(result.positions[:, :, 0]) & ~result.filled).sum())
        filled_samples += int(result.filled.sum())
        used = set(marker_set.match(recording.names, recording.source).values())
        review += [
            {
                "recording": recording.source,
                "trajectory": name or f"trajectory {index + 1}",
                "reason": f"no marker of {marker_set.name}",
            }
            for index, name in enumerate(recording.names)
            if index not in used
        ]
    return {
        "n_recordings": len(recordings),
        "fragments": fragments,
        "named_share": named_samples / seen_samples if seen_samples else 0.0,
        "filled_samples": filled_samples,
        "review": review,
    }

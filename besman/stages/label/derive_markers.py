"""Markers of back and hands that nobody wears, added to a recording with names."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import TypeVar

import numpy as np

from besman.exceptions import LabellingError, RecordingWarning
from besman.person.marker_set import MarkerSet
from besman.person.point_frames import DerivedMarkers, PointFrames
from besman.records import FloatArray, LabelledRecording, Recording
from besman.stages.label.joined_trajectories import WovenRecording
from besman.stages.label.named_recording import NamedRecording

Named = TypeVar("Named", LabelledRecording, NamedRecording)


def mend_hands(
    positions: FloatArray,
    markers: tuple[str, ...],
    marker_set: MarkerSet,
    recording: Recording | WovenRecording,
) -> FloatArray:
    """Make gaps of points of a hand that cannot be where they are, and exchange its sides back.

    Parameters
    ----------
    positions : array, shape (T, M, 3)
        Metres; not written to.
    markers : tuple of str, length M
    marker_set : MarkerSet
    recording : Recording or WovenRecording
        Where they are from.

    Returns
    -------
    array, shape (T, M, 3)
        The same one where nothing is left out.

    Warns
    -----
    RecordingWarning
        With the points and how many of their samples became gaps, or were exchanged.
    """
    if not isinstance(marker_set.frames, PointFrames):
        return positions
    mended = marker_set.frames.mend(positions, markers, recording.rate_hz)
    for found, what in (
        (mended.gaps, "lie farther from their wrist than a hand is long became gaps"),
        (mended.exchanged, "turn a hand over for a moment were exchanged back"),
    ):
        counts = found.sum(axis=0)
        named = ", ".join(f"{markers[k]} {counts[k]}" for k in np.flatnonzero(counts))
        if named:
            said = f"{recording.source}: samples that {what}: {named}"
            warnings.warn(said, RecordingWarning, stacklevel=4)
    return mended.positions


def derive_markers(labelled: Named, marker_set: MarkerSet, hold: bool = True) -> Named:
    """Add the markers that the set's `frames` derive from single points.

    Parameters
    ----------
    labelled : LabelledRecording
        With the set's own markers, gaps filled.
    marker_set : MarkerSet
    hold : bool
        As of `besman.person.point_frames.PointFrames.derive`.

    Returns
    -------
    LabelledRecording
        The same one where the set derives none.
    """
    frames, orientations = marker_set.frames, labelled.orientations
    if frames is None:
        return labelled
    added: DerivedMarkers
    if isinstance(frames, PointFrames):
        added = frames.derive(labelled.positions, labelled.markers, labelled.filled, hold)
        if added.n_held:
            warnings.warn(
                f"{labelled.source}: a hand of which a finger is not seen goes along with its "
                f"forearm, in {added.n_held} frames",
                RecordingWarning,
                stacklevel=4,
            )
    elif orientations is None:
        raise LabellingError(
            f"{labelled.source}: nothing tells how {frames.hand} of {marker_set.name} is turned"
        )
    else:
        added = frames.derive_of_bodies(
            labelled.positions, orientations, labelled.markers, labelled.filled
        )
    if orientations is not None:
        unknown = np.full((len(labelled.time), len(added.names), 4), np.nan)
        orientations = np.concatenate((orientations, unknown), axis=1)
    return replace(
        labelled,
        markers=(*labelled.markers, *added.names),
        positions=np.concatenate((labelled.positions, added.positions), axis=1),
        filled=np.concatenate((labelled.filled, added.filled), axis=1),
        orientations=orientations,
    )

"""Markers of back and hands that nobody wears, added to a recording with names."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np

from besman.exceptions import LabellingError
from besman.person.marker_set import MarkerSet
from besman.person.point_frames import DerivedMarkers, PointFrames
from besman.records import LabelledRecording
from besman.stages.label.named_recording import NamedRecording

Named = TypeVar("Named", LabelledRecording, NamedRecording)


def derive_markers(labelled: Named, marker_set: MarkerSet) -> Named:
    """Add the markers that the set's `frames` derive from single points.

    Parameters
    ----------
    labelled : LabelledRecording
        With the set's own markers, gaps filled.
    marker_set : MarkerSet

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
        added = frames.derive(labelled.positions, labelled.markers, labelled.filled)
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

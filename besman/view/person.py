"""The person of a demonstration: markers around the segment, in a frame on the floor below them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from besman.exceptions import BesmanError
from besman.geometry.frames import back_frame
from besman.person.body import find_body
from besman.records import FloatArray, LabelledRecording
from besman.view.packing import Packer

_BEFORE_S, _AFTER_S = 0.6, 1.2
# A back is not lower above the floor, sitting on a chair, and nothing is below the floor.
_LOWEST_BACK_M, _BELOW_M = 0.6, 0.03


@dataclass(frozen=True, eq=False)
class PersonMarkers:
    """Markers of a person around one demonstration.

    Attributes
    ----------
    names : tuple of str, length M
    markers : array, shape (F, M, 3)
        Metres, x forward, y left, z up from the floor below the middle of the back at the start of
        the segment, or in the laboratory frame where no back is seen; NaN where not seen.
    start_s, interval_s : float
        Time of the first frame after the start of the segment, and between frames, seconds.
    back_height_m : float
        Of the origin of the back frame above the floor; 0 where no back is seen.
    limbs : list of list of int
        Markers of each chain from the back over shoulder and elbow to the hand.
    patches : list of list of int
        Markers of back and hands: three each.
    thrown : int
        Marker of the object; -1 if there is none.
    on_floor : bool
        Whether the height 0 of the laboratory can be the floor that the person stands on.
    """

    names: tuple[str, ...]
    markers: FloatArray
    start_s: float
    interval_s: float
    back_height_m: float
    limbs: list[list[int]]
    patches: list[list[int]]
    thrown: int
    on_floor: bool

    def content(self, packer: Packer) -> dict[str, Any]:
        """Return the person as a page is given it."""
        return {
            "names": list(self.names),
            "start": self.start_s,
            "interval": self.interval_s,
            "limbs": self.limbs,
            "patches": self.patches,
            "thrown": self.thrown,
            "onFloor": self.on_floor,
            "markers": packer.add(self.markers),
        }


def find_person(
    recording: LabelledRecording, bounds: tuple[int, int], thrown: str | None, rate_hz: float
) -> PersonMarkers:
    """Take a person out of a recording.

    Parameters
    ----------
    recording : LabelledRecording
    bounds : pair of int
        Half-open rows of the segment.
    thrown : str or None
        Marker of the object.
    rate_hz : float
        Frames per second, at most.

    Returns
    -------
    PersonMarkers
    """
    start, stop = bounds
    stride = max(round(recording.rate_hz / rate_hz), 1)
    first = start - int(_BEFORE_S * recording.rate_hz) // stride * stride
    first += max(0, -(first // stride)) * stride
    last = min(stop + round(_AFTER_S * recording.rate_hz), len(recording.time))
    rows = np.arange(first, last, stride)
    rotation, origin = _back(recording, start)
    foot = origin * (1.0, 1.0, 0.0)
    names = recording.markers
    limbs, patches = _body(recording)
    return PersonMarkers(
        names=names,
        markers=(recording.positions[rows] - foot) @ rotation,
        start_s=float(recording.time[first] - recording.time[start]),
        interval_s=stride / recording.rate_hz,
        back_height_m=float(origin[2]),
        limbs=limbs,
        patches=patches,
        thrown=names.index(thrown) if thrown in names else -1,
        on_floor=bool(origin[2] > _LOWEST_BACK_M and _lowest(recording) > -_BELOW_M),
    )


def _lowest(recording: LabelledRecording) -> float:
    """Return the least height in a recording, metres."""
    heights = recording.positions[..., 2]
    return float(heights[np.isfinite(heights)].min(initial=np.inf))


def _back(recording: LabelledRecording, start: int) -> tuple[FloatArray, FloatArray]:
    """Return back2lab (3, 3) and its origin (m) at the row nearest to `start` where it is seen."""
    try:
        body = find_body(recording.markers, recording.source)
        back = np.stack([recording.marker(name) for name in body.back])
        seen = np.flatnonzero(np.isfinite(back).all(axis=(0, 2)))
        row = seen[np.abs(seen - start).argmin()]
        return back_frame(*back[:, row])
    except (BesmanError, ValueError):
        return np.eye(3), np.zeros(3)


def _body(recording: LabelledRecording) -> tuple[list[list[int]], list[list[int]]]:
    """Return the chains of markers along the arms, and the triangles of back and hands."""
    names = recording.markers
    try:
        body = find_body(names, recording.source)
    except BesmanError:
        return [], []
    limbs = [
        [names.index(name) for name in (body.back[0], arm.shoulder, arm.elbow, arm.hand)]
        for arm in body.arms
    ]
    clusters = [body.back, *(arm.cluster for arm in body.arms)]
    patches = [[names.index(name) for name in group] for group in clusters if len(set(group)) == 3]
    return limbs, patches

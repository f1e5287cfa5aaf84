"""What a throw is aimed at: where the object came down, or where it would have."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt

from besman.records import LabelledRecording
from besman.stages.select.flight import check_thrown, object_touchdown
from besman.stages.select.release import (
    HandPath,
    landing_of_flight,
    landing_of_release,
    left_hand,
)

FloatArray = npt.NDArray[np.float64]

TargetSource = Literal["object", "landing", "flight", "release"]


@dataclass(frozen=True, eq=False)
class Aim:
    """Where the target of a throw comes from.

    Attributes
    ----------
    sources : tuple of str
        Tried in this order; the first that tells a place counts. None: there is no target.
    object : str, optional
        Marker of what is thrown.
    landing : array, shape (3,)
        Where it came down by a landing file or the recording's own, metres in the laboratory
        frame; NaN if they say nothing of this throw.
    height_m : float
        Height above the floor at which flight and release are followed no further.
    scale : float
        The target is brought nearer to the releasing hand by this factor.
    """

    sources: tuple[TargetSource, ...] = ()
    object: str | None = None
    landing: FloatArray = field(default_factory=lambda: np.full(3, np.nan))
    height_m: float = 0.0
    scale: float = 1.0


def find_target(
    recording: LabelledRecording, bounds: tuple[int, int], hand: HandPath, aim: Aim
) -> tuple[FloatArray, TargetSource | None]:
    """Find the target of one throw.

    Parameters
    ----------
    recording : LabelledRecording
    bounds : pair of int
        Half-open rows of the throw.
    hand : HandPath
    aim : Aim

    Returns
    -------
    target : array, shape (3,)
        On the floor (z = 0) below where the object came down, metres in the laboratory frame; NaN
        if no source tells it.
    source : str or None
        Which one told it; None if none did.

    Raises
    ------
    MappingError
        If the recording has no marker of the object.
    """
    if aim.object is not None:
        check_thrown(aim.object, recording.markers, recording.source)
    for source in aim.sources:
        place = _look(source, recording, bounds, hand, aim)
        if np.isfinite(place).all():
            start = hand.positions[hand.release]
            target = np.zeros(3)
            target[:2] = start[:2] + aim.scale * (place - start)[:2]
            return target, source
    return np.full(3, np.nan), None


def _look(
    source: TargetSource,
    recording: LabelledRecording,
    bounds: tuple[int, int],
    hand: HandPath,
    aim: Aim,
) -> FloatArray:
    """Ask one source."""
    if source == "landing":
        return aim.landing
    if source == "release":
        return landing_of_release(hand, aim.height_m)
    assert aim.object is not None
    if source == "object":
        return object_touchdown(
            recording, bounds, aim.object, left_hand(recording, aim.object, hand)
        )
    return landing_of_flight(recording, aim.object, hand, aim.height_m)

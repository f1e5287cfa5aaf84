"""Where a throw would come down, told from what was seen of its beginning.

Two ways: from the hand as it lets go, and from the thrown object's first metres, of which a camera
at 30 Hz sees a handful of frames before it leaves the volume.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.person.release import find_release, hand_energy
from besman.records import LabelledRecording
from besman.stages.select.flight import GRAVITY

FloatArray = npt.NDArray[np.float64]

_NO_PLACE = np.full(3, np.nan)
# The object leaves the hand about then, and is farther from it afterwards: a hand without fingers
# is highest and fastest late.
_BEFORE_RELEASE_S, _AFTER_RELEASE_S = 0.5, 0.2
_AWAY_M = 0.10
_LEAST_SIGHTINGS = 4
_MOST_EDGES = 30
# A ball that was caught is carried along what may pass for a parabola too.
_LATEST_START_S = 0.15
_LEAST_WAY_M = 0.3
_LONGEST_GAP_S = 0.11
_LONGEST_FLIGHT_S = 1.0
# Where the object enters and leaves the volume, its position is worse than a marker's.
_GREATEST_RESIDUAL_M = 0.03


@dataclass(frozen=True, eq=False)
class HandPath:
    """The throwing hand around a throw, smooth.

    Attributes
    ----------
    time : array, shape (H,)
        Seconds, of the recording.
    positions : array, shape (H, 3)
        Middle of the hand, metres in the laboratory frame (z up).
    throw : slice
        Samples of the throw itself.
    """

    time: FloatArray
    positions: FloatArray
    throw: slice

    @property
    def velocities(self) -> FloatArray:
        """Metres per second, shape (H, 3)."""
        velocities: FloatArray = np.gradient(self.positions, self.time, axis=0)
        return velocities

    @property
    def release(self) -> int:
        """Sample of the throw at which the hand lets go."""
        speeds = np.linalg.norm(self.velocities, axis=1)
        energy = hand_energy(self.positions[:, 2], speeds)[self.throw]
        return int(self.throw.start) + (find_release(energy) or 0)


def fall_to(place: FloatArray, velocity: FloatArray, height_m: float) -> FloatArray:
    """Follow a free flight down to a height.

    Parameters
    ----------
    place : array, shape (3,)
        Metres in the laboratory frame (z up).
    velocity : array, shape (3,)
        Metres per second.
    height_m : float
        Above the floor, metres.

    Returns
    -------
    array, shape (3,)
        Metres; NaN if the flight does not reach the height.
    """
    beneath = velocity[2] ** 2 + 2 * GRAVITY * (place[2] - height_m)
    if not beneath >= 0.0:
        return _NO_PLACE.copy()
    duration = (velocity[2] + np.sqrt(beneath)) / GRAVITY
    if duration < 0.0:
        return _NO_PLACE.copy()
    landed: FloatArray = place + duration * velocity
    landed[2] = height_m
    return landed


def landing_of_release(hand: HandPath, height_m: float = 0.0) -> FloatArray:
    """Return where something comes down that flies on as the hand moves at the release.

    Parameters
    ----------
    hand : HandPath
    height_m : float
        Above the floor, metres.

    Returns
    -------
    array, shape (3,)
        Metres in the laboratory frame; NaN if it does not reach the height.
    """
    row = hand.release
    return fall_to(hand.positions[row], hand.velocities[row], height_m)


def landing_of_flight(
    recording: LabelledRecording, marker: str, hand: HandPath, height_m: float = 0.0
) -> FloatArray:
    """Return where the thrown object comes down, by its first metres after the hand let go.

    Parameters
    ----------
    recording : LabelledRecording
    marker : str
        The object's marker.
    hand : HandPath
    height_m : float
        Above the floor, metres.

    Returns
    -------
    array, shape (3,)
        Metres in the laboratory frame; NaN if no four sightings on 0.3 m lie on a
        parabola, or it does not reach the height.
    """
    time, path = _sightings(recording, marker, hand)
    # The longest stretch on a parabola, the latest of equals: beside the hand the object is still
    # pushed, and at last it may have bounced or been caught.
    edges = np.unique(np.linspace(0, len(time), min(len(time), _MOST_EDGES) + 1).astype(int))
    early = [start for start in edges[:-1] if time[start] - time[0] <= _LATEST_START_S]
    stretches = sorted(
        ((stop - start, start, stop) for start in early for stop in edges), reverse=True
    )
    for length, start, stop in stretches:
        if length < _LEAST_SIGHTINGS:
            break
        seen = path[start:stop]
        if np.linalg.norm(seen[-1] - seen[0]) < _LEAST_WAY_M:
            continue
        place, velocity, residual = _fit_parabola(time[start:stop], seen)
        if residual <= _GREATEST_RESIDUAL_M:
            return fall_to(place, velocity, height_m)
    return _NO_PLACE.copy()


def left_hand(recording: LabelledRecording, marker: str, hand: HandPath) -> npt.NDArray[np.bool_]:
    """Tell in which rows the thrown object has left the hand.

    Parameters
    ----------
    recording : LabelledRecording
    marker : str
        The object's marker.
    hand : HandPath

    Returns
    -------
    bool array, shape (T,)
        True from when it is for good 10 cm farther away than it is at its nearest about the
        release.
    """
    time, path = recording.time, recording.marker(marker)
    at = np.stack([np.interp(time, hand.time, one) for one in hand.positions.T], axis=1)
    away = np.linalg.norm(path - at, axis=1)
    since = time - hand.time[hand.release]
    near = (since >= -_BEFORE_RELEASE_S) & (since <= _AFTER_RELEASE_S) & np.isfinite(away)
    if not near.any():
        return np.zeros(len(time), dtype=np.bool_)
    nearest = float(away[near].min())
    last = int(np.flatnonzero(near & (away <= nearest + _AWAY_M))[-1])
    # NaN, where it is not seen, compares false.
    gone: npt.NDArray[np.bool_] = (away > nearest + _AWAY_M) & (np.arange(len(away)) > last)
    return gone


def _sightings(
    recording: LabelledRecording, marker: str, hand: HandPath
) -> tuple[FloatArray, FloatArray]:
    """Return when and where the object was seen after it left the hand, without a longer gap."""
    column = recording.markers.index(marker)
    released = hand.time[hand.release]
    low, high = np.searchsorted(
        recording.time, [released - _BEFORE_RELEASE_S, released + _LONGEST_FLIGHT_S]
    )
    time, path = recording.time[low:high], recording.positions[low:high, column]
    seen = np.isfinite(path).all(axis=1) & ~recording.filled[low:high, column]
    time, path = time[seen], path[seen]
    gone = np.flatnonzero(left_hand(recording, marker, hand)[low:high][seen])
    if not len(gone):
        return time[:0], path[:0]
    time, path = time[gone[0] :], path[gone[0] :]
    breaks = np.flatnonzero(np.diff(time) > max(_LONGEST_GAP_S, 3.5 / recording.rate_hz))
    last = int(breaks[0]) + 1 if len(breaks) else len(time)
    return time[:last], path[:last]


def _fit_parabola(time: FloatArray, path: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Fit place and velocity at the first sighting under gravity; with the RMS distance, metres."""
    since = time - time[0]
    basis = np.stack([np.ones_like(since), since], axis=1)
    straight = path + np.outer(since**2, [0.0, 0.0, GRAVITY / 2])
    (start, velocity), *_ = np.linalg.lstsq(basis, straight, rcond=None)
    apart = straight - basis @ np.stack([start, velocity])
    return start, velocity, float(np.sqrt((apart**2).sum(axis=1).mean()))

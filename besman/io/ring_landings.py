"""Where a throw met the plane of a basketball ring, by what the recording's own file says.

The SPL open data (basketball/freethrow) have ``landing_x`` and ``landing_y``: inches from the
front of the ring, x to the right of who throws, y away. The frame is that of an NBA court, in feet,
z up. Its README has the origin in the middle of the court, as the throws of 2024; those of December
2025 have it in a corner. So the ring is looked for: it is the one of such courts that is as far
from the person as throws go; no two of them are.

References
----------
NBA Official Rules, rule 1: a court of 94 by 50 ft, rings of 18 in, 10 ft high, whose middle is
5.25 ft from the baseline.
"""

from __future__ import annotations

import warnings
from itertools import product

import numpy as np

from besman.io.warning import warn_of_file
from besman.records import FloatArray, Landing, Recording

_FOOT_M = 0.3048
_RADIUS_M = 0.75 * _FOOT_M
_HEIGHT_M = 10.0 * _FOOT_M
# Middles of rings, from the middle of a court and from each of its corners.
_FROM_MIDDLE = [(x, 0.0) for x in (-41.75, 41.75)]
_FROM_CORNER = list(product((-88.75, -5.25, 5.25, 88.75), (-25.0, 25.0)))
_RINGS_M = np.array(_FROM_MIDDLE + _FROM_CORNER) * _FOOT_M
# A free throw is made from 4.2 m before the ring's middle, one of three points from 7.2.
_NEAREST_M, _FARTHEST_M = 1.0, 7.5


def find_ring_landing(recording: Recording) -> Landing | None:
    """Find where the ball came down that the recording's file tells of.

    Parameters
    ----------
    recording : Recording
        `Origin.on_ring_m` has what the file says.

    Returns
    -------
    Landing or None
        In the recording's frame, at the height of the ring; None if the file says nothing, or
        nobody knows where the ring is.

    Warns
    -----
    RecordingWarning
        If the file says it and no ring is near the person.
    """
    said = None if recording.origin is None else recording.origin.on_ring_m
    if said is None:
        return None
    person = _where(recording)
    apart = np.linalg.norm(_RINGS_M - person, axis=1)
    apart[apart < _NEAREST_M] = np.inf
    nearest = int(np.argmin(np.nan_to_num(apart, nan=np.inf)))
    if not apart[nearest] <= _FARTHEST_M:
        warn_of_file(
            f"{recording.source}: landing_x and landing_y are left out of account: no ring of an "
            f"NBA court in feet, from its middle or a corner, is within {_FARTHEST_M:g} m of the "
            f"person at {person[0]:.1f}, {person[1]:.1f} m; a landing file says where it was "
            "(select.landing)"
        )
        return None
    ring = _RINGS_M[nearest]
    forward = 1.0 if ring[0] > person[0] else -1.0
    right, away = said
    place = [ring[0] + forward * (away - _RADIUS_M), ring[1] - forward * right, _HEIGHT_M]
    return Landing(recording.source, 1, np.array(place))


def _where(recording: Recording) -> FloatArray:
    """Return where the person is most of the time, shape (2,), metres; NaN if not seen."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # nothing is seen
        where: FloatArray = np.nanmedian(recording.positions[..., :2], axis=(0, 1))
    return where

"""A person's hand, frame by frame, as the person's back at the beginning sees it."""

from __future__ import annotations

import numpy as np

from besman.exceptions import BesmanError, LabellingError
from besman.geometry.frames import back_frame, hand_frame
from besman.records import FloatArray, LabelledRecording
from besman.records.layers import Side
from besman.stages.select.body_points import point_names

# So long the back is looked at; and that many frames, at least, tell the shape of the hand.
_BACK_S = 0.5
# No hand is faster, and its markers keep their distances, metres.
_FASTEST_M_S, _SHAKEN_M = 15.0, 0.02
_BENT_M = 0.03
# After a jump a hand is believed where it stays for so long, or at once where it goes on as before.
_STEADY_S = 0.2
_AS_BEFORE_S, _AS_BEFORE_M, _AS_BEFORE_M_S = 0.1, 0.05, 2.0


class HandStream:
    """Takes frames; tells where the hand is, while that can be believed.

    The person's frame is that of the back in the first half second, and stands still
    (`besman.stages.select.hand_trajectory.map_record`).

    Parameters
    ----------
    blank : LabelledRecording
        One frame: the markers, and the rate.
    side : "right" or "left"
        The arm.

    Raises
    ------
    BesmanError
        If markers of back or hand are not there, or nothing tells how the hand is turned.
    """

    def __init__(self, blank: LabelledRecording, side: Side) -> None:
        names = point_names(blank, side, blank.source)
        if names[3] == names[4]:
            raise LabellingError(
                f"{blank.source}: nothing tells how {names[3]} is turned; expected the markers "
                "hand_top, hand_left and hand_right"
            )
        self._columns = [blank.markers.index(name) for name in names]
        self._step_s = 1.0 / blank.rate_hz
        self._n_first = max(3, round(_BACK_S * blank.rate_hz))
        self._n_steady = max(2, round(_STEADY_S * blank.rate_hz))
        self._first: list[FloatArray] = []
        self._back: tuple[FloatArray, FloatArray] | None = None
        self._shape = np.zeros(3)
        self._n = 0
        # Row and place: of the hand as it was seen last, and as it was believed last.
        self._seen: tuple[int, FloatArray] | None = None
        self._kept: tuple[int, FloatArray] | None = None
        self._n_alike, self._trusted = 0, True

    @property
    def knows_back(self) -> bool:
        """Whether the person's frame is known."""
        return self._back is not None

    def take(self, markers: FloatArray) -> FloatArray | None:
        """Take a frame, shape (M, 3), metres.

        Returns
        -------
        array, shape (4, 4), or None
            hand2back, metres; None where a marker of the hand is hidden, the hand has jumped, or
            the back is not known yet.
        """
        self._n += 1
        points = markers[self._columns]
        if self._back is None:
            self._look_at_back(points)
            return None
        hand = points[3:]
        if not np.isfinite(hand).all() or not self._is_hand(hand):
            return None
        if not self._believe(hand.mean(axis=0)):
            return None
        turn, origin = self._back
        try:
            hand2lab, place = hand_frame(*hand)
        except LabellingError:
            # Three markers on a line: as if one was hidden.
            return None
        pose = np.eye(4)
        pose[:3, :3] = turn.T @ hand2lab
        pose[:3, 3] = (place - origin) @ turn
        return pose

    def in_back(self, markers: FloatArray) -> FloatArray:
        """Return markers (M, 3) of the laboratory in the person's frame, once that is known."""
        assert self._back is not None
        turn, origin = self._back
        seen: FloatArray = (markers - origin) @ turn
        return seen

    def _look_at_back(self, points: FloatArray) -> None:
        """Keep frames that show back and hand; know the back once there are enough."""
        if np.isfinite(points).all():
            self._first.append(points)
        if len(self._first) < self._n_first:
            return
        middle = np.median(self._first, axis=0)
        try:
            self._back = back_frame(*middle[:3])
            hand_frame(*middle[3:])
        except BesmanError as error:
            raise LabellingError(f"the first {_BACK_S:g} s of the stream: {error}") from None
        self._shape = np.median([_sides(one[3:]) for one in self._first], axis=0)
        self._first = []

    def _is_hand(self, hand: FloatArray) -> bool:
        """Tell whether the markers of the hand are as far from each other as at the beginning."""
        return bool(np.all(np.abs(_sides(hand) - self._shape) <= _BENT_M))

    def _believe(self, place: FloatArray) -> bool:
        """Tell whether the hand can be there, after where it was."""
        was, self._seen = self._seen, (self._n, place)
        if was is not None:
            way_m, passed_s = self._way(was, place)
            alike = way_m <= _SHAKEN_M + _FASTEST_M_S * passed_s
            self._n_alike = self._n_alike + 1 if alike else 0
            self._trusted &= alike
        if not self._trusted and self._kept is not None:
            way_m, passed_s = self._way(self._kept, place)
            near = way_m <= _AS_BEFORE_M + _AS_BEFORE_M_S * passed_s
            as_before = passed_s <= _AS_BEFORE_S and near
            self._trusted = as_before or self._n_alike >= self._n_steady
        if self._trusted:
            self._kept = self._seen
        return self._trusted

    def _way(self, since: tuple[int, FloatArray], place: FloatArray) -> tuple[float, float]:
        """Return how far the hand came since, and in how many seconds."""
        row, before = since
        return float(np.linalg.norm(place - before)), (self._n - row) * self._step_s


def _sides(cluster: FloatArray) -> FloatArray:
    """Return the distances between three markers."""
    sides: FloatArray = np.linalg.norm(cluster - np.roll(cluster, 1, axis=0), axis=1)
    return sides

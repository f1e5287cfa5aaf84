"""Back and hands of a person who wears no rigid clusters there: as keypoints and joints tell them.

What single points do not tell is assumed, and `PointFrames.find_assumptions` says what. The result
is the markers that a person with clusters wears, so that every stage sees these.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt
from pydantic import Field

from besman.config.stage import Config
from besman.person.torn_hands import find_torn, find_turned_over, hold_to_forearm

FloatArray = npt.NDArray[np.float64]

_PARTS = ("top", "left", "right")
# From the middle between the shoulders, x forward, y left, z up along the trunk, metres: where
# right_arm.yaml has the markers of the back on a person of 1.70 m.
_ON_BACK_M = np.array([[-0.087, 0.0, -0.035], [-0.099, 0.06, -0.155], [-0.099, -0.06, -0.155]])
# From the middle of the hand, in its own axes, metres: a cluster on the back of a hand.
_ON_HAND_M = np.array([[0.04, 0.0, 0.0], [-0.02, 0.03, 0.0], [-0.02, -0.03, 0.0]])
_BEYOND_WRIST_M = 0.05  # the middle of a hand of which no finger is seen
_LEAST_BEND = 0.17  # sine of the angle at the elbow below which its plane is noise: 10 degrees


class BackPoints(Config):
    """Which points tell where the person stands and faces.

    Attributes
    ----------
    left, right : tuple of str
        Points (their mean counts) of which one lies to the person's left of the other, as the
        shoulders.
    middle : tuple of str
        Where the trunk is, at the height of the shoulders; the mean of left and right if empty.
    bottom : tuple of str
        Lower end of the trunk, as the hips; the trunk is taken for upright if empty.
    """

    left: tuple[str, ...] = Field(min_length=1)
    right: tuple[str, ...] = Field(min_length=1)
    middle: tuple[str, ...] = ()
    bottom: tuple[str, ...] = ()


class HandPoints(Config):
    """Which points tell an arm and how its hand is turned; of several the mean counts.

    Attributes
    ----------
    shoulder, elbow, wrist : tuple of str
        Near the joints.
    fingers : tuple of str
        Knuckles, or whatever lies beyond the wrist; the hand goes on like the forearm if empty.
    thumb_side, little_side : tuple of str
        Points of hand or wrist on the side of the thumb and of the little finger, as two knuckles.
        If one is empty, the forearm is taken for turned neither in nor out: the thumb lies in
        the plane in which the elbow bends.
    """

    shoulder: tuple[str, ...] = Field(min_length=1)
    elbow: tuple[str, ...] = Field(min_length=1)
    wrist: tuple[str, ...] = Field(min_length=1)
    fingers: tuple[str, ...] = ()
    thumb_side: tuple[str, ...] = ()
    little_side: tuple[str, ...] = ()

    @property
    def points_beyond(self) -> set[str]:
        """Points of the hand itself."""
        return {*self.fingers, *self.thumb_side, *self.little_side} - {*self.wrist}


Part = TypeVar("Part", BackPoints, HandPoints)


class DerivedMarkers(NamedTuple):
    """Markers that nobody wears.

    Attributes
    ----------
    names : tuple of str, length D
    positions : array, shape (T, D, 3)
        Metres in the laboratory frame; NaN where a point that they need is not seen.
    filled : bool array, shape (T, D)
        True where a point that they need was filled.
    n_held : int
        Frames in which a hand goes along with its forearm, as a finger is not seen.
    """

    names: tuple[str, ...]
    positions: FloatArray
    filled: npt.NDArray[np.bool_]
    n_held: int = 0


class MendedHands(NamedTuple):
    """Points without what no hand does.

    Attributes
    ----------
    positions : array, shape (T, M, 3)
        Metres, in the frame they were given in; NaN where left out.
    gaps, exchanged : bool array, shape (T, M)
        What was left out, and what stands in another point's place now.
    """

    positions: FloatArray
    gaps: npt.NDArray[np.bool_]
    exchanged: npt.NDArray[np.bool_]


class PointFrames(Config):
    """From which points back and hands are derived.

    Attributes
    ----------
    back : BackPoints
    hand, left_hand : HandPoints, optional
        Of the right and of the left arm.
    """

    back: BackPoints
    hand: HandPoints | None = None
    left_hand: HandPoints | None = None

    @property
    def hands(self) -> tuple[tuple[str, HandPoints], ...]:
        """Both hands, as far as they are there, with what stands before their markers' names."""
        both = (("", self.hand), ("left_", self.left_hand))
        return tuple((prefix, hand) for prefix, hand in both if hand is not None)

    @property
    def points(self) -> tuple[str, ...]:
        """All points that are looked at."""
        parts = (self.back, *(hand for _, hand in self.hands))
        names = (name for part in parts for group in dict(part).values() for name in group)
        return tuple(dict.fromkeys(names))

    @property
    def names(self) -> tuple[str, ...]:
        """All markers that can be derived."""
        arms = (
            f"{prefix}{name}"
            for prefix, _ in self.hands
            for name in ("shoulder", "elbow", *(f"hand_{part}" for part in _PARTS))
        )
        return (*(f"back_{part}" for part in _PARTS), *arms)

    def find_assumptions(self, markers: Collection[str]) -> tuple[str, ...]:
        """Return what is assumed because no point of a recording tells it, a sentence each."""
        back = _limit(self.back, markers)
        if back is None:
            return ()
        said = ["the markers of the back lie as on a person of 1.70 m"]
        if not back.bottom:
            said.append("the trunk is upright")
        hands = [one for _, hand in self.hands if (one := _limit(hand, markers)) is not None]
        if any(not hand.fingers for hand in hands):
            said.append(
                "a hand goes on like its forearm, its middle "
                f"{100 * _BEYOND_WRIST_M:g} cm beyond the wrist"
            )
        if any(not (hand.thumb_side and hand.little_side) for hand in hands):
            said.append("a forearm is turned neither in nor out: the thumb is in the elbow's plane")
        return tuple(said)

    def mend(self, positions: FloatArray, markers: tuple[str, ...], rate_hz: float) -> MendedHands:
        """Leave out points that no hand has there, and exchange its sides back.

        See `besman.person.torn_hands`.

        Parameters
        ----------
        positions : array, shape (T, M, 3)
            Metres in any frame; NaN where not seen. Not written to.
        markers : tuple of str, length M
        rate_hz : float
            Frames per second.

        Returns
        -------
        MendedHands
        """
        gaps, exchanged = np.zeros((2, *positions.shape[:2]), dtype=np.bool_)
        mended = positions
        points = _Points(positions, markers, gaps)
        for _, whole in self.hands:
            hand = _limit(whole, markers)
            fingers = set() if hand is None else hand.points_beyond
            columns = [column for column, name in enumerate(markers) if name in fingers]
            if hand is None or not columns:
                continue
            elbow, wrist = points.mean(hand.elbow), points.mean(hand.wrist)
            torn = find_torn(elbow, wrist, positions[:, columns], rate_hz)
            gaps[:, columns] |= torn.points
            gaps[:, [markers.index(name) for name in hand.wrist]] |= torn.wrist[:, None]
            over = [markers.index(name) for name in hand.thumb_side]
            back = [markers.index(name) for name in hand.little_side]
            if not (over and back):
                continue
            kept = _Points(np.where(gaps[:, :, None], np.nan, positions), markers, gaps)
            thumb, little = kept.mean(hand.thumb_side), kept.mean(hand.little_side)
            turned = find_turned_over(thumb, little, rate_hz)
            gaps[:, [*over, *back]] |= turned.on_the_way[:, None]
            if turned.over.any() and len(over) == len(back):
                mended = mended.copy() if mended is positions else mended
                rows = np.flatnonzero(turned.over)[:, None]
                mended[rows, [*over, *back]] = mended[rows, [*back, *over]]
                exchanged[rows, [*over, *back]] = True
        if gaps.any():
            mended = np.where(gaps[:, :, None], np.nan, mended)
        return MendedHands(mended, gaps, exchanged)

    def derive(
        self,
        positions: FloatArray,
        markers: tuple[str, ...],
        filled: npt.NDArray[np.bool_],
        hold: bool = True,
    ) -> DerivedMarkers:
        """Derive the markers of back and hands.

        Parameters
        ----------
        positions : array, shape (T, M, 3)
            Points, metres in the laboratory frame (z up); NaN where not seen.
        markers : tuple of str, length M
            Their names. An arm without one of shoulder, elbow and wrist is left out, fingers and
            sides that are not complete are not looked at, and what is there already stays.
        filled : bool array, shape (T, M)
            Which samples were filled.
        hold : bool
            A hand of which a finger is not seen goes along with its forearm, as told by what was
            seen before and comes later.

        Returns
        -------
        DerivedMarkers
        """
        points = _Points(positions, markers, filled)
        seen = np.flatnonzero(np.isfinite(positions).all(axis=2).any(axis=0))
        # A point that is never seen is as one that is not there.
        markers_seen = tuple(markers[column] for column in seen)
        found: dict[str, tuple[FloatArray, npt.NDArray[np.bool_]]] = {}
        trunk = _limit(self.back, markers_seen)
        if trunk is None:
            return DerivedMarkers((), positions[:, :0], filled[:, :0])
        back, rightwards = _place_back(points, trunk)
        is_filled = points.filled(trunk)
        for part, path in zip(_PARTS, back, strict=True):
            found[f"back_{part}"] = (path, is_filled)
        n_held = 0
        for prefix, whole in self.hands:
            hand = _limit(whole, markers_seen)
            if hand is None:
                continue
            outwards = -rightwards if prefix else rightwards
            is_filled = points.filled(hand)
            if hold:
                held = points.hold_fingers(hand)
                n_held += int(held.sum())
                is_filled = is_filled | held
            for name, group in (("shoulder", hand.shoulder), ("elbow", hand.elbow)):
                found[f"{prefix}{name}"] = (points.mean(group), is_filled)
            for part, path in zip(_PARTS, _place_hand(points, hand, prefix, outwards), strict=True):
                found[f"{prefix}hand_{part}"] = (path, is_filled)
        names = tuple(name for name in found if name not in markers)
        return DerivedMarkers(
            names,
            np.stack([found[name][0] for name in names], axis=1),
            np.stack([found[name][1] for name in names], axis=1),
            n_held,
        )


def _limit(part: Part, markers: Collection[str]) -> Part | None:
    """Return a part without the groups of which a point is not there; None if it needs them."""
    left_out = [key for key, group in dict(part).items() if not set(group) <= set(markers)]
    if any(type(part).model_fields[key].is_required() for key in left_out):
        return None
    return part.model_copy(update=dict.fromkeys(left_out, ()))


class _Points:
    """Points by name."""

    def __init__(
        self, positions: FloatArray, markers: tuple[str, ...], filled: npt.NDArray[np.bool_]
    ) -> None:
        self._positions, self._filled = positions, filled
        self._columns = {name: column for column, name in enumerate(markers)}

    def mean(self, names: tuple[str, ...]) -> FloatArray:
        """Return the mean of some points, shape (T, 3), NaN where one is not seen."""
        paths = self._positions[:, [self._columns[name] for name in names]]
        mean: FloatArray = paths.mean(axis=1)
        return mean

    def hold_fingers(self, hand: HandPoints) -> npt.NDArray[np.bool_]:
        """Let fingers that are not seen go along with the forearm; tell where, shape (T,)."""
        fingers = hand.points_beyond
        columns = [column for name, column in self._columns.items() if name in fingers]
        if np.isfinite(self._positions[:, columns]).all():
            return np.zeros(len(self._positions), dtype=np.bool_)
        arm = (self.mean(hand.shoulder), self.mean(hand.elbow), self.mean(hand.wrist))
        points, held = hold_to_forearm(*arm, self._positions[:, columns])
        self._positions = self._positions.copy()
        self._positions[:, columns] = points
        return held

    def filled(self, part: BackPoints | HandPoints) -> npt.NDArray[np.bool_]:
        """Tell, shape (T,), where a point of a part was filled."""
        names = [name for group in dict(part).values() for name in group]
        return np.asarray(self._filled[:, [self._columns[name] for name in names]].any(axis=1))


def _place_back(points: _Points, back: BackPoints) -> tuple[list[FloatArray], FloatArray]:
    """Return the three markers of the back, each (T, 3), and the direction to the right."""
    left, right = points.mean(back.left), points.mean(back.right)
    middle = points.mean(back.middle) if back.middle else (left + right) / 2
    y = _unit(left - right)
    up = np.broadcast_to([0.0, 0.0, 1.0], y.shape)
    if back.bottom:
        up = middle - points.mean(back.bottom)
    x = _unit(np.cross(y, up))
    axes = np.stack([x, y, np.cross(x, y)], axis=-1)
    return [middle + axes @ offset for offset in _ON_BACK_M], -y


def _place_hand(
    points: _Points, hand: HandPoints, prefix: str, outwards: FloatArray
) -> list[FloatArray]:
    """Return the three markers of a hand, each (T, 3)."""
    elbow, wrist = points.mean(hand.elbow), points.mean(hand.wrist)
    if hand.fingers:
        fingers = points.mean(hand.fingers)
        x, middle = _unit(fingers - wrist), (fingers + wrist) / 2
    else:
        x = _unit(wrist - elbow)
        middle = wrist + _BEYOND_WRIST_M * x
    if hand.thumb_side and hand.little_side:
        # The thumb of a right hand, palm down, is on its left.
        across = points.mean(hand.thumb_side) - points.mean(hand.little_side)
        z = _unit(np.cross(x, -across if prefix else across))
    else:
        bend = np.cross(_unit(elbow - points.mean(hand.shoulder)), _unit(wrist - elbow))
        z = _bridge(-bend if prefix else bend, outwards)
        z = _unit(z - (z * x).sum(axis=1, keepdims=True) * x)
    axes = np.stack([x, np.cross(z, x), z], axis=-1)
    return [middle + axes @ offset for offset in _ON_HAND_M]


def _bridge(normals: FloatArray, otherwise: FloatArray) -> FloatArray:
    """Return the normals of the elbow's plane, (T, 3), bridged in time where the arm is straight.

    Of an arm that is straight all the time the other direction is taken.
    """
    sines = np.linalg.norm(normals, axis=1)
    bent = np.flatnonzero(sines > _LEAST_BEND)
    if not len(bent):
        return otherwise
    known = normals[bent] / sines[bent, None]
    rows = np.arange(len(normals))
    return np.stack([np.interp(rows, bent, known[:, axis]) for axis in range(3)], axis=1)


def _unit(vectors: FloatArray) -> FloatArray:
    """Return vectors (T, 3) of length one; NaN where there is no length."""
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.where(lengths > 0.0, lengths, np.nan))

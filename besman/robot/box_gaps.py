"""Distances of an arm's capsules to boxes that stand in its world."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.robot.kinematics import compiled

FloatArray = npt.NDArray[np.float64]

# The distance of a point on a segment from a box is convex along it: halving by the golden section,
# to a ten-thousandth of its length.
_GOLDEN, _ROUNDS = 0.6180339887498949, 20


@compiled
def box_gaps(
    placed: FloatArray, radii: FloatArray, boxes: FloatArray, halves: FloatArray
) -> FloatArray:
    """Compute how near capsules are to boxes.

    Parameters
    ----------
    placed : array, shape (B, C, 2, 3)
        Ends of the capsules' axes in the world at B moments, metres.
    radii : array, shape (C,)
        Metres.
    boxes : array, shape (O, 4, 4)
        Poses of the boxes' middles in the world.
    halves : array, shape (O, 3)
        Half their sizes, metres.

    Returns
    -------
    array, shape (B, O)
        Least distance of a capsule, metres; minus its radius where its axis is within a box.
    """
    gaps = np.full((len(placed), len(boxes)), np.inf)
    for box in range(len(boxes)):
        for index in range(len(placed)):
            for capsule in range(len(radii)):
                gaps[index, box] = nearer_gap(
                    placed[index, capsule], radii[capsule], boxes[box], halves[box],
                    gaps[index, box],
                )  # fmt: skip
    return gaps


@compiled
def nearer_gap(
    ends: FloatArray, radius: float, box: FloatArray, half: FloatArray, nearest: float
) -> float:
    """Return how near one capsule is to one box, or what was nearest, if that is less.

    Parameters
    ----------
    ends : array, shape (2, 3)
        Of its axis in the world, metres.
    radius : float
    box : array, shape (4, 4)
    half : array, shape (3,)
    nearest : float
        Metres; what is further away, by the balls around both, is not looked at.
    """
    reach, length, away = 0.0, 0.0, 0.0
    for row in range(3):
        reach += half[row] ** 2
        length += (ends[1, row] - ends[0, row]) ** 2
        away += (0.5 * (ends[0, row] + ends[1, row]) - box[row, 3]) ** 2
    least = np.sqrt(away) - np.sqrt(reach) - 0.5 * np.sqrt(length) - radius
    if least >= nearest:
        return nearest
    inside = np.zeros((2, 3))
    for end in range(2):
        for row in range(3):
            for k in range(3):
                inside[end, row] += box[k, row] * (ends[end, k] - box[k, 3])
    return min(nearest, _segment_gap(inside[0], inside[1], half) - radius)


@compiled
def _segment_gap(one: FloatArray, other: FloatArray, half: FloatArray) -> float:
    """Return the distance of a segment from a box about the origin along the axes, metres."""
    low, high = 0.0, 1.0
    a, b = high - _GOLDEN, low + _GOLDEN
    at_a, at_b = _point_square(one, other, a, half), _point_square(one, other, b, half)
    least = min(_point_square(one, other, 0.0, half), _point_square(one, other, 1.0, half))
    for _ in range(_ROUNDS):
        if at_a <= at_b:
            high, b, at_b = b, a, at_a
            a = high - _GOLDEN * (high - low)
            at_a = _point_square(one, other, a, half)
        else:
            low, a, at_a = a, b, at_b
            b = low + _GOLDEN * (high - low)
            at_b = _point_square(one, other, b, half)
    return float(np.sqrt(min(least, at_a, at_b)))


@compiled
def _point_square(one: FloatArray, other: FloatArray, share: float, half: FloatArray) -> float:
    """Return the squared distance from the box of a point on the segment."""
    square = 0.0
    for row in range(3):
        out = abs(one[row] + share * (other[row] - one[row])) - half[row]
        if out > 0.0:
            square += out * out
    return square

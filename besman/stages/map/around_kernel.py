"""How much arms lack to stay clear of what stands around them, compiled."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.robot.box_gaps import nearer_gap
from besman.robot.collision import place_capsules
from besman.robot.kinematics import compiled, fill_frames, fill_tip

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]


# Between two poses the arm is looked at whenever a joint has moved so far.
_STEP_RAD = 0.2
_MOST_STEPS = 12


@compiled
def _nearest(
    placed: FloatArray,
    radii: FloatArray,
    sizes: FloatArray,
    boxes: FloatArray,
    halves: FloatArray,
    present: BoolArray,
    also: BoolArray,
    nearest: float,
) -> float:
    """Return how near capsules come to boxes that are present in two lists, or `nearest`.

    `sizes` (C,) are the radii of the balls around the capsules, metres.
    """
    for other in range(len(boxes)):
        if not (present[other] and also[other]):
            continue
        x, y, z = boxes[other, 0, 3], boxes[other, 1, 3], boxes[other, 2, 3]
        a, b, c = halves[other, 0], halves[other, 1], halves[other, 2]
        reach = np.sqrt(a * a + b * b + c * c)
        for capsule in range(len(radii)):
            one, two = placed[capsule, 0], placed[capsule, 1]
            u = 0.5 * (one[0] + two[0]) - x
            v = 0.5 * (one[1] + two[1]) - y
            w = 0.5 * (one[2] + two[2]) - z
            far = reach + sizes[capsule] + nearest
            if far > 0.0 and u * u + v * v + w * w < far * far:
                nearest = nearer_gap(
                    placed[capsule], radii[capsule], boxes[other], halves[other], nearest
                )
    return nearest


@compiled
def _sizes_of(ends: FloatArray, radii: FloatArray) -> FloatArray:
    """Return the radii of the balls around capsules."""
    sizes = np.empty(len(radii))
    for capsule in range(len(radii)):
        square = 0.0
        for row in range(3):
            square += (ends[capsule, 1, row] - ends[capsule, 0, row]) ** 2
        sizes[capsule] = 0.5 * np.sqrt(square) + radii[capsule]
    return sizes


@compiled
def _n_steps(here: FloatArray, there: FloatArray) -> int:
    """Return in how many steps a straight way in joint space is looked at."""
    greatest = 0.0
    for joint in range(len(here)):
        greatest = max(greatest, abs(there[joint] - here[joint]))
    return int(min(np.ceil(greatest / _STEP_RAD), _MOST_STEPS))


@compiled
def fill_lacks(
    placements: FloatArray,
    axes: FloatArray,
    tip: FloatArray,
    joints: IntArray,
    ends: FloatArray,
    radii: FloatArray,
    in_tool: FloatArray,
    half: FloatArray,
    boxes: FloatArray,
    halves: FloatArray,
    present: BoolArray,
    carries: BoolArray,
    safe_m: float,
    positions: FloatArray,
    lacks: FloatArray,
) -> None:
    """Write by what share of a safe distance arms fall short of it, on the way to each pose.

    Parameters
    ----------
    placements, axes, tip : array
        Of a `besman.robot.parts.Chain`.
    joints, ends, radii : array, shape (C,), (C, 2, 3), (C,)
        Capsules of the arm, each in the frame of its joint; joints do not fall.
    in_tool, half : array, shape (4, 4), (3,)
        Where a carried box is in the tool's frame, and half its size, metres.
    boxes, halves : array, shape (D, O, 4, 4), (D, O, 3)
        What stands around each path.
    present : array, shape (D, P, O)
        What is there at each pose; between two what is there at both.
    carries : array, shape (D, P)
        Whether a box is carried there, which the arm must not meet but for its last two links.
    safe_m : float
    positions : array, shape (D, K, P, n)
        rad. From one to the next the way is straight.
    lacks : array, shape (D, K, P)
        Written: 0 at the safe distance, 1 where something touches.
    """
    n = positions.shape[3]
    rotations, origins, pose = np.empty((n, 3, 3)), np.empty((n, 3)), np.zeros((4, 4))
    placed, here = np.empty((len(joints), 2, 3)), np.empty(n)
    sizes, one, seen = _sizes_of(ends, radii), np.empty((1, 4, 4)), np.ones(1, np.bool_)
    pose[3, 3], n_upper = 1.0, 0
    while n_upper < len(joints) and joints[n_upper] < n - 2:
        n_upper += 1
    for path in range(len(positions)):
        for branch in range(positions.shape[1]):
            for index in range(positions.shape[2]):
                before = max(index - 1, 0)
                start, there = positions[path, branch, before], positions[path, branch, index]
                steps = max(_n_steps(start, there), 1)
                nearest = safe_m
                for step in range(1, steps + 1):
                    for joint in range(n):
                        here[joint] = start[joint] + step / steps * (there[joint] - start[joint])
                    first = index if step == steps else before
                    fill_frames(placements, axes, here, rotations, origins)
                    place_capsules(joints, ends, rotations, origins, placed)
                    nearest = _nearest(
                        placed, radii, sizes, boxes[path], halves[path],
                        present[path, index], present[path, first], nearest,
                    )  # fmt: skip
                    if carries[path, index] and carries[path, first]:
                        fill_tip(tip, rotations, origins, pose)
                        one[0] = pose @ in_tool
                        nearest = _nearest(
                            placed[:n_upper], radii[:n_upper], sizes[:n_upper], one,
                            half.reshape(1, 3), seen, seen, nearest,
                        )  # fmt: skip
                lacks[path, branch, index] = 1.0 - nearest / safe_m

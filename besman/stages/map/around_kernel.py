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
    boxes: FloatArray,
    halves: FloatArray,
    present: BoolArray,
    also: BoolArray,
    nearest: float,
) -> float:
    """Return how near capsules come to boxes that are present in two lists, or `nearest`."""
    for other in range(len(boxes)):
        if present[other] and also[other]:
            for capsule in range(len(radii)):
                nearest = nearer_gap(
                    placed[capsule], radii[capsule], boxes[other], halves[other], nearest
                )
    return nearest


@compiled
def _carry(pose: FloatArray, ends: FloatArray, placed: FloatArray) -> None:
    """Write where ends (E, 2, 3) in the frame of a pose (4, 4) are."""
    for line in range(len(ends)):
        for end in range(2):
            for row in range(3):
                placed[line, end, row] = pose[row, 3]
                for k in range(3):
                    placed[line, end, row] += pose[row, k] * ends[line, end, k]


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
    edges: FloatArray,
    in_tool: FloatArray,
    half: FloatArray,
    boxes: FloatArray,
    halves: FloatArray,
    counts: BoolArray,
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
        Capsules of arm and gripper, each in the frame of its joint.
    edges : array, shape (E, 2, 3)
        Of a carried box, in the frame of the tool, metres.
    in_tool, half : array, shape (4, 4), (3,)
        Where that is in the tool's frame, and half its size.
    boxes, halves : array, shape (D, O, 4, 4), (D, O, 3)
        What stands around each path.
    counts : array, shape (D, P)
        Which poses are looked at, and the straight ways in joint space from each to the next.
    present : array, shape (D, P, O)
        What is there at each pose; between two what is there at both.
    carries : array, shape (D, P)
        Whether a box is carried there, which must not meet what is present, nor the arm but for
        its last two links.
    safe_m : float
    positions : array, shape (D, K, P, n)
        rad.
    lacks : array, shape (D, K, P)
        Written: 0 at the safe distance, 1 where something touches.
    """
    n = positions.shape[3]
    rotations, origins, pose = np.empty((n, 3, 3)), np.empty((n, 3)), np.zeros((4, 4))
    placed, lines, here = np.empty((len(joints), 2, 3)), np.empty(edges.shape), np.empty(n)
    pose[3, 3], bare = 1.0, np.zeros(len(edges))
    # The links that a carried box can meet.
    n_upper = 0
    while n_upper < len(joints) and joints[n_upper] < n - 2:
        n_upper += 1
    one, seen = np.empty((1, 4, 4)), np.ones(1, np.bool_)
    for path in range(len(positions)):
        for branch in range(positions.shape[1]):
            last = -1
            for index in range(positions.shape[2]):
                lacks[path, branch, index] = 0.0
                if not counts[path, index]:
                    continue
                there = positions[path, branch, index]
                before = index if last < 0 else last
                start = positions[path, branch, before]
                steps = max(_n_steps(start, there), 1)
                nearest = safe_m
                for step in range(1, steps + 1):
                    for joint in range(n):
                        here[joint] = start[joint] + step / steps * (there[joint] - start[joint])
                    first = index if step == steps else before
                    fill_frames(placements, axes, here, rotations, origins)
                    place_capsules(joints, ends, rotations, origins, placed)
                    nearest = _nearest(
                        placed, radii, boxes[path], halves[path], present[path, index],
                        present[path, first], nearest,
                    )  # fmt: skip
                    if carries[path, index] and carries[path, first]:
                        fill_tip(tip, rotations, origins, pose)
                        one[0] = pose @ in_tool
                        nearest = _nearest(
                            placed[:n_upper], radii[:n_upper], one, half.reshape(1, 3), seen,
                            seen, nearest,
                        )  # fmt: skip
                        _carry(pose, edges, lines)
                        nearest = _nearest(
                            lines, bare, boxes[path], halves[path], present[path, index],
                            present[path, first], nearest,
                        )  # fmt: skip
                lacks[path, branch, index] = 1.0 - nearest / safe_m
                last = index

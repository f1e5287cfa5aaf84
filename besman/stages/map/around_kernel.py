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
    present: BoolArray,
    carries: BoolArray,
    safe_m: float,
    positions: FloatArray,
    lacks: FloatArray,
) -> None:
    """Write by what share of a safe distance poses of arms fall short of it.

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
    present : array, shape (D, P, O)
        What is there at each pose.
    carries : array, shape (D, P)
        Whether a box is carried there: no part of it may meet what is present, nor the arm but for
        its last two links.
    safe_m : float
    positions : array, shape (D, K, P, n)
        rad.
    lacks : array, shape (D, K, P)
        Written: 0 at the safe distance, 1 where something touches.
    """
    n = positions.shape[3]
    rotations, origins, pose = np.empty((n, 3, 3)), np.empty((n, 3)), np.zeros((4, 4))
    placed, edge, box = np.empty((len(joints), 2, 3)), np.empty((2, 3)), np.zeros((4, 4))
    pose[3, 3] = box[3, 3] = 1.0
    for path in range(len(positions)):
        for branch in range(positions.shape[1]):
            for index in range(positions.shape[2]):
                nearest = safe_m
                fill_frames(placements, axes, positions[path, branch, index], rotations, origins)
                place_capsules(joints, ends, rotations, origins, placed)
                for other in range(boxes.shape[1]):
                    if present[path, index, other]:
                        for capsule in range(len(joints)):
                            nearest = nearer_gap(
                                placed[capsule], radii[capsule], boxes[path, other],
                                halves[path, other], nearest,
                            )  # fmt: skip
                if carries[path, index]:
                    fill_tip(tip, rotations, origins, pose)
                    box[:] = pose @ in_tool
                    for capsule in range(len(joints)):
                        if joints[capsule] < n - 2:
                            nearest = nearer_gap(
                                placed[capsule], radii[capsule], box, half, nearest
                            )
                    for line in range(len(edges)):
                        for end in range(2):
                            for row in range(3):
                                edge[end, row] = pose[row, 3]
                                for k in range(3):
                                    edge[end, row] += pose[row, k] * edges[line, end, k]
                        for other in range(boxes.shape[1]):
                            if present[path, index, other]:
                                nearest = nearer_gap(
                                    edge, 0.0, boxes[path, other], halves[path, other], nearest
                                )
                lacks[path, branch, index] = 1.0 - nearest / safe_m

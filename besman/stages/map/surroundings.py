"""What a placement brings an arm near to: boards, and boxes that stand or are carried."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from besman.robot.box_gaps import box_gaps
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import Robot
from besman.simulation.tasks.rearrange.clearance import box_edges, place_with_tool, with_tool
from besman.simulation.tasks.rearrange.shown_scene import ShownScene
from besman.stages.map.around_kernel import fill_lacks
from besman.stages.map.terms import ORIENTATION_SCALE_RAD, POSITION_SCALE_M, SAFE_DISTANCE_M

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

AROUND_WEIGHT = 3.0
"""What it costs to touch something at one pose of each demonstration; as much as itself."""

# So near to a box the hand's own poses do not count: the gripper comes straight.
_NEAR_M = 0.15


@dataclass(frozen=True, eq=False)
class Around:
    """Thinned paths of D demonstrations, P poses each, and what stands around them.

    Attributes
    ----------
    paths : array, shape (D, P, 4, 4)
        Of the tool in the back frame: those of the hand, and the ends of straight ways.
    own : array, shape (D, Q)
        Which are the hand's.
    straight : array, shape (D, P)
        Which are ends of straight ways.
    boxes, halves : array, shape (D, O, 4, 4), (D, O, 3)
    counts, present, carries
        As of `besman.stages.map.around_kernel.fill_lacks`.
    scene : ShownScene
        One of them: gripper and box are the same in all.
    """

    paths: FloatArray
    own: IntArray
    straight: BoolArray
    boxes: FloatArray
    halves: FloatArray
    counts: BoolArray
    present: BoolArray
    carries: BoolArray
    scene: ShownScene

    def take(self, rows: IntArray | slice) -> Around:
        """Return some of the demonstrations."""
        kept = ("paths", "own", "straight", "boxes", "halves", "counts", "present", "carries")
        return replace(self, **{name: getattr(self, name)[rows] for name in kept})

    def cost(
        self, robot: Robot, positions: FloatArray, errors: FloatArray, placement: FloatArray
    ) -> FloatArray:
        """Return what paths (D, K, P, n) cost by what they touch and miss, shape (D, K).

        Parameters
        ----------
        robot : Robot
        positions : array, shape (D, K, P, n)
            rad.
        errors : array, shape (D, K, P, 2)
            Position (m) and orientation (rad).
        placement : array, shape (4, 4)

        Returns
        -------
        array, shape (D, K)
            The root of a sum of squares over poses: 1 for each that touches something, or whose
            straight way is missed by a centimetre or ten degrees.
        """
        scene, chain = self.scene, robot.chain
        joints, ends, radii = with_tool(robot, scene.gripper_ends, scene.gripper_radii)
        # The kernel takes those that a carried box can meet from the beginning.
        order = np.argsort(joints, kind="stable")
        edges = box_edges(scene.half) @ scene.carried[:3, :3].T + scene.carried[:3, 3]
        lacks = np.empty(positions.shape[:3])
        joints, ends, radii = joints[order], ends[order], radii[order]
        fill_lacks(
            chain.placements, chain.axes, chain.tip, joints, ends, radii, edges,
            np.array(scene.carried), np.array(scene.half), placement @ self.boxes, self.halves,
            self.counts, self.present, self.carries, SAFE_DISTANCE_M, positions, lacks,
        )  # fmt: skip
        missed = errors / (POSITION_SCALE_M, ORIENTATION_SCALE_RAD)
        squares = np.sum(missed**2, axis=-1) * self.straight[:, None]
        cost: FloatArray = np.sqrt(np.sum(lacks**2 + squares, axis=2))
        return cost


@dataclass(frozen=True, eq=False)
class PlacedScene:
    """Boards around one demonstration in the robot's world.

    Attributes
    ----------
    robot : Robot
    scene : ShownScene
    boards : array, shape (N, 4, 4)
    ways : array, shape (V, 4, 4)
        Ends of the straight ways.
    """

    robot: Robot
    scene: ShownScene
    boards: FloatArray
    ways: FloatArray

    def gaps(self, positions: FloatArray) -> FloatArray:
        """Return how far arm and open gripper, (..., n), are from all boards, metres, (...).

        Infinite near the ends of straight ways: there the arm goes another way.
        """
        scene, rows = self.scene, positions.reshape(-1, self.robot.n)
        placed, radii, _ = place_with_tool(
            self.robot, scene.gripper_ends, scene.gripper_radii, rows
        )
        halves = np.array(scene.halves[: scene.n_boards])
        near: FloatArray = box_gaps(placed, radii, self.boards, halves).min(axis=1)
        tools = forward_kinematics(self.robot.chain, rows)[:, :3, 3]
        near[_apart(tools, self.ways[:, :3, 3]) <= _NEAR_M] = np.inf
        return near.reshape(positions.shape[:-1])


def _apart(points: FloatArray, others: FloatArray) -> FloatArray:
    """Return how far points (N, 3) are from the nearest of others (V, 3), shape (N,)."""
    ways = np.linalg.norm(points[:, np.newaxis] - others, axis=2)
    return np.asarray(ways.min(axis=1, initial=np.inf))


def thin_among(
    demonstrations: Sequence[tuple[FloatArray, FloatArray]],
    rows: Sequence[IntArray],
    scenes: Sequence[ShownScene],
) -> Around:
    """Put the ends of straight ways among some poses of demonstrations.

    Parameters
    ----------
    demonstrations : sequence of (time, poses)
        Seconds, shape (T,), and poses of the tool in the back frame, shape (T, 4, 4).
    rows : sequence of array, shape (Q,)
        Those of the hand's poses that are kept.
    scenes : sequence of ShownScene
    """
    n_ways = max(len(scene.ways) for scene in scenes)
    n_boxes = max(len(scene.boxes) for scene in scenes)
    parts = [
        _thin_one(time[kept], poses[kept], scene, n_ways, n_boxes)
        for (time, poses), kept, scene in zip(demonstrations, rows, scenes, strict=True)
    ]
    return Around(*(np.stack(column) for column in zip(*parts, strict=True)), scenes[0])


def _thin_one(
    time: FloatArray, poses: FloatArray, scene: ShownScene, n_ways: int, n_boxes: int
) -> tuple[FloatArray | IntArray | BoolArray, ...]:
    """Return what `Around` has of one demonstration, as long as the longest."""
    more = n_ways - len(scene.ways)
    all_s = np.concatenate([time, scene.ways_s, np.full(more, time[-1])])
    found = np.concatenate([poses, scene.ways, np.repeat(poses[-1:], more, axis=0)])
    straight = np.arange(len(all_s)) >= len(time)
    straight[len(time) + len(scene.ways) :] = False
    order = np.argsort(all_s, kind="stable")
    all_s, found, straight = all_s[order], found[order], straight[order]
    own = np.argsort(order, kind="stable")[: len(time)]
    counts = straight | (_apart(found[:, :3, 3], scene.ways[:, :3, 3]) > _NEAR_M)
    inside = (all_s[:, None] >= scene.since_s) & (all_s[:, None] <= scene.until_s)
    present = np.zeros((len(all_s), n_boxes), dtype=np.bool_)
    present[:, : len(scene.boxes)] = inside
    carried = [(all_s > grasp_s) & (all_s < release_s) for grasp_s, release_s in scene.carried_s]
    carries = np.any(carried, axis=0) if carried else np.zeros(len(all_s), dtype=np.bool_)
    boxes, halves = np.tile(np.eye(4), (n_boxes, 1, 1)), np.ones((n_boxes, 3))
    boxes[: len(scene.boxes)], halves[: len(scene.boxes)] = scene.boxes, scene.halves
    return found, own, straight, boxes, halves, counts, present, carries

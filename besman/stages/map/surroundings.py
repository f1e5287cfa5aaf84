"""What a placement brings an arm near to: boards, and boxes that stand or are carried.

Tool and gripper are where the demonstration has them beside its boards, wherever it is placed; it
is the links before them that a placement, or a branch, brings elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from besman.robot.box_gaps import box_gaps
from besman.robot.collision import place_all
from besman.robot.model import Robot
from besman.stages.map.around_kernel import fill_lacks
from besman.stages.map.terms import ORIENTATION_SCALE_RAD, POSITION_SCALE_M, SAFE_DISTANCE_M

if TYPE_CHECKING:
    from besman.simulation.tasks.rearrange.shown_scene import ShownScene

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

AROUND_WEIGHT = 3.0
"""What it costs to touch something at one pose of each demonstration; as much as itself."""


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
    present, carries
        As of `besman.stages.map.around_kernel.fill_lacks`.
    scene : ShownScene
        One of them: how a box is carried is the same in all.
    """

    paths: FloatArray
    own: IntArray
    straight: BoolArray
    boxes: FloatArray
    halves: FloatArray
    present: BoolArray
    carries: BoolArray
    scene: ShownScene

    def take(self, rows: IntArray | slice) -> Around:
        """Return some of the demonstrations."""
        kept = ("paths", "own", "straight", "boxes", "halves", "present", "carries")
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
        joints, ends, radii = _links(robot)
        lacks = np.empty(positions.shape[:3])
        fill_lacks(
            chain.placements, chain.axes, chain.tip, joints, ends, radii, np.array(scene.carried),
            np.array(scene.half), placement @ self.boxes, self.halves, self.present, self.carries,
            SAFE_DISTANCE_M, positions, lacks,
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
    boards : array, shape (N, 4, 4)
    halves : array, shape (N, 3)
        Half their sizes, metres.
    """

    robot: Robot
    boards: FloatArray
    halves: FloatArray

    def gaps(self, positions: FloatArray) -> FloatArray:
        """Return how far the links before the tool's, (..., n), are from boards, metres, (...)."""
        chain, (joints, ends, radii) = self.robot.chain, _links(self.robot)
        rows = np.array(positions.reshape(-1, self.robot.n))
        placed = place_all(chain.placements, chain.axes, joints, ends, rows)
        near: FloatArray = box_gaps(placed, radii, self.boards, np.array(self.halves)).min(axis=1)
        return near.reshape(positions.shape[:-1])


def _links(robot: Robot) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return joints, ends and radii of the capsules that move, but for those fixed to the tool."""
    chain = robot.chain
    order = np.argsort(chain.capsule_joints, kind="stable")
    here = chain.capsule_joints[order]
    order = order[(here >= 0) & (here < robot.n - 1)]
    return chain.capsule_joints[order], chain.capsule_ends[order], chain.capsule_radii[order]


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
    paths, own, straight, boxes, halves, present, carries = (
        np.stack(column) for column in zip(*parts, strict=True)
    )
    return Around(paths, own, straight, boxes, halves, present, carries, scenes[0])


def _thin_one(
    time: FloatArray, poses: FloatArray, scene: ShownScene, n_ways: int, n_boxes: int
) -> tuple[npt.NDArray[Any], ...]:
    """Return what `Around` has of one demonstration, as long as the longest."""
    more = n_ways - len(scene.ways)
    all_s = np.concatenate([time, scene.ways_s, np.full(more, time[-1])])
    found = np.concatenate([poses, scene.ways, np.repeat(poses[-1:], more, axis=0)])
    straight = np.arange(len(all_s)) >= len(time)
    straight[len(time) + len(scene.ways) :] = False
    order = np.argsort(all_s, kind="stable")
    all_s, found, straight = all_s[order], found[order], straight[order]
    own = np.argsort(order, kind="stable")[: len(time)]
    present = np.zeros((len(all_s), n_boxes), dtype=np.bool_)
    inside = (all_s[:, None] >= scene.since_s) & (all_s[:, None] <= scene.until_s)
    present[:, : len(scene.boxes)] = inside
    carried = [(all_s > grasp_s) & (all_s < release_s) for grasp_s, release_s in scene.carried_s]
    carries = np.any(carried, axis=0) if carried else np.zeros(len(all_s), dtype=np.bool_)
    boxes, halves = np.tile(np.eye(4), (n_boxes, 1, 1)), np.ones((n_boxes, 3))
    boxes[: len(scene.boxes)], halves[: len(scene.boxes)] = scene.boxes, scene.halves
    return found, own, straight, boxes, halves, present, carries

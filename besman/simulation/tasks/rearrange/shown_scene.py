"""What stands around a demonstrated task, told before it is mapped to an arm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.motion.adapt_task import frame_matrix
from besman.motion.grasp_way import GraspWay
from besman.records import BlockDemonstration
from besman.simulation.tasks.rearrange.boxes import (
    BoxFrame,
    board_pose,
    box_poses,
    frame_of_tools,
)
from besman.simulation.tasks.rearrange.rearrange import RearrangeConfig

FloatArray = npt.NDArray[np.float64]

# Poses and objects at the moment of a grasp have an order, if no time between them.
_STEP_S = 1e-3


@dataclass(frozen=True, eq=False)
class ShownScene:
    """What stands around one demonstration, in its back frame and on the hand's clock.

    Attributes
    ----------
    boxes : array, shape (O, 4, 4)
        Middles of boards, the first `n_boards`, and of the boxes on them.
    halves : array, shape (O, 3)
        Half their sizes, metres.
    n_boards : int
    since_s, until_s : array, shape (O,)
        From when to when each is there.
    ways : array, shape (V, 4, 4)
        Poses of the tool that begin and end the gripper's straight ways to a box and its place.
    ways_s : array, shape (V,)
    carried_s : array, shape (H, 2)
        From when to when a box is carried.
    carried : array, shape (4, 4)
        Where it is in the frame of the tool.
    half : array, shape (3,)
        Half its size, metres.
    """

    boxes: FloatArray
    halves: FloatArray
    n_boards: int
    since_s: FloatArray
    until_s: FloatArray
    ways: FloatArray
    ways_s: FloatArray
    carried_s: FloatArray
    carried: FloatArray
    half: FloatArray


def list_scenes(
    demonstrations: Sequence[BlockDemonstration], tools: Sequence[FloatArray], task: RearrangeConfig
) -> dict[str, ShownScene]:
    """Tell what stands around demonstrations of a task.

    Parameters
    ----------
    demonstrations : sequence of BlockDemonstration
    tools : sequence of array, shape (T, 4, 4)
        What each asks of the tool centre point, in the back frame, metres.
    task : RearrangeConfig

    Returns
    -------
    dict of ShownScene
        By the demonstration's name; none if nothing is ever taken, so that nothing tells where
        boxes are.
    """
    insides = [
        np.linalg.inv(frame_matrix(_standing(one, 0)[one.objects.index(thing)]))
        @ poses[int(np.argmin(np.abs(one.hand.time - grasp_s)))]
        for one, poses in zip(demonstrations, tools, strict=True)
        for (grasp_s, _), thing in zip(one.holds_s, one.held, strict=True)
    ]
    found = frame_of_tools(insides)
    if found is None and not task.knows_frame:
        return {}
    frame = task.complete_frame(found)
    return {one.name: _scene(one, frame, task) for one in demonstrations}


def _scene(one: BlockDemonstration, frame: BoxFrame, task: RearrangeConfig) -> ShownScene:
    """Return what stands around a demonstration, given where boxes are in their frames."""
    way, board = task.grasp_way(frame), task.board
    before, after = _standing(one, 0), _standing(one, -1)
    middles = np.concatenate([box_poses(before, frame), box_poses(after, frame)])
    boards = [board_pose(pose, task) for pose in middles]
    half = np.array(task.box.size_m) / 2
    board_half = np.array([board.depth_m, board.width_m, board.thickness_m]) / 2
    until, since = np.full(len(before), np.inf), np.full(len(before), np.inf)
    ways, ways_s = [], []
    for (grasp_s, release_s), name in zip(one.holds_s, one.held, strict=True):
        thing = one.objects.index(name)
        until[thing] = min(until[thing], grasp_s - 1.5 * _STEP_S)
        since[thing] = release_s + 1.5 * _STEP_S
        ways += _ends(way, before[thing], True) + _ends(way, after[thing], False)
        ways_s += [grasp_s + k * _STEP_S for k in (-2, -1, 1)]
        ways_s += [release_s + k * _STEP_S for k in (-1, 1, 2)]
    always = np.full(len(boards), np.inf)
    return ShownScene(
        boxes=np.stack([*boards, *(frame_matrix(pose) for pose in middles)]),
        halves=np.repeat([board_half, half], len(boards), axis=0),
        n_boards=len(boards),
        since_s=np.concatenate([-always, np.full(len(before), -np.inf), since]),
        until_s=np.concatenate([always, until, np.full(len(before), np.inf)]),
        ways=np.array(ways).reshape(-1, 4, 4),
        ways_s=np.array(ways_s),
        carried_s=np.array(one.holds_s).reshape(-1, 2),
        carried=np.asarray(np.linalg.inv(way.tool) @ frame.matrix),
        half=half,
    )


def _ends(way: GraspWay, pose: FloatArray, taking: bool) -> list[FloatArray]:
    """Return where straight ways begin, reach the box or its place, and end."""
    return [frame_matrix(pose) @ end for end in way.ends(taking)]


def _standing(one: BlockDemonstration, sample: int) -> FloatArray:
    """Return where objects stand at a sample, upright, shape (O, 7)."""
    half = 0.5 * np.nan_to_num(one.object_headings[sample])
    none = np.zeros_like(half)
    turn = np.column_stack([np.cos(half), none, none, np.sin(half)])
    return np.hstack([one.object_positions[sample], turn])

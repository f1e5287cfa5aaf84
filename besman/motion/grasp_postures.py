"""Postures of an arm at what it takes and where it puts that: as shown, or others."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby, product

import numpy as np
import numpy.typing as npt

from besman.exceptions import OutOfReachError
from besman.motion.adapt_task import MISS_M, MISS_RAD, follow_goal, frame_matrix, too_far
from besman.motion.grasp_way import GraspWay, poses_between, poses_from
from besman.records import BlockPlan, TaskPlan
from besman.robot.branch_choice import Gaps
from besman.robot.branches import SAME_BRANCH_RAD, IkWeights, draw_starts, find_branches, follow_all
from besman.robot.collision import distances
from besman.robot.inverse_kinematics import solve_path
from besman.robot.model import Robot

FloatArray = npt.NDArray[np.float64]

# So many orders of postures are kept on the way through a task, the nearest ones.
_MOST_ORDERS = 64
_ROUNDS, _TOLERANCE = 60, 1e-12


class Postures:
    """Postures in one way after the other: what ways have in common is looked for once.

    Parameters
    ----------
    plan : TaskPlan
    robot : Robot
    gaps : callable, optional
        As of `list_postures`.
    """

    def __init__(self, plan: TaskPlan, robot: Robot, gaps: Gaps | None = None) -> None:
        self._plan, self._robot, self._gaps = plan, robot, gaps
        self._shown: dict[bytes, list[FloatArray] | OutOfReachError] = {}
        self._others: dict[bytes, list[list[FloatArray]]] = {}

    def choose(self, way: GraspWay) -> list[FloatArray]:
        """Return the joints at the end of every block, n angles each, before it goes straight on.

        Posture 0 is that to which the shown one leads in small steps, if it leads there; 1 and
        more, and 0 where it does not, are those of `list_postures`.

        Raises
        ------
        OutOfReachError
            If a straight way is out of reach in every posture.
            Or there are not so many postures.
        """
        ends = np.concatenate([*way.ends(True), *way.ends(False)]).tobytes()
        shown = self._follow(ends, way) if way.posture == 0 else None
        if isinstance(shown, list):
            return shown
        if ends not in self._others:
            self._others[ends] = list_postures(self._plan, self._robot, way, self._gaps)
        found = self._others[ends]
        if shown is not None and not found:
            raise shown
        if len(found) < way.posture:
            label = next(block.label for block in self._plan.blocks if block.frame != "world")
            raise OutOfReachError(
                f"{self._plan.name}: no posture {way.posture}; there are {len(found)} others", label
            )
        return found[max(way.posture - 1, 0)]

    def _follow(self, ends: bytes, way: GraspWay) -> list[FloatArray] | OutOfReachError:
        """Return the joints that follow from those shown, or why there are none."""
        if ends not in self._shown:
            try:
                self._shown[ends] = _follow_goals(self._plan, self._robot, way)
            except OutOfReachError as error:
                self._shown[ends] = error
        return self._shown[ends]


def list_postures(
    plan: TaskPlan, robot: Robot, way: GraspWay, gaps: Gaps | None = None
) -> list[list[FloatArray]]:
    """List postures at all objects and places, those first that change the blocks least.

    Every branch of the arm in which a straight way is reached as a whole, and nothing is touched
    there, with every one at the next; without the postures that follow from those shown. What a
    block changes by is how much further or less far its joints move than was shown, in the root of
    the sum of squares; its shape stays.

    Parameters
    ----------
    plan : TaskPlan
    robot : Robot
    way : GraspWay
    gaps : callable, optional
        How far the arm is from what it must not touch; by default from itself and the floor.

    Returns
    -------
    list of list of array, shape (n,)
        For each order of postures the joints at the end of every block, rad.
    """
    start = plan.blocks[0].start
    orders: list[tuple[float, list[FloatArray]]] = [(0.0, [])]
    shown = start
    for (frame, _), group in groupby(plan.blocks, lambda block: (block.frame, block.thing)):
        blocks = list(group)
        at_end = blocks[0].goal if frame == "world" else blocks[-1].goal
        found = [at_end] if frame == "world" else _postures(plan, robot, blocks[-1], way, gaps)
        ends = [b.goal for b in blocks] if frame == "world" else []
        longer = []
        for (cost, goals), goal in product(orders, found):
            change = goal - (goals[-1] if goals else start) - (at_end - shown)
            following = ends or [goal] * len(blocks)
            longer.append((cost + float(np.linalg.norm(change)), [*goals, *following]))
        orders = sorted(longer, key=lambda order: order[0])[:_MOST_ORDERS]
        shown = blocks[-1].goal
    listed = [goals for _, goals in orders]
    try:
        same = np.array(_follow_goals(plan, robot, way))
    except OutOfReachError:
        return listed
    return [goals for goals in listed if np.abs(np.array(goals) - same).max() > SAME_BRANCH_RAD]


def check_reach(
    name: str, robot: Robot, label: str, frame: str, thing: str, poses: Sequence[FloatArray]
) -> None:
    """Refuse an object or a place at which the tool cannot be in any of some poses, each alone.

    What is near the border of the reach passes: each way finds that out.

    Parameters
    ----------
    name, label : str
        Of the task, and of the block that leads there.
    frame : "object" or "target"
    thing : str
        The object.
    robot : Robot
    poses : sequence of array, shape (4, 4)
        Of the tool centre point, in the world.

    Raises
    ------
    OutOfReachError
    """
    misses = []
    for pose in poses:
        found = solve_path(robot, pose[None])
        miss = float(found.position_error[0]), float(found.orientation_error[0])
        if miss[0] <= MISS_M and miss[1] <= MISS_RAD:
            return
        misses.append(miss)
    raise too_far(name, label, frame, thing, robot.name, min(misses))


def _follow_goals(plan: TaskPlan, robot: Robot, way: GraspWay) -> list[FloatArray]:
    """Return the joints at the end of every block in the posture that was shown."""
    goals = []
    for block in plan.blocks:
        goal = block.goal
        if block.frame != "world":
            first = _frame(plan, block) @ way.ends(block.frame == "object")[0]
            goal = follow_goal(plan.name, robot, block, poses_from(robot, goal, first))
        goals.append(goal)
    return goals


def _postures(
    plan: TaskPlan, robot: Robot, block: BlockPlan, way: GraspWay, gaps: Gaps | None
) -> FloatArray:
    """Return the joints where a straight way begins, of every branch that has all of it, (K, n)."""
    first, at, last = (_frame(plan, block) @ end for end in way.ends(block.frame == "object"))
    poses = np.concatenate([poses_between(first, at), poses_between(at, last)[1:]])
    middle, weights = len(poses) // 2, IkWeights()
    starts = np.vstack([block.goal, draw_starts(robot, 0)])
    branches = find_branches(robot, poses[middle], starts, weights, False)
    paths, errors = follow_all(
        robot, poses[None], branches, middle, weights, False, rounds=_ROUNDS, tolerance=_TOLERANCE
    )
    reached = np.all(errors[0].max(axis=1) <= [MISS_M, MISS_RAD], axis=1)
    near = distances(robot.chain, paths[0]).min(axis=2) if gaps is None else gaps(paths[0])
    found: FloatArray = paths[0, reached & (near.min(axis=1) > 0.0), 0]
    return found


def _frame(plan: TaskPlan, block: BlockPlan) -> FloatArray:
    """Return where the object of a block, or its place, is, shape (4, 4)."""
    standing = plan.object_poses if block.frame == "object" else plan.target_poses
    return frame_matrix(standing[plan.objects.index(block.thing)])

"""How far arm and gripper stay from boxes and boards, told from the movement before simulating."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.motion.adapt_task import frame_matrix
from besman.motion.task_rollout import sample_task
from besman.records import TaskPlan
from besman.robot.box_gaps import box_gaps
from besman.robot.collision import distances, place_all
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import Robot
from besman.simulation.tasks.grasp_box.gripper import gripper_capsules
from besman.simulation.tasks.rearrange.boxes import BoxFrame, board_pose, box_poses, taken
from besman.simulation.tasks.rearrange.sections import RearrangeFields

FloatArray = npt.NDArray[np.float64]

RATE_HZ = 50.0
"""Samples a second at which a task is looked at."""
# Pairs of corners of a box that an edge joins: they differ along one axis.
_CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))
_EDGES = np.array(
    [(a, b) for a, b in product(range(8), repeat=2) if a < b and (a ^ b).bit_count() == 1]
)


class Hold(NamedTuple):
    """When a box moves with the gripper, seconds on the clock of the task.

    Attributes
    ----------
    thing : int
    close_s, lifted_s, lowering_s, open_s : float
        Between the middle two it is carried from above where it stood to above its place.
    """

    thing: int
    close_s: float
    lifted_s: float
    lowering_s: float
    open_s: float


def list_holds(plan: TaskPlan) -> list[Hold]:
    """Return from when to when each box is held, by the events of a task with straight ways."""
    borders = np.append(plan.starts_s, plan.duration)
    opens = [float(at) for at, e in zip(plan.events_s, plan.events, strict=True) if e == "open"]
    found = []
    for (close_s, thing), open_s in zip(taken(plan), opens, strict=False):
        after = borders[borders > close_s + 1e-6]
        before = borders[borders < open_s - 1e-6]
        found.append(Hold(thing, close_s, float(after[0]), float(before[-1]), open_s))
    return found


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What an arm must not touch in a task: itself, the floor, boards and boxes.

    Attributes
    ----------
    robot : Robot
        With the gripper.
    task : RearrangeFields
    before, after : array, shape (O, 7)
        Where the middles of boxes stand before and after, in the world.
    boards : array, shape (N, 4, 4)
        The middles of the boards below them, and of others.
    """

    robot: Robot
    task: RearrangeFields
    before: FloatArray
    after: FloatArray
    boards: FloatArray

    @classmethod
    def of(
        cls,
        plan: TaskPlan,
        robot: Robot,
        task: RearrangeFields,
        frame: BoxFrame,
        places: Sequence[FloatArray] = (),
    ) -> Surroundings:
        """Return what stands around the arm in a task whose boxes are put once at most.

        Parameters
        ----------
        plan : TaskPlan
        robot : Robot
        task : RearrangeFields
        frame : BoxFrame
        places : sequence of array, shape (7,)
            Where boxes may stand at other times, of their middles: there are boards, too.
        """
        before, after = (box_poses(each, frame) for each in (plan.object_poses, plan.target_poses))
        boards = np.stack([board_pose(pose, task) for pose in (*before, *after, *places)])
        # Most places are known twice.
        _, once = np.unique(boards.round(6), axis=0, return_index=True)
        return cls(robot, task, before, after, boards[np.sort(once)])

    def gaps(self, positions: FloatArray) -> FloatArray:
        """Return how far arm and open gripper are from themselves, the floor and all boards.

        Parameters
        ----------
        positions : array, shape (..., n)
            rad.

        Returns
        -------
        array, shape (...)
            Metres; below zero where something overlaps.
        """
        rows = positions.reshape(-1, self.robot.n)
        placed, radii, _ = _place(self.robot, self.task, rows)
        near = box_gaps(placed, radii, self.boards, np.tile(self._board, (len(self.boards), 1)))
        own = distances(self.robot.chain, rows)
        found: FloatArray = np.minimum(near.min(axis=1), own.min(axis=1))
        return found.reshape(positions.shape[:-1])

    def gaps_before(self, positions: FloatArray) -> FloatArray:
        """Return `gaps`, or how far the arm is from boxes where they stand before, if that is less.

        Parameters
        ----------
        positions : array, shape (T, n)
            rad.

        Returns
        -------
        array, shape (T,)
            Metres.
        """
        placed, radii, _ = _place(self.robot, self.task, positions)
        boxes = [self.near_box(placed, radii, pose) for pose in self.before]
        return np.asarray(np.min([self.gaps(positions), *boxes], axis=0))

    def clearance(self, plan: TaskPlan) -> float:
        """Tell how near a task brings the arm to what it must not touch. Nothing is simulated.

        Parameters
        ----------
        plan : TaskPlan
            As `besman.motion.grasp_goals.lead_grasps` gives it.

        Returns
        -------
        float
            Metres; below zero where something overlaps.
        """
        time, positions, _, _ = sample_task(plan, RATE_HZ)
        return float(self.follow(plan).gaps(time, positions).min())

    def follow(self, plan: TaskPlan) -> Course:
        """Return what there is to be touched in the course of a task."""
        holds = list_holds(plan)
        closed = np.array([hold.close_s for hold in holds])
        return Course(self, tuple(holds), _positions_at(plan, closed))

    @property
    def _board(self) -> FloatArray:
        board = self.task.board
        return np.array([board.depth_m, board.width_m, board.thickness_m]) / 2

    @property
    def _box(self) -> FloatArray:
        return np.array(self.task.box.size_m) / 2

    def near_board(self, placed: FloatArray, radii: FloatArray) -> FloatArray:
        """Return how near capsules (B, C, 2, 3) come to a board, shape (B,)."""
        return _least(placed, radii, self.boards, self._board)

    def near_box(self, placed: FloatArray, radii: FloatArray, pose: FloatArray) -> FloatArray:
        """Return how near capsules (B, C, 2, 3) come to a box that stands, shape (B,)."""
        return _least(placed, radii, frame_matrix(pose)[None], self._box)

    def near_carried(
        self, thing: int, rows: FloatArray, arm: FloatArray, radii: FloatArray
    ) -> FloatArray:
        """Return how near a box comes to anything, held as in the first row, in all others."""
        tools = forward_kinematics(self.robot.chain, rows)
        boxes = tools[1:] @ np.linalg.inv(tools[0]) @ frame_matrix(self.before[thing])
        turns, middles = boxes[:, :3, :3], boxes[:, None, :3, 3]
        edges = (np.einsum("bij,kj->bki", turns, _CORNERS * self._box) + middles)[:, _EDGES]
        bare = np.zeros(len(_EDGES))
        others = np.delete(self.before, thing, axis=0)
        standing = np.array([frame_matrix(pose) for pose in others]).reshape(-1, 4, 4)
        inside = np.einsum("bji,bckj->bcki", turns, arm - middles[:, None])
        near = [
            _least(edges, bare, self.boards, self._board),
            _least(edges, bare, standing, self._box),
            _least(inside, radii, np.eye(4)[None], self._box),
        ]
        return np.asarray(np.min(near, axis=0))


class Course(NamedTuple):
    """What there is to be touched in the course of a task.

    Attributes
    ----------
    around : Surroundings
    holds : tuple of Hold
    taken_at : array, shape (H, n)
        The arm where each box is taken, rad.
    """

    around: Surroundings
    holds: tuple[Hold, ...]
    taken_at: FloatArray

    def gaps(self, time: FloatArray, positions: FloatArray) -> FloatArray:
        """Return how near the arm, wherever it may be at a time, is to what it must not touch.

        Besides `Surroundings.gaps`: arm and open gripper against boxes where they stand; what is
        carried against the boards, other boxes, and the arm without its last two links. Fingers are
        where they hold a box while they do.

        Parameters
        ----------
        time : array, shape (T,)
            On the clock of the task, seconds.
        positions : array, shape (T, n)
            rad.

        Returns
        -------
        array, shape (T,)
            Metres; below zero where something overlaps.
        """
        around, robot = self.around, self.around.robot
        shut = [(time > hold.close_s) & (time < hold.open_s) for hold in self.holds]
        holding = np.any([np.zeros(len(time), dtype=np.bool_), *shut], axis=0)
        placed, radii, joints = _place(robot, around.task, positions, holding)
        found: FloatArray = np.minimum(
            distances(robot.chain, positions).min(axis=1), around.near_board(placed, radii)
        )

        def lessen(rows: npt.NDArray[np.bool_], gaps: FloatArray) -> None:
            found[rows] = np.minimum(found[rows], gaps)

        for thing in range(len(around.before)):
            held = [hold for hold in self.holds if hold.thing == thing]
            stands = time < held[0].close_s if held else np.full(len(time), True)
            lessen(stands, around.near_box(placed[stands], radii, around.before[thing]))
            if held:
                stands = time > held[-1].open_s
                lessen(stands, around.near_box(placed[stands], radii, around.after[thing]))
        arm = joints < robot.n - 2
        for hold, taken_at in zip(self.holds, self.taken_at, strict=True):
            carried = (time >= hold.lifted_s) & (time <= hold.lowering_s)
            rows = np.vstack([taken_at, positions[carried]])
            lessen(
                carried,
                around.near_carried(hold.thing, rows, placed[carried][:, arm], radii[arm]),
            )
        return found


def _positions_at(plan: TaskPlan, time_s: FloatArray) -> FloatArray:
    """Return the joints at the ends of blocks, shape (T, n)."""
    ends = np.cumsum([block.duration for block in plan.blocks])
    return np.array([plan.blocks[int(np.abs(ends - at).argmin())].goal for at in time_s])


def _place(
    robot: Robot,
    task: RearrangeFields,
    positions: FloatArray,
    holding: npt.NDArray[np.bool_] | None = None,
) -> tuple[FloatArray, FloatArray, npt.NDArray[np.int64]]:
    """Return all capsules that move, of arm and gripper, their radii and their joints.

    The gripper is open but in the rows in which it holds a box.
    """
    placed, radii, joints = _place_gripper(robot, *gripper_capsules(task.gripper), positions)
    if holding is not None and np.any(holding):
        ends, widths = gripper_capsules(task.gripper, task.box.size_m[1])
        placed[holding] = _place_gripper(robot, ends, widths, positions[holding])[0]
    return placed, radii, joints


def _place_gripper(
    robot: Robot, ends: FloatArray, radii: FloatArray, positions: FloatArray
) -> tuple[FloatArray, FloatArray, npt.NDArray[np.int64]]:
    """Return the capsules of the arm that move, and those (C, 2, 3) of its tool."""
    chain = robot.chain
    ends = ends @ chain.tip[:3, :3].T + chain.tip[:3, 3]
    joints = np.concatenate([chain.capsule_joints, np.full(len(ends), robot.n - 1)])
    ends, radii = np.concatenate([chain.capsule_ends, ends]), np.append(chain.capsule_radii, radii)
    moving = joints >= 0
    placed = place_all(
        chain.placements, chain.axes, joints[moving], ends[moving], np.array(positions)
    )
    return placed, radii[moving], joints[moving]


def _least(
    placed: FloatArray, radii: FloatArray, boxes: FloatArray, half: FloatArray
) -> FloatArray:
    """Return the least distances to boxes of one size, shape (B,); infinite if there are none."""
    halves = np.tile(half, (len(boxes), 1))
    gaps = box_gaps(np.ascontiguousarray(placed), radii, boxes, halves)
    return np.asarray(np.min(gaps, axis=1, initial=np.inf))

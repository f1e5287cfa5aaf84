"""Legs of a plan aimed, simulated, and if need be tried in other ways, each after those before."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import numpy.typing as npt

from besman.exceptions import PlanError
from besman.geometry.frames import rotation_to_quaternion
from besman.motion.adapt_task import frame_matrix
from besman.motion.grasp_goals import aim_grasps
from besman.planning.block_effects import BlockUse, LearntBlock
from besman.planning.chaining import Leg, chain_leg, join_legs
from besman.records import TaskPlan
from besman.records.task_trial import TaskTrial
from besman.robot.model import Robot
from besman.simulation.tasks.rearrange.boxes import BoxFrame, box_poses
from besman.simulation.tasks.rearrange.rearrange import RearrangeConfig
from besman.stages.refine.whole_tasks import is_better

FloatArray = npt.NDArray[np.float64]

# So many demonstrations of a block are tried, the nearest first.
_MOST_SOURCES = 3


@dataclass(frozen=True, eq=False)
class Bench:
    """What legs are tried with.

    Attributes
    ----------
    plans : tuple of TaskPlan
        As imitated.
    good : frozenset of int
        Indices of those that succeed as they are: they are taken first.
    robot : Robot
    task : RearrangeConfig
    frame : BoxFrame
    """

    plans: tuple[TaskPlan, ...]
    good: frozenset[int]
    robot: Robot
    task: RearrangeConfig
    frame: BoxFrame


@dataclass(frozen=True, eq=False)
class LegGoal:
    """What one leg is to do.

    Attributes
    ----------
    blocks : tuple of LearntBlock
    thing : int
        Index of the object; -1 if none is taken.
    poses : tuple of array, shape (7,)
        Where that may be put, the one wanted most first: of its middle, in the world.
    """

    blocks: tuple[LearntBlock, ...]
    thing: int
    poses: tuple[FloatArray, ...]


@dataclass(frozen=True, eq=False)
class TriedLeg:
    """What came of a leg.

    Attributes
    ----------
    plan : TaskPlan
        Of this leg alone.
    sources : tuple of str
        The demonstration of each of its blocks.
    before, after : array, shape (O, 7)
        Where the middles of objects stand before, and are to stand after it, in the world.
    trial : TaskTrial
        Of all legs to its end.
    tries : int
    """

    plan: TaskPlan
    sources: tuple[str, ...]
    before: FloatArray
    after: FloatArray
    trial: TaskTrial
    tries: int


def try_legs(
    name: str,
    goals: Sequence[LegGoal],
    objects: tuple[str, ...],
    standing: FloatArray,
    bench: Bench,
    refine: bool = True,
    done: Callable[[float], None] = lambda share: None,
) -> tuple[TaskPlan, tuple[TriedLeg, ...]]:
    """Try legs one after the other, each from where the ones before have left arm and objects.

    Parameters
    ----------
    name : str
        Of the task.
    goals : sequence of LegGoal
    objects : tuple of str, length O
    standing : array, shape (O, 7)
        Where their middles are before, in the world.
    bench : Bench
    refine : bool
        Whether other ways are tried where a leg does not succeed.
    done : callable
        Takes the share that is done.

    Returns
    -------
    plan : TaskPlan
        All legs as one.
    tried : tuple of TriedLeg
        The last one's trial is that of the whole task. After one that does not succeed others
        follow as if it had.

    Raises
    ------
    PlanError
        If a leg is out of the arm's reach or limits in every way: it names the block.
    """
    standing = np.array(standing)
    tried: list[TriedLeg] = []
    for number, goal in enumerate(goals):
        best: TriedLeg | None = None
        why, tries = PlanError(f"{name}: no way to try"), 0
        for pose, uses, way in _ways(goal, standing, bench):
            if best is not None and (best.trial.success or not refine):
                break
            tries += 1
            after = np.array(standing)
            if goal.thing >= 0:
                after[goal.thing] = pose
            try:
                plan = _aim_leg(name, Leg(uses, goal.thing), objects, (standing, after), tried, bench, way)
            except PlanError as error:
                why = why if tries > 1 else error
                if refine:
                    continue
                raise
            joined = join_legs(name, [*(one.plan for one in tried), plan])
            (trial,) = bench.task.try_tasks([joined], bench.robot, bench.frame)
            if best is None or is_better(trial, best.trial):
                sources = tuple(bench.plans[use.task].name for use in uses)
                best = TriedLeg(plan, sources, standing, after, trial, tries)
        if best is None:
            raise why
        best = replace(best, tries=tries)
        tried.append(best)
        standing = best.after
        done((number + 1) / len(goals))
    return join_legs(name, [one.plan for one in tried]), tuple(tried)


Way = object


def _ways(goal: LegGoal, standing: FloatArray, bench: Bench) -> Iterator[tuple]:
    """Return poses, demonstrations and ways to grasp, the ones wanted most first."""
    grasps = [bench.task.grasp, *bench.task.ways.list(bench.task.grasp)]
    poses = goal.poses or (np.zeros(7),)
    ranked = [rank_sources(goal, standing, pose, bench) for pose in poses]
    for grasp, source, number in product(grasps, range(_MOST_SOURCES), range(len(poses))):
        if source < len(ranked[number]):
            way = bench.task.grasp_way(bench.frame, grasp)
            yield poses[number], ranked[number][source], way


def rank_sources(
    goal: LegGoal, standing: FloatArray, pose: FloatArray, bench: Bench
) -> list[tuple[BlockUse, ...]]:
    """Choose a demonstration of each block, then others, the nearest first."""
    def distance(use: BlockUse) -> tuple[bool, float, int]:
        shown = bench.plans[use.task]
        away = 0.0
        if goal.thing >= 0 and shown.objects:
            thing = shown.objects.index(use.thing) if use.thing else 0
            before, after = (
                box_poses(part[thing : thing + 1], bench.frame)[0, :3]
                for part in (shown.object_poses, shown.target_poses)
            )
            here = standing[goal.thing, :3]
            if use.frame == "object":
                away = float(np.linalg.norm(before - here))
            else:
                away = float(np.linalg.norm(after - pose[:3]))
        return (use.task not in bench.good, away, use.task)

    orders = [sorted(block.uses, key=distance) for block in goal.blocks]
    most = max(len(order) for order in orders)
    return [tuple(order[min(k, len(order) - 1)] for order in orders) for k in range(most)]


def _aim_leg(name, leg, objects, poses, tried, bench, way) -> TaskPlan:
    markers = np.linalg.inv(bench.frame.matrix)
    before, after = (_moved(part, markers) for part in poses)
    start = tried[-1].plan.blocks[-1].goal if tried else None
    plan = chain_leg(name, leg, bench.plans, objects, (before, after), start)
    return aim_grasps(plan, bench.robot, way)


def _moved(poses: FloatArray, by: FloatArray) -> FloatArray:
    matrices = np.stack([frame_matrix(pose) @ by for pose in poses])
    return np.hstack([matrices[:, :3, 3], rotation_to_quaternion(matrices[:, :3, :3])])

"""Learnt blocks as whole tasks: each leg of them, and all legs as one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.geometry.frames import rotation_to_quaternion
from besman.motion.adapt_task import frame_matrix
from besman.planning.block_effects import BlockUse
from besman.records import BlockPlan, TaskPlan

FloatArray = npt.NDArray[np.float64]


class Leg(NamedTuple):
    """Blocks from rest to rest in which one object at most is taken and put.

    Attributes
    ----------
    uses : tuple of BlockUse
        Where each block is taken from.
    thing : int
        Index of the object.
    """

    uses: tuple[BlockUse, ...]
    thing: int


def chain_leg(
    name: str,
    leg: Leg,
    plans: Sequence[TaskPlan],
    objects: tuple[str, ...],
    poses: tuple[FloatArray, FloatArray],
    start: FloatArray | None,
) -> TaskPlan:
    """Chain blocks as they were shown: each begins where, and as fast as, the one before ends.

    Parameters
    ----------
    name : str
    leg : Leg
    plans : sequence of TaskPlan
        As imitated; `BlockUse.task` counts them.
    objects : tuple of str, length O
    poses : pair of array, shape (O, 7)
        Where objects stand before and after, as `TaskPlan.object_poses`.
    start : array, shape (n,), optional
        Where the arm is, rad; if not given, where the first block begins.

    Returns
    -------
    TaskPlan
        Without events: `besman.motion.grasp_goals.aim_grasps` brings it to its object and place.
    """
    blocks: list[BlockPlan] = []
    for use in leg.uses:
        block = plans[use.task].blocks[use.block]
        thing = objects[leg.thing] if block.frame != "world" else ""
        if blocks:
            begins, speed = blocks[-1].goal, blocks[-1].goal_velocity
        else:
            begins = block.start if start is None else start
            speed = np.zeros_like(begins)
        blocks.append(
            replace(block, start=begins, start_velocity=speed, thing=thing, path_error=None)
        )
    still = np.zeros_like(blocks[-1].goal)
    blocks[-1] = replace(blocks[-1], goal_velocity=still)
    sources = [plans[use.task] for use in leg.uses]
    return TaskPlan(
        name=name,
        label="plan",
        joint_names=sources[0].joint_names,
        blocks=tuple(blocks),
        objects=objects,
        object_poses=poses[0],
        target_poses=poses[1],
        events_s=np.empty(0),
        events=(),
        opening_m=max(one.opening_m for one in sources),
        rmse=max(one.rmse for one in sources),
    )


def join_legs(name: str, legs: Sequence[TaskPlan]) -> TaskPlan:
    """Join legs to one task; goals at places where objects stand only meanwhile are in the world.

    Parameters
    ----------
    name : str
    legs : sequence of TaskPlan
        Each begins where the one before ends, at rest, and with objects where that leaves them:
        how far that is from where they were to be put is no goal of the whole.
    """
    first, last = legs[0], legs[-1]
    blocks: list[BlockPlan] = []
    events: list[tuple[float, str]] = []
    between: list[FloatArray] = []
    passed = 0.0
    for leg in legs:
        put = {block.thing for block in leg.blocks if block.frame == "target"}
        kept = {
            ("object", thing): np.array_equal(leg.object_poses[k], first.object_poses[k])
            for k, thing in enumerate(leg.objects)
        } | {
            ("target", thing): np.array_equal(leg.target_poses[k], last.target_poses[k])
            for k, thing in enumerate(leg.objects)
        }
        blocks += [
            block if kept.get((block.frame, block.thing), True) else _in_world(block, leg)
            for block in leg.blocks
        ]
        between += [
            leg.target_poses[k]
            for k, thing in enumerate(leg.objects)
            if thing in put and not kept["target", thing]
        ]
        events += [
            (passed + float(at), event) for at, event in zip(leg.events_s, leg.events, strict=True)
        ]
        passed += leg.duration
    return replace(
        first,
        name=name,
        blocks=tuple(blocks),
        target_poses=last.target_poses,
        events_s=np.array([at for at, _ in events]),
        events=tuple(event for leg in legs for event in leg.events),
        opening_m=max(leg.opening_m for leg in legs),
        rmse=max(leg.rmse for leg in legs),
        between_poses=np.array(between).reshape(-1, 7),
    )


def _in_world(block: BlockPlan, leg: TaskPlan) -> BlockPlan:
    """Return a block whose goal is in the world."""
    standing = leg.object_poses if block.frame == "object" else leg.target_poses
    goal = frame_matrix(standing[leg.objects.index(block.thing)]) @ frame_matrix(block.goal_pose)
    pose = np.concatenate([goal[:3, 3], rotation_to_quaternion(goal[None, :3, :3])[0]])
    return replace(block, frame="world", thing="", goal_pose=pose)

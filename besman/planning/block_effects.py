"""What each block of whole tasks does to hand and objects, learnt from where it was shown."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from besman.exceptions import PlanError
from besman.records import TaskPlan
from besman.records.layers import IDLE
from besman.records.whole_tasks import Frame

HandState = Literal["away", "full", "at"]
"""Empty and away from all objects, holding one, or empty where it has just let go of one."""


@dataclass(frozen=True)
class BlockUse:
    """Where a block was shown.

    Attributes
    ----------
    task, block : int
        Index of the plan, and of the block in it.
    label : str
    frame : "world", "object" or "target"
        What its goal is relative to.
    thing : str
        The object that is meant; "" in the world.
    before : HandState
        Of the hand when it begins.
    """

    task: int
    block: int
    label: str
    frame: Frame
    thing: str
    before: HandState


@dataclass(frozen=True)
class LearntBlock:
    """What a block does, at one place, and when it can.

    Attributes
    ----------
    label : str
    frame : "world", "object" or "target"
        It brings the hand somewhere, to an object that is then taken, or an object to a place.
    thing : str
        The kind of object; "" in the world.
    place : int
        Index of the place at which that stands, or is put; -1 in the world.
    before : frozenset of HandState
        In which the hand was where it began.
    uses : tuple of BlockUse
        Those that this was learnt from.
    """

    label: str
    frame: Frame
    thing: str
    place: int
    before: frozenset[HandState]
    uses: tuple[BlockUse, ...]

    def after(self, before: HandState) -> HandState:
        """Return the state of the hand when it is over."""
        return hand_after(self.frame, before)


def hand_after(frame: Frame, before: HandState) -> HandState:
    """Return the state of the hand after a block whose goal is in a frame.

    An object is held from the end of the block that leads to it to the end of the one that brings
    it to its place (`besman.stages.imitate.task_plans.find_frame`, told from when it was moved).
    """
    if frame == "object":
        return "full"
    if frame == "target":
        return "at"
    return "full" if before == "full" else "away"


def find_uses(plans: Sequence[TaskPlan]) -> tuple[BlockUse, ...]:
    """Go through tasks as they were shown, and tell the state of the hand before each block.

    A task in which something is put that no block leads to, or taken while something is held, is
    left out: nothing can be learnt from it.

    Parameters
    ----------
    plans : sequence of TaskPlan
        As imitated; rests among their blocks do not matter.
    """
    found: list[BlockUse] = []
    for task, plan in enumerate(plans):
        own: list[BlockUse] = []
        hand: HandState = "away"
        for number, block in enumerate(plan.blocks):
            if block.label == IDLE:
                continue
            if (block.frame == "target") != (hand == "full") and block.frame != "world":
                break
            own.append(BlockUse(task, number, block.label, block.frame, block.thing, hand))
            hand = hand_after(block.frame, hand)
        else:
            found += own
    return tuple(found)


def standing_poses(uses: Sequence[BlockUse], plans: Sequence[TaskPlan]) -> npt.NDArray[np.float64]:
    """Return where the object of each use stands or is put, shape (U, 7); NaN in the world."""
    poses = np.full((len(uses), 7), np.nan)
    for row, use in enumerate(uses):
        if use.frame != "world":
            plan = plans[use.task]
            standing = plan.object_poses if use.frame == "object" else plan.target_poses
            poses[row] = standing[plan.objects.index(use.thing)]
    return poses


def learn_blocks(uses: Sequence[BlockUse], places: Sequence[int]) -> tuple[LearntBlock, ...]:
    """Learn what blocks do, one entry for each block and place.

    Of a block that did different things the most frequent is learnt; of two as frequent the one
    that was shown first.

    Parameters
    ----------
    uses : sequence of BlockUse
    places : sequence of int, length U
        Where the object of each stands or is put; -1 in the world.

    Raises
    ------
    PlanError
        If nothing was learnt, or no block takes something and brings it to a place.
    """
    learnt = []
    for label in dict.fromkeys(use.label for use in uses):
        own = [row for row, use in enumerate(uses) if use.label == label]
        (effect, _), *_ = Counter((uses[row].frame, uses[row].thing) for row in own).most_common(1)
        own = [row for row in own if (uses[row].frame, uses[row].thing) == effect]
        for place in sorted({places[row] for row in own}):
            here = tuple(uses[row] for row in own if places[row] == place)
            before = frozenset(use.before for use in here)
            learnt.append(LearntBlock(label, *effect, place, before, here))
    missing = [frame for frame in ("object", "target") if all(b.frame != frame for b in learnt)]
    if missing:
        raise PlanError(
            f"no block {'takes an object' if 'object' in missing else 'puts an object down'}; "
            f"learnt: {', '.join(dict.fromkeys(block.label for block in learnt)) or 'nothing'}"
        )
    return tuple(learnt)


def same_effect(block: LearntBlock, blocks: Sequence[LearntBlock]) -> tuple[LearntBlock, ...]:
    """Return the other blocks that do the same, and can whenever that one can."""

    def effect(one: LearntBlock) -> tuple[str, str, int]:
        return one.frame, one.thing, one.place

    return tuple(
        one
        for one in blocks
        if one != block and effect(one) == effect(block) and one.before >= block.before
    )


def shown_ends(uses: Sequence[BlockUse]) -> frozenset[HandState]:
    """Return how the hand was when tasks were over."""
    last = {use.task: use for use in uses}
    return frozenset(hand_after(use.frame, use.before) for use in last.values())


def shown_successions(uses: Sequence[BlockUse]) -> frozenset[tuple[str, str]]:
    """Return which block was shown to follow which."""
    pairs = itertools.pairwise(uses)
    return frozenset((one.label, other.label) for one, other in pairs if one.task == other.task)

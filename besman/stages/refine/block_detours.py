"""Parts of a task led around what they would touch, before anything is simulated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from besman.exceptions import PlanError
from besman.motion.grasp_way import GraspWay
from besman.motion.task_rollout import sample_task
from besman.records import TaskPlan
from besman.simulation.tasks.rearrange.block_trials import BlockGoal, BlockTrials
from besman.simulation.tasks.rearrange.clearance import RATE_HZ, Course, Hold, Surroundings
from besman.simulation.tasks.rearrange.detours import lead_around
from besman.stages.refine.block_parts import Part, lead_part, n_parameters

FloatArray = npt.NDArray[np.float64]


def lead_parts_around(
    parts: Sequence[Part], way: GraspWay, trials: BlockTrials
) -> tuple[Part, ...]:
    """Lead all parts as they were shown around what they touch, each from where the last one ends.

    Parameters
    ----------
    parts : sequence of Part
        In their order, from the first.
    way : GraspWay
    trials : BlockTrials

    Returns
    -------
    tuple of Part
        As of `lead_part_around`, and the same from the first on that is out of reach.
    """
    found: list[Part] = []
    before: list[TaskPlan] = []
    for number, part in enumerate(parts):
        try:
            part = lead_part_around(part, way, trials, before)
            last = before[-1] if before else None
            before.append(
                lead_part(part, way, trials.robot, np.zeros(n_parameters(part.goal)), last)
            )
        except PlanError:
            return (*found, *parts[number:])
        found.append(part)
    return tuple(found)


def lead_part_around(
    part: Part, way: GraspWay, trials: BlockTrials, before: Sequence[TaskPlan]
) -> Part:
    """Lead a part as it was shown around what it touches, told by capsules.

    Parameters
    ----------
    part : Part
    way : GraspWay
    trials : BlockTrials
    before : sequence of TaskPlan
        The parts before; the last is where it begins.

    Returns
    -------
    Part
        The same one where nothing is touched, or no detour is found.

    Raises
    ------
    OutOfReachError
        If it is out of reach.
    """
    robot = trials.robot
    last = before[-1] if before else None
    led = lead_part(part, way, robot, np.zeros(n_parameters(part.goal)), last)
    taking = before[0] if before else led
    course = part_course(led, part.goal, trials.around, trials.thing, taking.blocks[-2].goal)
    time, positions, _, _ = sample_task(led, RATE_HZ)
    if course.gaps(time, positions).min() > 0.0:
        return part
    detour = lead_around(led, robot, course)
    return part if detour is None else _with_shape(part, led, detour)


def part_course(
    led: TaskPlan, goal: BlockGoal, around: Surroundings, thing: int, taken_at: FloatArray
) -> Course:
    """Return what there is to be touched in the course of a part.

    Parameters
    ----------
    led : TaskPlan
        Of `besman.stages.refine.block_parts.lead_part`.
    goal : "take", "put" or "leave"
    around : Surroundings
    thing : int
        The box.
    taken_at : array, shape (n,)
        The arm where it takes the box, rad.
    """
    end, straight_s = led.duration, led.blocks[-1].duration
    # Before the part begins, and after it has ended, is before and after all of its samples.
    if goal == "take":
        hold = Hold(thing, end - straight_s, end, 2 * end, 3 * end)
    elif goal == "put":
        lowered_s = end - straight_s
        lowering_s = lowered_s - led.blocks[-2].duration
        hold = Hold(thing, -1.0, 0.0, lowering_s, lowered_s)
    else:
        hold = Hold(thing, -4.0, -3.0, -2.0, -1.0)
    return Course(around, (hold,), taken_at[None])


def _with_shape(part: Part, led: TaskPlan, detour: TaskPlan) -> Part:
    """Return a part with what a detour has changed of the shapes of its blocks."""
    # Straight ways follow its own blocks.
    blocks = tuple(
        replace(block, weights=block.weights + new.weights - old.weights, path_error=None)
        for block, old, new in zip(part.plan.blocks, led.blocks, detour.blocks, strict=False)
    )
    return part._replace(plan=replace(part.plan, blocks=blocks))

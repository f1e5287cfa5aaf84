"""Blocks led around a board in their way (synthetic): ends, straight ways and limits stay."""

import dataclasses

import numpy as np
import pytest
from whole_task import carry_box

from besman.motion.grasp_goals import lead_grasps
from besman.motion.grasp_postures import Postures
from besman.motion.task_rollout import sample_task
from besman.records.layers import IDLE
from besman.robot.kinematics import forward_kinematics
from besman.simulation.tasks.kinds import load_whole_task
from besman.simulation.tasks.rearrange.clearance import Surroundings
from besman.simulation.tasks.rearrange.detours import free_blocks, lead_around, list_changes

TASK = load_whole_task("rearrange")


def robot():
    return carry_box()[0]


def carried():
    return carry_box()[2]


@pytest.fixture(scope="module")
def led():
    """A task that touches nothing, and what is around it."""
    plan = carried()
    frame = TASK.box_frame([plan], robot())
    around = Surroundings.of(plan, robot(), TASK, frame)
    postures = Postures(plan, robot(), around.gaps)
    return around, lead_grasps(plan, robot(), TASK.grasp_way(frame), postures)


def in_the_way(around, plan, share, block):
    """Put one more board where the hand is in the midst of a block."""
    at = plan.starts_s[block] + share * plan.blocks[block].duration
    time, rows, _, _ = sample_task(plan, 50.0)
    board = np.eye(4)
    board[:3, 3] = forward_kinematics(robot().chain, rows[np.searchsorted(time, at)])[:3, 3]
    return dataclasses.replace(around, boards=np.concatenate([around.boards, board[None]]))


def test_straight_ways_to_and_from_a_box_are_not_free(led):
    plan = led[1]
    straight = {int(np.argmin(np.abs(plan.starts_s - at))) for at in plan.events_s}
    straight |= {at - 1 for at in straight}
    straight |= {k for k, block in enumerate(plan.blocks) if block.label == IDLE}
    assert set(free_blocks(plan)) == set(range(len(plan.blocks))) - straight


def test_a_block_goes_around_a_board_that_stands_in_its_way(led):
    around, plan = led
    assert around.clearance(plan) > 0.0
    block = free_blocks(plan)[0]
    blocked = in_the_way(around, plan, 0.5, block)
    assert blocked.clearance(plan) < 0.0
    found = lead_around(plan, robot(), blocked.follow(plan))
    assert blocked.clearance(found) > 0.002
    for k, (one, other) in enumerate(zip(plan.blocks, found.blocks, strict=True)):
        np.testing.assert_array_equal(one.start, other.start)
        np.testing.assert_array_equal(one.goal, other.goal)
        assert np.array_equal(one.weights, other.weights) == (k != block)
    # The block keeps its velocities where it begins and ends, and leaves them without a jerk.
    (time, *before), (_, *after) = sample_task(plan, 1000.0), sample_task(found, 1000.0)
    first = np.searchsorted(time, plan.starts_s[block])
    last = np.searchsorted(time, plan.starts_s[block] + plan.blocks[block].duration)
    for row in (first, last - 1):
        for one, other, off in zip(before, after, (1e-6, 1e-3, 0.3), strict=True):
            np.testing.assert_allclose(other[row], one[row], atol=off)
    limits = robot().limits
    assert np.all(after[0] >= limits.position_min - 1e-6)
    assert np.all(after[0] <= limits.position_max + 1e-6)


def test_what_is_clear_stays_and_what_touches_on_a_straight_way_has_no_detour(led):
    around, plan = led
    straight = int(np.argmin(np.abs(plan.starts_s - plan.events_s[0])))
    blocked = in_the_way(around, plan, 0.5, straight)
    assert lead_around(plan, robot(), blocked.follow(plan)) is None
    course = around.follow(plan)
    same = lead_around(plan, robot(), course)
    gaps = course.gaps(*sample_task(plan, 50.0)[:2])
    if gaps.min() >= 0.01:
        assert all(a is b for a, b in zip(plan.blocks, same.blocks, strict=True))


def test_changes_move_the_tool_to_all_sides():
    posture = carried().blocks[0].start
    changes = list_changes(posture, robot())
    tools = forward_kinematics(robot().chain, posture + changes)
    moved = tools[:, :3, 3] - forward_kinematics(robot().chain, posture[None])[0, :3, 3]
    # The shortest, 5 cm to each of 26 sides, as well as the arm can.
    lengths = np.linalg.norm(moved[:26], axis=1)
    assert np.median(lengths) == pytest.approx(0.05, rel=0.1)
    assert (moved.min(axis=0) < -0.1).all()
    assert (moved.max(axis=0) > 0.1).all()
    turned = np.count_nonzero(changes, axis=1) == 1
    assert turned.sum() == 4 * robot().n

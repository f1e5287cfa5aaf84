"""Parts of a whole task led around boards before anything is simulated (synthetic)."""

import dataclasses
import functools

import numpy as np
import pytest
from whole_task import carry_box

from besman.motion.task_rollout import sample_task
from besman.robot.kinematics import forward_kinematics
from besman.simulation.tasks.kinds import load_whole_task
from besman.simulation.tasks.rearrange.block_trials import BlockTrials
from besman.stages.refine.block_detours import lead_part_around, lead_parts_around, part_course
from besman.stages.refine.block_parts import lead_part, n_parameters, split_task
from besman.stages.refine.block_search import join_parts

TASK = load_whole_task("rearrange")
ROBOT, _, PLAN = carry_box()
FRAME = TASK.box_frame([PLAN], ROBOT)
WAY = TASK.grasp_way(FRAME)


@functools.cache
def bench():
    """Parts of a task that touches nothing, as they are led, and its scene."""
    parts = tuple(part._replace(tool=WAY.tool) for part in split_task(PLAN))
    led = []
    for part in parts:
        last = led[-1] if led else None
        led.append(lead_part(part, WAY, ROBOT, np.zeros(n_parameters(part.goal)), last))
    return parts, led, BlockTrials.of(PLAN, ROBOT, TASK, FRAME, 0)


def gaps_of(trials, goal, led, taken_at):
    course = part_course(led, goal, trials.around, 0, taken_at)
    return course.gaps(*sample_task(led, 50.0)[:2])


def test_a_part_is_as_far_from_everything_as_it_is_in_the_whole():
    parts, led, trials = bench()
    whole = join_parts(led)
    course = trials.around.follow(whole)
    starts = np.cumsum([0.0, *(part.duration for part in led)])
    for part, own, start in zip(parts, led, starts, strict=False):
        time, rows, _, _ = sample_task(own, 50.0)
        # The very ends belong to either part.
        inner = (time > 0.01) & (time < own.duration - 0.01)
        found = gaps_of(trials, part.goal, own, led[0].blocks[-2].goal)
        asked = course.gaps(start + time[inner], rows[inner])
        np.testing.assert_allclose(found[inner], asked, atol=1e-9, err_msg=part.goal)


@pytest.mark.parametrize("number", [0, 1])
def test_a_part_is_led_around_a_board_in_its_way(number):
    parts, led, trials = bench()
    first = led[number].blocks[0]
    rows = sample_task(dataclasses.replace(led[number], blocks=(first,)), 50.0)[1]
    board = np.eye(4)
    board[:3, 3] = forward_kinematics(ROBOT.chain, rows)[len(rows) // 2, :3, 3]
    boards = np.concatenate([trials.around.boards, board[None]])
    blocked = dataclasses.replace(trials, around=dataclasses.replace(trials.around, boards=boards))
    taken_at = led[0].blocks[-2].goal
    goal = parts[number].goal
    assert gaps_of(blocked, goal, led[number], taken_at).min() < 0.0
    part = lead_part_around(parts[number], WAY, blocked, led[:number])
    last = led[number - 1] if number else None
    free = lead_part(part, WAY, ROBOT, np.zeros(n_parameters(goal)), last)
    assert gaps_of(blocked, goal, free, taken_at).min() > 0.002
    for one, other in zip(led[number].blocks, free.blocks, strict=True):
        np.testing.assert_array_equal(one.goal, other.goal)
    # Of all parts this one alone is changed, where the others touch nothing there.
    for k, (one, other) in enumerate(
        zip(parts, lead_parts_around(parts, WAY, blocked), strict=True)
    ):
        if gaps_of(blocked, one.goal, led[k], taken_at).min() > 0.0:
            assert one is other


def test_what_is_out_of_reach_stays_as_it_is_and_all_after_it():
    parts, _, trials = bench()
    far = np.array(parts[1].tool)
    far[:3, 3] += 5.0
    wrong = (parts[0], parts[1]._replace(tool=far), parts[2])
    led = lead_parts_around(wrong, WAY, trials)
    assert [one is other for one, other in zip(led, wrong, strict=True)] == [True] * 3

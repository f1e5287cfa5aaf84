"""Where the arm rests beside what stands there (synthetic)."""

from functools import cache

import numpy as np
import pytest
from whole_task import learn_both

from besman.exceptions import PlanError
from besman.planning.goals import parse_goals, parse_start
from besman.planning.planned_run import plan_goals
from besman.planning.resting import ClearRests, nearest_rest, rest_clear, shown_rests
from besman.robot.kinematics import forward_kinematics
from besman.simulation.tasks.rearrange.boxes import board_pose
from besman.simulation.tasks.rearrange.clearance import Surroundings

FAR = np.array([[0.0, -3.0, 0.5, 1, 0, 0, 0]])


def bench():
    return learn_both().bench


@cache
def all_shown():
    return shown_rests(bench().plans)


def rests(shown=None):
    some = all_shown() if shown is None else shown
    return ClearRests("plan", some, (), bench().robot, bench().task)


def box_at(rest):
    """Put a box where the gripper is in a rest, upright."""
    return np.array([[*forward_kinematics(bench().robot.chain, rest[None])[0, :3, 3], 1, 0, 0, 0]])


def test_rests_are_where_tasks_begin_and_end():
    for plan in bench().plans:
        for end in (plan.blocks[0].start, plan.blocks[-1].goal):
            assert np.any(np.all(end == all_shown(), axis=1))
    assert len(all_shown()) <= 2 * len(bench().plans)


def test_clear_rests_are_the_ones_that_were_shown():
    np.testing.assert_array_equal(rests().beside(FAR), all_shown())
    kept = rests()
    assert kept.beside(FAR) is kept.beside(FAR.copy())


def test_where_something_stands_in_all_rests_the_arm_is_beside_it():
    shown = all_shown()[:1]
    standing = box_at(shown[0])
    boards = np.stack([board_pose(pose, bench().task) for pose in standing])
    around = Surroundings(bench().robot, bench().task, standing, standing, boards)
    assert around.gaps_before(shown)[0] < 0.0
    found = rests(shown).beside(standing)
    assert len(found)
    assert np.all(around.gaps_before(found) >= 0.002)
    low, high = bench().robot.limits.position_min, bench().robot.limits.position_max
    assert np.all((found >= low) & (found <= high))


def test_where_there_is_no_rest_it_is_said():
    tool = forward_kinematics(bench().robot.chain, all_shown()[:1])[0, :3, 3]
    grid = np.stack(np.meshgrid(*[np.arange(-0.5, 0.51, 0.1)] * 3), axis=-1).reshape(-1, 3)
    standing = np.hstack([tool + grid, np.tile([1.0, 0, 0, 0], (len(grid), 1))])
    with pytest.raises(PlanError, match=r"wherever the arm was shown to rest \(1 postures\), and"):
        rests(all_shown()[:1]).beside(standing)


def test_the_last_block_leads_to_the_nearest_clear_rest():
    plan = bench().plans[0]
    last = plan.blocks[-1]
    assert last.frame == "world"
    assert rest_clear(plan, last.goal[None], bench().robot) is plan
    other = last.goal + 0.1
    moved = rest_clear(plan, np.stack([other + 1.0, other]), bench().robot).blocks[-1]
    np.testing.assert_array_equal(moved.goal, other)
    pose = forward_kinematics(bench().robot.chain, other[None])[0]
    np.testing.assert_allclose(moved.goal_pose[:3], pose[:3, 3])
    np.testing.assert_array_equal(nearest_rest(last.goal, all_shown()), last.goal)


def test_a_box_that_stands_where_the_arm_would_begin_is_no_hindrance():
    """Every rest that was shown touches the second box; the plan begins, and ends, beside it."""
    learnt = learn_both()
    tool = forward_kinematics(bench().robot.chain, all_shown())[:, :3, 3].mean(axis=0)
    start = f"box1 on shelf; box2 on table at x={tool[0]:.3f},y={tool[1]:.3f}"
    goals = parse_goals("box1 on table at x=0.1,y=-0.6")
    made = plan_goals("plan", goals, parse_start(start), learnt, refine=False)
    first = made.plan.blocks[0].start
    boards = np.stack([board_pose(pose, bench().task) for pose in made.legs[0].before])
    around = Surroundings(
        bench().robot, bench().task, made.legs[0].before, made.legs[0].before, boards
    )
    assert around.gaps_before(first[None])[0] >= 0.002

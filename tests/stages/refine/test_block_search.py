"""Whole tasks refined block by block, and as one (synthetic)."""

import dataclasses
import functools

import numpy as np
import pytest
from whole_task import carry_box

from besman.exceptions import PlanError
from besman.simulation.tasks.kinds import load_whole_task
from besman.simulation.tasks.rearrange.block_trials import BlockTrials
from besman.stages.refine.block_parts import n_parameters, shape_part, split_task
from besman.stages.refine.block_search import search_blocks, search_whole

TASK = load_whole_task("rearrange")


@functools.cache
def bench():
    robot, _, plan = carry_box()
    frame = TASK.box_frame([plan], robot)
    tool = TASK.grasp_way(frame).tool
    parts = tuple(part._replace(tool=tool) for part in split_task(plan))
    return parts, TASK.grasp_way(frame), BlockTrials.of(plan, robot, TASK, frame, 0), frame


def test_parts_one_after_the_other_are_the_whole():
    """The box ends where it does when all is simulated at once."""
    parts, way, trials, frame = bench()
    found = search_blocks(parts, way, trials, budget=1, seed=0, sigma=1.0)
    assert (found.success, found.episodes) == (True, {"take": 1, "put": 0, "leave": 0})
    (trial,) = TASK.try_tasks([found.plan], trials.robot, frame)
    assert trial.success
    state, last = trials.first(parts[0].plan.blocks[0].start), None
    for part in parts:
        last = shape_part(part, way, trials.robot, np.zeros(n_parameters(part.goal)), last)
        outcome = trials.attempt(last, state, part.goal)
        state = outcome.end
    np.testing.assert_allclose(state.qpos[-7:-4], trial.outcomes[0, :3], atol=5e-4)
    as_one = search_whole(parts, way, trials, budget=1, seed=0, sigma=1.0)
    assert (as_one.success, as_one.episodes) == (True, {"whole": 1})
    assert as_one.simulated_s == pytest.approx(found.simulated_s)


def test_a_part_that_fails_is_searched_alone():
    """Fingers that close before the box: taking it needs episodes, nothing after it does."""
    parts, way, trials, _ = bench()
    before = np.array(parts[0].tool)
    before[:3, 3] -= 0.09 * before[:3, 2]
    wrong = (parts[0]._replace(tool=before), *parts[1:])
    shown = search_blocks(wrong, way, trials, budget=1, seed=1, sigma=2.0)
    assert (shown.success, shown.plan, shown.episodes) == (False, None, {"take": 1})
    found = search_blocks(wrong, way, trials, budget=60, seed=1, sigma=2.0)
    assert 1 < found.episodes["take"] < 60
    assert "put" in found.episodes


def test_from_scratch_nothing_of_the_person_is_left_but_order_and_rests():
    plan = carry_box()[2]
    bare = split_task(plan, scratch=True)
    assert [part.goal for part in bare] == ["take", "put", "leave"]
    assert not any(np.any(block.weights) for part in bare for block in part.plan.blocks)
    np.testing.assert_array_equal(bare[0].tool, bare[1].tool)
    assert bare[-1].plan.blocks[-1].goal is not None


def test_a_task_that_puts_nothing_is_refused():
    plan = carry_box()[2]
    still = np.zeros(len(plan.joint_names))
    first = dataclasses.replace(plan.blocks[0], goal_velocity=still)
    nothing = dataclasses.replace(plan, blocks=(first,), events_s=np.empty(0), events=())
    with pytest.raises(PlanError, match="expected one object that is taken and put, once"):
        split_task(nothing)

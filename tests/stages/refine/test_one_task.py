"""One whole task refined in other ways, and block by block (synthetic)."""

import dataclasses
import functools

import numpy as np
import pytest
from whole_task import carry_box

from besman.exceptions import PlanError
from besman.motion.task_rollout import sample_task
from besman.records import RefinedTask
from besman.simulation.tasks.kinds import load_whole_task
from besman.stages.refine import one_task
from besman.stages.refine.one_task import refine_task, search_task_blocks

TASK = load_whole_task("rearrange")


def by(way):
    return TASK.model_copy(update={"search": TASK.search.model_copy(update={"by": way})})


@functools.cache
def bench():
    """Robot, task as imitated, box, and what came of the first way, as if it had failed."""
    robot, _, plan = carry_box()
    frame = TASK.box_frame([plan], robot)
    grasp, aimed = next(TASK.aim(plan, robot, frame))
    (trial,) = TASK.try_tasks([aimed], robot, frame)
    assert trial.success
    failed = dataclasses.replace(trial, success=False, failure="box dropped: in this test")
    return robot, plan, frame, grasp, RefinedTask(aimed, failed, 1)


def test_block_by_block_begins_with_the_way_in_which_the_task_was_brought():
    robot, _, frame, grasp, first = bench()
    found = search_task_blocks(first.plan, grasp, robot, TASK, frame)
    # One episode goes through all parts.
    assert (found.success, sum(found.episodes.values())) == (True, 2)
    assert len(found.rewards) == 2
    time, positions, *_ = sample_task(first.plan)
    again = sample_task(found.plan)
    np.testing.assert_allclose(again[0][-1], time[-1], rtol=1e-3)
    rows = np.linspace(0, min(len(time), len(again[0])) - 1, 50).astype(int)
    np.testing.assert_allclose(again[1][rows], positions[rows], atol=0.02)


def test_what_fails_is_searched_by_blocks_then_in_other_ways_and_kept(tmp_path, monkeypatch):
    robot, plan, frame, _, first = bench()
    refined = refine_task(plan, first, robot, by("blocks"), frame, tmp_path)
    # The first way, the episode of the blocks, the whole of them, and that judged as any other.
    assert (refined.trial.success, refined.tries) == (True, 4)
    others = refine_task(plan, first, robot, TASK, frame)
    assert (others.trial.success, others.tries) == (True, 2)
    assert not one_task.is_same(others.plan, first.plan)
    good = dataclasses.replace(first, trial=refined.trial)
    assert refine_task(plan, good, robot, TASK, frame, tmp_path) is good

    def fail(*_):
        raise AssertionError("it was searched again")

    monkeypatch.setattr(one_task, "_search", fail)
    kept = refine_task(plan, first, robot, TASK, frame, tmp_path)
    assert kept.tries == 4
    assert one_task.is_same(kept.plan, refined.plan)
    (file,) = tmp_path.iterdir()
    file.write_bytes(b"half")
    with pytest.raises(AssertionError, match="searched again"):
        refine_task(plan, first, robot, TASK, frame, tmp_path)


def test_where_no_other_way_is_left_blocks_are_searched(monkeypatch):
    robot, plan, frame, grasp, first = bench()
    monkeypatch.setattr(type(TASK), "aim", lambda *_: iter([(grasp, first.plan)]))
    refined = refine_task(plan, first, robot, TASK, frame)
    assert (refined.trial.success, refined.tries) == (True, 4)


def test_a_task_that_takes_nothing_has_no_parts():
    robot, _, frame, grasp, first = bench()
    still = np.zeros(robot.n)
    world = dataclasses.replace(first.plan.blocks[0], frame="world", thing="", goal_velocity=still)
    nothing = dataclasses.replace(first.plan, blocks=(world,), events_s=np.empty(0), events=())
    assert search_task_blocks(nothing, grasp, robot, TASK, frame) is None


def test_without_any_way_the_first_reason_is_said(monkeypatch):
    robot, plan, frame, _, _ = bench()

    def none(self, plan, robot, frame, failed):
        failed(self.grasp, PlanError("far away"))
        return iter(())

    monkeypatch.setattr(type(TASK), "aim", none)
    with pytest.raises(PlanError, match="far away"):
        refine_task(plan, None, robot, TASK, frame)

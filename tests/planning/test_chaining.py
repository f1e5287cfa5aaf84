"""Blocks of demonstrations joined to legs, and legs to one task (synthetic)."""

from dataclasses import replace

import numpy as np
import pytest
from whole_task import learn_both

from besman.planning.attempts import rank_sources
from besman.planning.chaining import Leg, chain_leg, join_legs
from besman.planning.goals import parse_goals
from besman.planning.planned_run import plan_goals


def test_blocks_begin_where_and_as_fast_as_the_one_before_ends():
    """A carrying block of one demonstration after an approach of another."""
    learnt = learn_both()
    plans = learnt.bench.plans
    uses = {use.label: use for block in learnt.blocks for use in block.uses}
    chosen = tuple(uses[label] for label in ("approach_forward", "move_obj_shelf"))
    poses = (plans[0].object_poses, plans[1].target_poses)
    start = plans[0].blocks[0].start + 0.1
    plan = chain_leg("p", Leg(chosen, 0), plans, ("box1",), poses, start)
    first, second = plan.blocks
    np.testing.assert_array_equal(first.start, start)
    np.testing.assert_array_equal(first.start_velocity, np.zeros_like(start))
    np.testing.assert_array_equal(second.start, first.goal)
    np.testing.assert_array_equal(second.start_velocity, first.goal_velocity)
    np.testing.assert_array_equal(second.goal_velocity, np.zeros_like(start))
    shown = plans[chosen[1].task].blocks[chosen[1].block]
    np.testing.assert_array_equal(second.weights, shown.weights)
    np.testing.assert_array_equal(second.goal, shown.goal)
    assert (first.thing, second.frame) == ("box1", "target")


def test_legs_that_are_joined_keep_their_time_and_events():
    (leg,) = plan_goals(
        "p", parse_goals("box1 on table at x=0.1,y=-0.6"), (), learn_both(), False
    ).legs
    plan = leg.plan
    assert join_legs("q", [plan]).name == "q"
    np.testing.assert_array_equal(join_legs("q", [plan]).events_s, plan.events_s)
    moved = replace(plan.blocks[0], start=plan.blocks[-1].goal)
    again = replace(
        plan,
        blocks=(moved, *plan.blocks[1:]),
        object_poses=plan.target_poses,
        target_poses=plan.object_poses,
    )
    both = join_legs("q", [plan, again])
    assert both.duration == pytest.approx(plan.duration + again.duration)
    np.testing.assert_allclose(both.events_s, [*plan.events_s, *(plan.events_s + plan.duration)])
    np.testing.assert_array_equal(both.between_poses, plan.target_poses)
    np.testing.assert_array_equal(both.target_poses, plan.object_poses)


def test_demonstrations_that_succeed_and_are_near_come_first():
    learnt = learn_both()
    put = next(block for block in learnt.blocks if block.label == "move_obj_table")
    (use,) = put.uses
    plans = learnt.bench.plans
    far = replace(plans[use.task], target_poses=plans[use.task].target_poses + np.eye(7)[0] * 0.1)
    bench = replace(learnt.bench, plans=(*plans, far))
    block = replace(put, uses=(replace(use, task=2), use))
    pose = learnt.places[put.place].pose
    standing = pose[np.newaxis]

    def first(good):
        ranked = rank_sources((block,), 0, standing, pose, replace(bench, good=frozenset(good)))
        return [[use.task for use in uses] for uses in ranked]

    assert first(()) == [[use.task, 2]]
    assert first((2,)) == [[2, use.task]]

"""Motions by posture: joined over others, wherever they stand in the order."""

from dataclasses import replace

import numpy as np

from besman.stages.refine.postures import group_by_posture


def test_what_is_near_over_others_is_one_group(make_plan):
    plan = make_plan(1.0)
    flip = np.array([3.1, 0, 0, 0, 0, 0])

    def moved(shift):
        return replace(plan, start=plan.start + shift, goal=plan.goal + shift)

    plans = [moved(0.0), moved(flip), moved(1.8), moved(0.9), moved(flip + 0.1)]
    assert group_by_posture(plans) == [[0, 2, 3], [1, 4]]
    assert group_by_posture(plans[:3]) == [[0], [1], [2]]


def test_a_goal_in_another_posture_is_another_group(make_plan):
    plan = make_plan(1.0)
    assert group_by_posture([plan, replace(plan, goal=plan.goal + 1.5)]) == [[0], [1]]

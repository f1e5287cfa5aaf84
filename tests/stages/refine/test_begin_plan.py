"""What a search begins with."""

from dataclasses import replace

import numpy as np
import pytest

from besman.exceptions import RefinementError
from besman.robot.model import load_robot
from besman.simulation.tasks.kinds import load_task
from besman.stages.refine.begin_plan import begin_plan, place_plan


def test_a_throw_begins_as_it_was_imitated(robot, make_plan):
    task, plan = load_task("stick_throw"), make_plan(0.54)
    begun = begin_plan(plan, robot, task)
    for name in ("weights", "start", "goal"):
        np.testing.assert_array_equal(getattr(begun, name), getattr(plan, name))
    np.testing.assert_array_equal(begun.target, place_plan(plan, robot, task).target)


def test_plans_of_other_arms_and_without_a_target_are_refused(robot, make_plan):
    task, plan = load_task("stick_throw"), make_plan(0.54)
    other = "plan for joints shoulder.*; robot iiwa7 has joint_1"
    with pytest.raises(RefinementError, match=other):
        begin_plan(plan, load_robot("iiwa7"), task)
    nowhere = replace(plan, target=np.full(3, np.nan))
    with pytest.raises(RefinementError, match=r"task stick_throw needs a .*, got none"):
        begin_plan(nowhere, robot, task)

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from besman.records import MotionPlan
from besman.robot.model import load_robot
from besman.simulation.second_engine.drake_scene import ContactModel
from besman.simulation.second_engine.drake_throws import throw_ball, throw_stick
from besman.simulation.tasks.kinds import load_task

pytest.importorskip("pydrake", reason="the extra verify is not installed")


def swing(robot, goal, duration):
    """Swing from home to joint angles with least jerk."""
    return MotionPlan(
        weights=np.zeros((robot.n, 10)),
        start=robot.home,
        goal=robot.home + goal,
        duration=duration,
        joint_names=robot.joint_names,
        rmse=0.0,
        goal_pose=np.full(7, np.nan),
        target=np.zeros(3),
        name="a",
        label="x",
    )


def test_a_ball_flies_as_in_mujoco(scooper, scoop_throw):
    task = load_task("ball_throw")
    # Slow enough for the arm.
    plan = replace(task.place(scoop_throw, scooper), duration=0.8)
    movements = task.move([plan], scooper)
    first = task.simulate(scooper, [plan], movements, False)
    second = throw_ball(scooper, task, movements)
    assert second.failures == first.failures
    np.testing.assert_allclose(second.outcomes, first.outcomes, atol=0.05)
    np.testing.assert_allclose(second.end_poses[0, :3], first.end_poses[0, :3], atol=0.02)


def test_a_stick_that_is_not_thrown_stays_in_its_tube():
    robot, task = load_robot("ur5", "stick_holder"), load_task("stick_throw")
    plan = swing(robot, np.full(robot.n, 0.02), 0.3)
    movements = task.move([plan], robot)
    first = task.simulate(robot, [plan], movements, False)
    second = throw_stick(robot, task, movements, ContactModel(substeps=1))
    assert second.failures == first.failures
    assert np.isnan(second.outcomes).all() == np.isnan(first.outcomes).all()
    assert second.tracking_errors[0] == pytest.approx(first.tracking_errors[0], abs=0.002)
    np.testing.assert_allclose(second.end_poses[0, :3], first.end_poses[0, :3], atol=0.002)

from dataclasses import replace

import numpy as np
import pytest

from besman.simulation.tasks.kinds import load_task
from besman.simulation.trial import move, try_plans

TASK = load_task("stick_throw")


def test_reward_is_minus_the_miss(robot, make_plan):
    (trial,) = try_plans(robot, TASK, [make_plan()])
    assert trial.failure == ""
    assert trial.reward == pytest.approx(-trial.miss)
    assert trial.miss == pytest.approx(np.linalg.norm(trial.outcome - [1.5, -0.6, 0]))
    (hit,) = try_plans(robot, TASK, [make_plan(target=trial.outcome)])
    assert hit.success
    assert hit.miss == 0


def test_threads_change_nothing(robot, make_plan):
    plans = [make_plan(duration) for duration in np.linspace(0.52, 0.8, 19)]
    one, three = try_plans(robot, TASK, plans, 1), try_plans(robot, TASK, plans, 3)
    for first, second in zip(one, three, strict=True):
        assert first.failure == second.failure
        np.testing.assert_array_equal(first.outcome, second.outcome)


def test_beyond_a_joint_limit(robot, make_plan):
    plan = make_plan()
    limits = replace(robot.limits, position_max=np.where(np.arange(6) == 0, 2.0, 7.0))
    (trial,) = try_plans(replace(robot, limits=limits), TASK, [plan])
    assert trial.failure == "position limit"
    assert not trial.success
    excess = plan.goal[0] - 2.0
    assert trial.reward == pytest.approx(-(trial.miss + 10 * excess + 5))


def test_through_itself(robot, make_plan):
    folded = make_plan(3.0, goal=np.array([1.52, -3.75, 3.1, -1.39, -0.70, -0.12]))
    (trial,) = try_plans(robot, TASK, [folded])
    assert trial.failure != ""
    assert trial.reward < -5


def test_failures_are_ordered_by_how_bad_they_are(robot, make_plan):
    slow, slower = try_plans(robot, TASK, [make_plan(1.6), make_plan(3.0)])
    assert slow.failure == slower.failure == "stick not released"
    assert slow.reward > slower.reward
    assert np.isnan(slow.miss)


def test_movements_last_as_long_as_the_task_needs(make_plan):
    movements = move([make_plan(0.5), make_plan(0.7)], TASK)
    assert movements.positions.shape[1] == 1001
    assert (movements.velocities[0, 501:] == 0).all()
    assert (movements.positions[0, 501:] == movements.positions[0, 501]).all()

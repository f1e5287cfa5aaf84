"""An arm that is known to be late is late in the simulation, and has not failed for that."""

from dataclasses import replace

import numpy as np

from besman.robot.mujoco_model import servo_controls
from besman.simulation.episodes import repeat_movement
from besman.simulation.setpoints import expected_movements, servo_setpoints
from besman.simulation.tasks.kinds import load_task
from besman.simulation.trial import try_movements

STEP_S = 0.002


def test_ideal_servos_get_what_is_sent_and_others_get_it_late(robot, make_plan):
    task = load_task("stick_throw")
    movements = task.move([make_plan(0.54)], robot)
    sent = servo_controls(robot, movements.positions, movements.velocities, movements.accelerations)
    np.testing.assert_array_equal(servo_setpoints(robot, movements, STEP_S), sent)
    assert expected_movements(robot, movements, STEP_S).positions is movements.positions
    late = replace(robot, drives=replace(robot.drives, delays=np.full(6, 0.1)))
    np.testing.assert_allclose(
        servo_setpoints(late, movements, STEP_S)[:, 50:], sent[:, :-50], atol=1e-9
    )
    expected = expected_movements(late, movements, STEP_S).positions
    np.testing.assert_allclose(expected[:, 50:], movements.positions[:, :-50], atol=1e-9)


def test_a_late_arm_throws_late_and_as_far(robot, make_plan):
    """By a delay alone nothing is lost."""
    task, plan = load_task("stick_throw"), make_plan(0.54)
    late = replace(robot, drives=replace(robot.drives, delays=np.full(6, 0.1)))
    movement = task.move([plan], robot)
    on_time, delayed = (task.simulate(arm, [plan], movement, False) for arm in (robot, late))
    assert on_time.failures == delayed.failures == ("",)
    assert delayed.tracking_errors[0] < task.failure.greatest_tracking_error_rad
    np.testing.assert_allclose(delayed.outcomes, on_time.outcomes, atol=0.03)


def test_a_movement_that_is_repeated_is_one_of_many(robot, make_plan):
    """It is looked at once; what comes of it is what comes of as many that are each their own."""
    task = load_task("stick_throw")
    robot = replace(robot, drives=replace(robot.drives, delays=np.full(6, 0.02)))
    plan = make_plan(0.54)
    many = task.move([plan] * 3, robot)
    same = repeat_movement(task.move([plan], robot), 3)
    assert many.distinct is many
    assert len(same.distinct.positions) == 1
    for function in (servo_setpoints, lambda *given: expected_movements(*given).positions):
        np.testing.assert_array_equal(
            function(robot, same, STEP_S), function(robot, many, STEP_S), strict=True
        )
    for one, other in zip(
        try_movements(robot, task, [plan] * 3, same),
        try_movements(robot, task, [plan] * 3, many),
        strict=True,
    ):
        assert one.costs == other.costs
        np.testing.assert_array_equal(one.outcome, other.outcome)

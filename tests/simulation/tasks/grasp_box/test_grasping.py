"""Batches of grasps with the box in several places: what is repeated, and how it is summed up."""

from dataclasses import replace

import numpy as np

from besman.robot.kinematics import forward_kinematics
from besman.robot.model import load_robot
from besman.simulation.episodes import Episodes, Movements
from besman.simulation.tasks.grasp_box.grasping import (
    add_lifts,
    repeat_movements,
    summarize_poses,
)
from besman.simulation.tasks.kinds import load_task

TASK = load_task("grasp_box")


def movements(batch=2, steps=5, n=3):
    positions = np.arange(batch * steps * n, dtype=float).reshape(batch, steps, n)
    return Movements(positions, positions + 1, positions + 2, np.arange(1.0, batch + 1),
                     np.arange(2.0, batch + 2))  # fmt: skip


def episodes(shortfalls, failures, heights):
    n = len(shortfalls)
    outcomes = np.repeat(np.arange(float(n))[:, None], 3, axis=1)
    outcomes[:, 2] = heights
    return Episodes(
        outcomes=outcomes,
        end_poses=np.arange(7.0 * n).reshape(n, 7),
        tracking_errors=np.arange(float(n)),
        shortfalls=np.array(shortfalls, dtype=float),
        failures=tuple(failures),
        measures={"tilt_rad": np.arange(float(n))},
    )


def test_every_movement_is_repeated_beside_itself():
    repeated = repeat_movements(movements(), 3)
    np.testing.assert_array_equal(repeated.durations, [1, 1, 1, 2, 2, 2])
    np.testing.assert_array_equal(repeated.positions[3:], movements().positions[[1, 1, 1]])
    np.testing.assert_array_equal(repeated.ends, [2, 2, 2, 3, 3, 3])


def test_the_worst_place_is_the_outcome_and_the_shortfall_the_mean():
    whole = episodes([0.0, 0.4, 0.0, 0.0], ["", "slipped", "", ""], [1.0, 1.1, 1.2, 0.9])
    found = summarize_poses(whole, 2)
    assert found.failures == ("slipped", "")
    np.testing.assert_array_equal(found.outcomes[:, 2], [1.1, 0.9])
    # Held everywhere, it is where the box of the first place is.
    np.testing.assert_array_equal(found.outcomes[:, :2], whole.outcomes[[1, 2], :2])
    # A failure counts half at least: (0 + (1 + 0.4) / 2) / 2.
    np.testing.assert_allclose(found.shortfalls, [0.35, 0.0])
    np.testing.assert_array_equal(found.measures["tilt_rad"], [1.0, 3.0])
    np.testing.assert_array_equal(found.end_poses, whole.end_poses[[1, 3]])
    assert summarize_poses(whole, 1) is whole


def test_an_arm_rests_then_lifts_straight_up():
    robot = load_robot("iiwa7", "gripper3")
    step = TASK.simulation.time_step_s
    n = int(0.2 / step)
    still = np.tile(robot.home, (1, n, 1))
    zero = np.zeros_like(still)
    approach = Movements(still, zero, zero, np.array([0.1]))
    lifted = add_lifts(robot, TASK, approach)
    lift = TASK.lift
    least_s = 0.1 + lift.pause_s + lift.closing_s + lift.lift_s + lift.hold_s
    assert lifted.ends[0] >= least_s - 1e-9
    before = int((0.1 + lift.pause_s + lift.closing_s) / step)
    np.testing.assert_array_equal(lifted.positions[0, :before], still[0, :1].repeat(before, 0))
    first, last = forward_kinematics(robot.chain, lifted.positions[0, [0, -1]])
    np.testing.assert_allclose(last[:3, 3] - first[:3, 3], [0, 0, lift.height_m], atol=1e-3)
    np.testing.assert_allclose(last[:3, :3], first[:3, :3], atol=1e-3)
    # Positions, velocities and accelerations are of one movement.
    speeds = np.diff(lifted.positions[0], axis=0) / step
    middle = 0.5 * (lifted.velocities[0, 1:] + lifted.velocities[0, :-1])
    np.testing.assert_allclose(speeds, middle, atol=0.02)
    far = replace(approach, positions=np.tile(np.zeros(robot.n), (1, n, 1)))
    assert np.isnan(add_lifts(robot, TASK, far).ends).all()

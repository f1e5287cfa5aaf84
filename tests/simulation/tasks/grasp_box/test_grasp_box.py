from dataclasses import replace

import mujoco
import numpy as np
import pytest
from contact_motions import slanted_approach_of

from besman.robot.kinematics import forward_kinematics
from besman.robot.limits import check_limits
from besman.robot.model import load_robot
from besman.simulation.episodes import Movements
from besman.simulation.perturbed_trials import lenient_task
from besman.simulation.tasks.grasp_box.grasp_scene import grasp_model
from besman.simulation.tasks.grasp_box.gripper import GripperConfig, finger_controls
from besman.simulation.tasks.grasp_box.lift import move_along, plan_lift
from besman.simulation.tasks.kinds import load_task
from besman.simulation.trial import try_plans

TASK = load_task("grasp_box")


def changed(spread=0.0, **sections):
    sections["box"] = {"spread_m": spread, **sections.get("box", {})}
    parts = {
        name: getattr(TASK, name).model_copy(update=values) for name, values in sections.items()
    }
    return TASK.model_copy(update=parts)


def grasp(robot, plan, task):
    (trial,) = try_plans(robot, task, [task.place(plan, robot)], paths=True)
    return trial


def test_a_box_is_approached_gripped_and_lifted(grasper, approach):
    trial = grasp(grasper, approach, changed())
    assert trial.failure == ""
    assert trial.success
    assert trial.miss < 0.01
    assert trial.measures["contact_finger"] == 0
    rise = trial.object_path[:, 2] - trial.object_path[0, 2]
    assert np.abs(rise[:300]).max() < 1e-3
    assert rise[-1] == pytest.approx(TASK.lift.height_m, abs=0.01)
    assert trial.reward == -sum(trial.costs.values())


def test_a_hand_that_came_from_the_side_comes_straight_and_holds_the_box(grasper):
    """As it was shown a finger meets the box on the way; brought it succeeds at five places."""
    shown = TASK.place(slanted_approach_of(grasper), grasper)
    brought = TASK.search_start(shown, grasper)
    assert TASK.search_start(brought, grasper) is brought
    np.testing.assert_array_equal(brought.goal_pose, shown.goal_pose)
    before, after = try_plans(grasper, lenient_task(TASK), [shown, brought])
    assert before.failure in ("box not gripped", "box dropped", "collision with the shelf")
    assert after.success
    approach = TASK.approach.model_copy(update={"square": False})
    as_shown = TASK.model_copy(update={"approach": approach})
    assert as_shown.search_start(shown, grasper) is shown


def test_success_is_needed_wherever_the_box_is_tried(grasper, approach):
    assert grasp(grasper, approach, changed(spread=0.015)).success
    wide = grasp(grasper, approach, changed(spread=0.06))
    assert not wide.success
    assert wide.failure != ""


@pytest.mark.parametrize(("share", "held"), [(0.6, True), (1.6, False)])
def test_the_box_is_held_if_and_only_if_the_friction_cone_holds_it(grasper, approach, share, held):
    friction, force = 0.1, TASK.gripper.force_n
    mass = share * 2 * friction * force / 9.81
    task = changed(box={"mass_kg": mass}, gripper={"friction": friction}, lift={"lift_s": 2.0})
    trial = grasp(grasper, approach, task)
    assert trial.success == held
    assert trial.failure == ("" if held else trial.failure)
    if not held:
        assert trial.miss > 0.5 * TASK.lift.height_m


@pytest.mark.parametrize(
    ("sections", "failure"),
    [
        ({"box": {"shift_m": (0.0, 0.2)}}, "box not gripped"),
        ({"lift": {"height_m": 1.5}}, "lift out of reach"),
        ({"gripper": {"friction": 0.005}}, "box dropped"),
        ({"box": {"size_m": (0.08, 0.1, 0.004)}}, "collision with the shelf"),
    ],
)
def test_failures_are_outcomes(grasper, approach, sections, failure):
    trial = grasp(grasper, approach, changed(**sections))
    assert trial.failure == failure
    assert not trial.success
    assert trial.reward <= -TASK.reward.failure


def test_an_arm_without_the_strength_does_not_follow(grasper, approach):
    trial = grasp(
        grasper, replace(approach, duration=0.08), changed(box={"place_m": (0.8, 3.0, 1.0)})
    )
    assert trial.failure == "arm did not follow"


def test_a_tilted_box_is_no_success(grasper, approach):
    trial = grasp(grasper, approach, changed(success={"success_tilt_deg": 1e-4}))
    assert trial.failure == ""
    assert not trial.success


def test_a_movement_that_is_no_number_is_one_failed_episode(grasper, approach):
    task = changed()
    plan = task.place(approach, grasper)
    movements = task.move([plan, plan], grasper)
    wild = movements.positions.copy()
    wild[0, 100:] = np.nan
    broken = Movements(
        wild,
        movements.velocities,
        movements.accelerations,
        movements.durations,
        movements.ends,
    )
    episodes = task.simulate(grasper, [plan, plan], broken, False)
    assert episodes.failures == ("unstable simulation", "")


def test_neither_company_nor_threads_change_a_result(grasper, approach):
    task = changed(spread=0.02)
    plans = [
        replace(task.place(approach, grasper), duration=duration) for duration in (1.4, 1.6, 2.2)
    ]
    alone = [try_plans(grasper, task, [plan])[0] for plan in plans]
    for jobs in (1, 2):
        for one, other in zip(alone, try_plans(grasper, task, plans, jobs), strict=True):
            assert one.reward == other.reward
            np.testing.assert_array_equal(one.outcome, other.outcome)


def test_motions_of_other_scenes_can_be_tried_together(grasper, approach):
    task = changed()
    here = task.place(approach, grasper)
    pose = here.goal_pose + np.array([0.0, 0.25, 0, 0, 0, 0, 0])
    there = task.place(replace(approach, goal_pose=pose), grasper)
    near, far = try_plans(grasper, task, [here, there])
    assert near.success
    assert far.failure == "box not gripped"


def test_the_box_stands_on_its_shelf(grasper, approach):
    task = changed(box={"shift_m": (-0.02, 0.0)})
    plan = task.place(approach, grasper)
    model = grasp_model(grasper, task, task.scene(plan, grasper))
    data = mujoco.MjData(model)
    data.qpos[: grasper.n] = approach.start
    first = grasper.n + 3
    data.qpos[first:] = task._box_poses(plan)[0]
    before = data.qpos[first:].copy()
    data.ctrl[: grasper.n] = approach.start
    for _ in range(500):
        mujoco.mj_step(model, data)
    np.testing.assert_allclose(data.qpos[first : first + 3], before[:3], atol=1e-3)


def test_a_place_in_the_task_counts_more_than_the_demonstration(grasper, approach):
    task = changed(box={"place_m": (0.8, -0.2, 1.0), "turn_deg": 30.0, "shift_m": (0.01, 0.02)})
    target = task.place(approach, grasper).target
    np.testing.assert_allclose(target, [0.81, -0.18, 1.12], atol=1e-3)


def test_the_lift_is_straight_up_within_the_limits(grasper, approach):
    path, duration = plan_lift(grasper, approach.goal, 0.1, 0.05)
    assert duration > 0.05
    time = np.linspace(0, duration, 401)
    q, v, a = move_along(path, duration, time)
    report = check_limits(grasper, q, v, a)
    assert (report.velocity, report.acceleration) == (0, 0)
    poses = forward_kinematics(grasper.chain, q)
    rise = poses[:, :3, 3] - poses[0, :3, 3]
    np.testing.assert_allclose(rise[:, :2], 0, atol=1e-3)
    assert rise[-1, 2] == pytest.approx(0.1, abs=1e-3)
    np.testing.assert_allclose(poses[:, :3, :3], np.tile(poses[0, :3, :3], (401, 1, 1)), atol=3e-3)
    np.testing.assert_allclose(np.gradient(q, time, axis=0)[1:-1], v[1:-1], atol=2e-2)
    np.testing.assert_allclose(np.gradient(v, time, axis=0)[2:-2], a[2:-2], atol=0.5)
    assert plan_lift(grasper, approach.goal, 2.0, 0.5) is None


def test_fingers_close_at_their_speed():
    gripper = GripperConfig()
    controls = finger_controls(gripper, np.array([-1.0, 0.0, 0.1, 10.0]))
    assert controls.shape == (4, 3)
    np.testing.assert_allclose(controls[:, 0], [0, 0, 0.011, 0.0775])


@pytest.mark.parametrize("name", ["ur5", "ur10"])
def test_other_arms_carry_the_gripper(name):
    robot = load_robot(name, "gripper3")
    model = grasp_model(robot, TASK, (0.8, 0.0, 1.0, 0.0))
    assert (model.nu, model.nq) == (robot.n + 3, robot.n + 3 + 7)

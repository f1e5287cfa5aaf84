from dataclasses import replace

import numpy as np
import pytest

from besman.config.stage import Work
from besman.exceptions import RefinementError
from besman.robot.kinematics import forward_kinematics
from besman.robot.limits import LimitReport, check_limits
from besman.robot.model import load_robot
from besman.robot.mujoco_model import matrix_to_quaternion
from besman.simulation.perturbed_trials import finer_task
from besman.simulation.tasks.kinds import load_task
from besman.simulation.trial import try_plans
from besman.stages.refine.choice import nearest_plans
from besman.stages.refine.figures import refine_results
from besman.stages.refine.stage import CmaEsConfig

THROW, REACH = load_task("stick_throw"), load_task("reach")


@pytest.fixture(scope="module")
def plans(robot, make_plan):
    """Two throws whose targets are a hand's breadth away from where they land."""
    plans = [make_plan(0.54, name="a"), make_plan(0.6, name="b")]
    trials = try_plans(robot, THROW, plans)
    offsets = ([-0.15, 0.1, 0], [0.1, -0.1, 0])
    return tuple(
        replace(plan, target=trial.outcome + offset)
        for plan, trial, offset in zip(plans, trials, offsets, strict=True)
    )


@pytest.fixture(scope="module")
def motions(robot, plans):
    return CmaEsConfig(episodes=150).run(plans, robot, THROW)


def test_throws_land_on_their_targets(robot, plans, motions):
    for plan, motion in zip(plans, motions, strict=True):
        assert motion.success
        assert motion.miss <= 0.05
        assert motion.miss == pytest.approx(np.linalg.norm(motion.outcome - plan.target))
        assert motion.misses[0] == motion.miss_before
        assert motion.miss == pytest.approx(np.nanmin(motion.misses))
        np.testing.assert_allclose(motion.object_path[-1], motion.outcome, atol=1e-9)
        report = check_limits(robot, motion.positions, motion.velocities, motion.accelerations)
        assert report.violations == report.self_collisions == 0
        np.testing.assert_allclose(np.diff(motion.time), 1e-3)
        assert motion.time[-1] >= motion.plan.duration
        tool = forward_kinematics(robot.chain, motion.positions)[:, :3, 3]
        np.testing.assert_array_equal(motion.tool_path, tool)


def test_the_best_plan_does_again_what_it_did(robot, motions):
    for motion in motions:
        (trial,) = try_plans(robot, THROW, [motion.plan])
        np.testing.assert_array_equal(trial.outcome, motion.outcome)


def test_neither_threads_nor_company_change_a_result(robot, plans):
    config = CmaEsConfig(episodes=20)
    shares = []
    both = config.run(plans, robot, THROW)
    threaded = config.run(plans, robot, THROW, Work(jobs=3, progress=shares.append))
    (alone,) = config.run(plans[1:], robot, THROW)
    for first, second in ((threaded[0], both[0]), (threaded[1], both[1]), (alone, both[1])):
        np.testing.assert_array_equal(first.returns, second.returns)
        np.testing.assert_array_equal(first.positions, second.positions)
        np.testing.assert_array_equal(first.object_path, second.object_path)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_a_success_beyond_a_limit_is_none(robot, make_plan, monkeypatch):
    # A search that misses a violation between the samples it looks at.
    monkeypatch.setattr("besman.simulation.trial._CLEARANCE_M", -1.0)
    monkeypatch.setattr(
        "besman.stages.refine.motion_search.check_limits",
        lambda *_: LimitReport(1, 0, 0, 0, 1, 0.0, 0.5, 0.5, -0.001),
    )
    plan = make_plan(0.54)
    (trial,) = try_plans(robot, THROW, [plan])
    (motion,) = CmaEsConfig(episodes=1).run((replace(plan, target=trial.outcome),), robot, THROW)
    assert not motion.success
    assert motion.failure == "limit exceeded"
    assert motion.returns[0] == -THROW.reward.failure


def test_a_success_holds_at_a_quarter_of_the_time_step(robot, motions):
    fine = try_plans(robot, finer_task(THROW), [motion.plan for motion in motions])
    assert all(trial.success for trial in fine)


def test_a_success_of_the_usual_time_step_alone_is_none(robot, make_plan, monkeypatch):
    # A finer simulation in which the target is missed, though by little.
    radius = THROW.success.model_copy(update={"success_radius_m": 1e-9})
    exact = THROW.model_copy(update={"success": radius})
    monkeypatch.setattr(
        "besman.simulation.perturbed_trials.finer_task", lambda _: finer_task(exact)
    )
    plan = make_plan(0.54)
    usual, fine = (try_plans(robot, one, [plan])[0] for one in (THROW, finer_task(THROW)))
    (motion,) = CmaEsConfig(episodes=1).run((replace(plan, target=usual.outcome),), robot, THROW)
    assert not motion.success
    assert motion.miss == pytest.approx(np.linalg.norm(fine.outcome - usual.outcome))
    assert motion.miss > 0


def test_the_seed_matters(robot, plans, motions):
    (other,) = CmaEsConfig(episodes=20, seed=1).run(plans[:1], robot, THROW)
    assert other.returns[0] == motions[0].returns[0]
    assert not (other.returns[1:5] == motions[0].returns[1:5]).any()


@pytest.mark.parametrize("episodes", [1, 3, 30])
def test_the_budget_is_kept(robot, plans, episodes):
    far = replace(plans[0], target=np.array([5.0, 0, 0]))
    (motion,) = CmaEsConfig(episodes=episodes).run((far,), robot, THROW)
    assert len(motion.returns) == len(motion.misses) == episodes
    assert not motion.success
    assert motion.miss <= motion.miss_before


def test_an_imitation_that_fails_says_why(robot, make_plan):
    (motion,) = CmaEsConfig(episodes=1).run((make_plan(4.0),), robot, THROW)
    assert motion.failure == "stick not released"
    assert np.isnan(motion.miss_before)
    assert np.isnan(motion.outcome_before).all()
    assert refine_results((motion,), THROW)["miss_m"] == {"median": None, "max": None}


def test_reaching_corrects_position_and_orientation(make_plan):
    robot = load_robot("ur5", "gripper")
    plan = make_plan(1.5)
    offset = np.array([0.03, -0.02, 0.02, 0.05, -0.05, 0.05])
    pose = forward_kinematics(robot.chain, plan.goal + offset)
    wanted = np.concatenate([pose[:3, 3], matrix_to_quaternion(np.ascontiguousarray(pose[:3, :3]))])
    (motion,) = CmaEsConfig(episodes=400, search=("goal",)).run(
        (replace(plan, goal_pose=wanted, target=np.full(3, np.nan)),), robot, REACH
    )
    assert motion.miss_before > 0.01
    assert motion.success
    assert motion.miss <= 0.01
    assert np.degrees(motion.orientation_error) <= 5
    assert motion.object_path.shape == (0, 3)


def test_results(motions):
    results = refine_results(motions, THROW)
    assert results["n_motions"] == results["n_success"] == 2
    assert results["n_failed_before"] == 0
    assert results["success_radius_m"] == 0.05
    assert results["miss_m"]["max"] == max(motion.miss for motion in motions)
    assert results["episodes"]["median"] == np.median([len(m.returns) for m in motions])


def test_of_many_motions_those_are_refined_that_land_nearest(robot, plans):
    trials = try_plans(robot, THROW, plans)
    assert trials[1].miss < trials[0].miss
    never = replace(plans[0], target=plans[0].target + np.array([9.0, 0, 0]), name="c")
    (motion,) = CmaEsConfig(episodes=1, motions=1).run((never, *plans), robot, THROW)
    assert motion.plan.name == "b"
    found = nearest_plans((never, *plans), robot, THROW, 2)
    assert [plan.name for plan in found] == ["a", "b"]
    assert nearest_plans(plans, robot, THROW, 2) == plans


def test_what_does_not_belong_together_is_refused(robot, make_plan):
    config, plan = CmaEsConfig(), make_plan()
    with pytest.raises(RefinementError, match="robot ur5 carries tool 'stick_holder', expected 'g"):
        config.run((plan,), robot, REACH)
    with pytest.raises(RefinementError, match="a: plan for joints x, y"):
        config.run((replace(plan, joint_names=("x", "y")),), robot, THROW)
    with pytest.raises(RefinementError, match="a: task stick_throw needs a target on the floor"):
        config.run((replace(plan, target=np.full(3, np.nan)),), robot, THROW)


def test_a_search_depends_on_what_a_motion_is_not_on_its_name(robot, make_plan):
    config = CmaEsConfig(episodes=17)
    plan = make_plan(0.54, name="a.tsv:3", target=(5.0, 0.0, 0.0))
    renamed = replace(plan, name="renamed.c3d:8")
    # What another machine's arithmetic makes of the same.
    close = replace(plan, duration=plan.duration * (1 + 1e-12))
    other = replace(plan, target=plan.target + 0.01)
    one, two, three, four = config.run((plan, renamed, close, other), robot, THROW)
    np.testing.assert_array_equal(two.returns, one.returns)
    np.testing.assert_array_equal(two.positions, one.positions)
    np.testing.assert_allclose(three.returns, one.returns, rtol=1e-6)
    # The same imitation, and then another draw.
    assert not np.allclose(four.outcomes[1:], one.outcomes[1:], atol=1e-3, equal_nan=True)

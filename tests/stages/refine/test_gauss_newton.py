"""Throws refined by Gauss-Newton: few episodes, the same whatever the threads, resumed."""

from dataclasses import replace

import numpy as np
import pytest

from besman.simulation.perturbation import Spreads, draw_two_level
from besman.simulation.tasks.kinds import load_task
from besman.simulation.trial import try_plans
from besman.stages.refine import motion_search
from besman.stages.refine.class_lesson import ClassLesson, Slopes
from besman.stages.refine.class_model import (
    ClassModel,
    load_class,
    measure_all_at_once,
    measure_jacobian,
    moves_too_little,
)
from besman.stages.refine.figures import refine_results
from besman.stages.refine.gauss_newton import GaussNewtonConfig, RobustConfig
from besman.work.work import Work

THROW = load_task("stick_throw")


def config_of(**keys):
    return GaussNewtonConfig(method="gauss_newton", robustness=None, **keys)


ALONE = config_of(robust=None)


@pytest.fixture(scope="module")
def plans(robot, make_plan):
    plans = [make_plan(duration, name=name) for duration, name in ((0.54, "a"), (0.57, "b"))]
    trials = try_plans(robot, THROW, plans)
    offsets = ([-0.15, 0.1, 0], [-0.1, 0.05, 0])
    return tuple(
        replace(plan, target=trial.outcome + offset)
        for plan, trial, offset in zip(plans, trials, offsets, strict=True)
    )


@pytest.fixture(scope="module")
def motions(robot, plans):
    return ALONE.run(plans, robot, THROW)


def assert_same(some, others):
    for one, other in zip(some, others, strict=True):
        np.testing.assert_array_equal(one.returns, other.returns)
        np.testing.assert_array_equal(one.positions, other.positions)
        np.testing.assert_array_equal(one.simulations, other.simulations)
        assert one.shared_simulations == other.shared_simulations


def test_throws_hit_in_a_handful_of_episodes(motions):
    for motion in motions:
        assert motion.success
        assert len(motion.returns) <= 12
        assert motion.handed_over == ""
    figures = refine_results(motions, THROW)
    # The imitation, goal of six joints and duration, and the middle motion's own search.
    assert 1 + 8 < figures["episodes_shared"] <= 1 + 8 + 12
    assert figures["handed_over"] == {}


def test_neither_threads_nor_order_change_a_result(robot, plans, motions):
    assert_same(ALONE.run(plans, robot, THROW, Work(jobs=2)), motions)
    assert_same(ALONE.run(plans[::-1], robot, THROW)[::-1], motions)


def test_an_ended_search_goes_on_with_the_same_jacobian(robot, plans, motions, tmp_path):
    ALONE.run(plans, robot, THROW, Work(checkpoints=tmp_path))
    (kept,) = tmp_path.glob("class_*.npz")
    for folder in (one for one in tmp_path.iterdir() if one.is_dir()):
        for path in sorted(folder.iterdir())[2:]:
            path.unlink()
    before = kept.read_bytes()
    assert_same(ALONE.run(plans, robot, THROW, Work(checkpoints=tmp_path)), motions)
    assert kept.read_bytes() == before
    kept.write_bytes(before[: len(before) // 2])
    assert load_class(tmp_path, kept.stem) is None
    assert_same(ALONE.run(plans, robot, THROW, Work(checkpoints=tmp_path)), motions)


def test_another_posture_needs_no_jacobian_of_its_own(robot, plans):
    """The same throw with the wrist turned over: only the joint between has another sign."""
    signs, turn = np.array([1.0, 1, 1, 1, -1, 1]), np.array([0, 0, 0, np.pi, 0, -np.pi])
    plan = plans[0]
    turned = replace(
        plan,
        start=signs * plan.start + turn,
        goal=signs * plan.goal + turn,
        weights=signs[:, None] * plan.weights,
    )
    measured = ClassLesson(ALONE, (plan,), robot, THROW, None).measure(Work())
    carried = Slopes(plan, measured)
    found = ClassLesson(ALONE, (turned,), robot, THROW, None, carried).measure(Work())
    assert (measured.simulations, found.simulations) == (1 + 8, 1)
    moving = ALONE.space(plan, robot).coordinates(("goal", "duration"))
    wanted = measured.jacobian[0][:, moving] * np.append(signs, 1.0)
    off = np.linalg.norm(found.jacobian[0][:, moving] - wanted)
    assert off < 0.2 * np.linalg.norm(wanted)
    # One alone has no others that would begin where it ends.
    assert ClassLesson(ALONE, (plan,), robot, THROW, None).aim(measured, Work()) is measured


def test_a_robust_search_is_told_of_all_models_and_counts_them(robot, plans):
    few = config_of(robust=RobustConfig(models=2), measure=("goal",), episodes=40)
    motions = few.run(plans, robot, THROW)
    for motion in motions:
        assert motion.success
        assert set(motion.simulations.tolist()) == {1, 3}
        assert motion.simulations.sum() <= 40
    assert sum(motion.shared_simulations > 0 for motion in motions) == 1


def test_what_the_jacobian_costs_must_be_within_the_budget(robot, plans):
    motions = config_of(robust=None, episodes=4).run(plans, robot, THROW)
    reasons = set(refine_results(motions, THROW)["handed_over"].values())
    assert reasons == {"a Jacobian takes 8 episodes, all motions may take 8"}
    for motion in motions:
        assert len(motion.returns) == 4


def test_a_task_that_succeeds_or_not_is_left_to_cma_es(robot, plans, monkeypatch):
    monkeypatch.setattr(type(THROW), "residual", lambda *_: np.empty(0))
    (motion,) = config_of(robust=None, episodes=30).run(plans[:1], robot, THROW)
    assert motion.handed_over == "stick_throw has no outcome to take steps on"
    assert len(motion.returns) > 1


def test_a_motion_of_which_nothing_comes_is_said(robot, make_plan):
    still = make_plan(2.5, target=np.array([5.0, 0, 0]))
    (motion,) = config_of(robust=None, episodes=12).run((still,), robot, THROW)
    assert motion.handed_over == f"nothing comes of {still.name}"
    assert not motion.success


@pytest.mark.parametrize("robust", [None, RobustConfig(models=2)])
def test_steps_that_end_with_what_fails_the_finer_step_are_handed_over(
    robot, plans, monkeypatch, robust, tmp_path
):
    """All success is that of a coarse simulation here: no budget may be left untried."""
    failed = replace(try_plans(robot, THROW, plans[:1])[0], success=False, failure="finer")
    monkeypatch.setattr(motion_search, "try_finely", lambda *given: [failed] * len(given[-1]))
    config = config_of(robust=robust, measure=("goal",), episodes=70, population=4)
    (motion,) = config.run(plans[:1], robot, THROW, Work(checkpoints=tmp_path))
    assert not motion.success
    assert motion.handed_over
    # What has been tried already is tried again to the same end.
    assert_same(config.run(plans[:1], robot, THROW, Work(checkpoints=tmp_path)), [motion])


def test_a_jacobian_that_cannot_reach_the_target_is_of_no_use():
    slopes = np.outer([1.0, 2.0], [1.0, 0.5, 0.0])[None]
    assert moves_too_little(slopes) == "the outcome's Jacobian is of rank 1, expected 2"
    assert moves_too_little(np.zeros((3, 2, 4))) == (
        "the outcome's Jacobian is of rank 0, expected 2"
    )
    assert moves_too_little(np.eye(2)[None]) == ""


def test_a_jacobian_is_measured_from_the_side_that_has_an_outcome():
    slope = np.arange(6.0).reshape(2, 3)

    def evaluate(point, in_worlds):
        gone = np.nan if point[0] > 0.1 or abs(point[2]) > 0.1 else 0.0
        return (slope @ point + gone)[None]

    found, trust = measure_jacobian(evaluate, np.zeros(3), [0, 1, 2], 0.5, 0.5)
    np.testing.assert_array_equal(trust, 1.0)
    np.testing.assert_allclose(found[0, :, :2], slope[:, :2])
    np.testing.assert_array_equal(found[0, :, 2], 0.0)
    few, _ = measure_jacobian(evaluate, np.zeros(3), [1], 0.5, 0.5, work=Work(jobs=2))
    np.testing.assert_array_equal(few[0, :, [0, 2]], 0.0)


def test_a_coordinate_at_its_floor_is_measured_from_above():
    slope = np.arange(6.0).reshape(2, 3)
    floor = np.array([-np.inf, 0.0, -0.1])

    def evaluate(point, in_worlds):
        return (slope @ np.maximum(point, floor))[None]

    found, trust = measure_jacobian(evaluate, np.zeros(3), [0, 1, 2], 1.5, 0.8, floor)
    np.testing.assert_array_equal(trust, 1.0)
    np.testing.assert_allclose(found[0], slope)
    tried = []

    def noted(point, in_worlds):
        tried.append(point)
        return evaluate(point, in_worlds)

    at_once = measure_all_at_once(noted, np.zeros(3), [0, 1, 2], 0.8, floor)
    np.testing.assert_allclose(at_once[0], slope, rtol=5e-3, atol=1e-9)
    assert len(tried) == 4
    assert (np.array(tried) >= np.maximum(floor, -0.8)).all()
    few = measure_all_at_once(evaluate, np.ones(3), [2], 0.8, floor)
    np.testing.assert_array_equal(few[0, :, :2], 0.0)
    np.testing.assert_allclose(few[0, :, 2], slope[:, 2], rtol=5e-3)


def test_a_coordinate_with_a_kink_is_trusted_less():
    """The slopes of |x| are opposite on its sides; those of a line are the same."""

    def evaluate(point, in_worlds):
        first = [2.0 * point[0] + 3.0 * abs(point[1]), point[0] + abs(point[1]) + point[2]]
        second = [5.0 * point[0], 0.0]
        return np.array([first, second] if in_worlds else [first])

    found, trust = measure_jacobian(evaluate, np.zeros(3), [0, 1, 2], 1.5, 0.8)
    np.testing.assert_allclose(trust, [1.0, 1.0 / np.sqrt(1.0 + 4.0 * 10.0), 1.0])
    # It aims as if there were no slope along it; how far the worlds are apart stays.
    np.testing.assert_allclose(found[0], [[2.0, 0.0, 0.0], [1.0, 0.0, 1.0]], atol=1e-12)
    apart = [[3.0, -3.0, 0.0], [-1.0, -1.0, -1.0]]
    np.testing.assert_allclose(found[1] - found[0], apart, atol=1e-12)


def test_a_class_is_what_it_was_after_it_is_stored(tmp_path):
    from besman.stages.refine.class_model import keep_class

    model = ClassModel("a", np.ones(3), np.ones((2, 2, 3)), np.full(3, 0.5), 7)
    keep_class(tmp_path, "class_x", model)
    again = load_class(tmp_path, "class_x")
    np.testing.assert_array_equal(again.jacobian, model.jacobian)
    np.testing.assert_array_equal(again.trust, model.trust)
    assert (again.name, again.simulations, again.useless) == ("a", 7, "")
    keep_class(tmp_path / "gone", "class_x", model)
    assert load_class(tmp_path / "gone", "class_x") is None
    assert load_class(None, "class_x") is None


@pytest.mark.parametrize("n", [4, 8, 16])
def test_balanced_models_tell_variances_apart(robot, n):
    """The mean is the middle, and friction and every joint's delay vary independently."""
    spreads = Spreads()
    drawn = draw_two_level(spreads, robot, (3,), n)
    columns = np.array([[one.friction - 1.0, *one.delays] for one in drawn])
    columns[:, 1:] -= 0.5 * spreads.delay_s
    columns /= np.array([spreads.friction_share] + [0.5 * spreads.delay_s] * robot.n)
    np.testing.assert_allclose(columns.mean(axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose((columns**2).mean(axis=0), 1.0 / 3.0)
    products = columns.T @ columns / n
    if n > robot.n + 1:
        np.testing.assert_allclose(products, np.eye(robot.n + 1) / 3.0, atol=1e-12)
    masses = np.array([one.object_mass for one in drawn])
    assert set(np.round(masses, 9)) == set(np.round(1.0 + np.array([-1, 1]) * 0.2 / 3**0.5, 9))
    other = draw_two_level(spreads, robot, (4,), n)
    assert any(one.friction != two.friction for one, two in zip(drawn, other, strict=True)) or any(
        (one.delays != two.delays).any() for one, two in zip(drawn, other, strict=True)
    )

from dataclasses import replace

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from besman.exceptions import RefinementError
from besman.search.kinds import SEARCH_NAMES
from besman.simulation.tasks.kinds import load_task
from besman.simulation.trial import try_plans
from besman.stages.refine.methods import RefineStage
from besman.stages.refine.stage import CmaEsConfig
from besman.work.work import Work

THROW = load_task("stick_throw")
parse = TypeAdapter(RefineStage).validate_python


@pytest.fixture(scope="module")
def plan(robot, make_plan):
    """A throw whose target is a hand's breadth away from where it lands."""
    plan = make_plan(0.54, name="a")
    (trial,) = try_plans(robot, THROW, [plan])
    return replace(plan, target=trial.outcome + np.array([-0.15, 0.1, 0]))


def test_cma_es_is_the_default():
    assert parse({}) == CmaEsConfig() == parse({"method": "cma_es"})
    assert parse({"episodes": 5}) == CmaEsConfig(episodes=5)


def test_what_a_method_does_not_know_is_refused():
    with pytest.raises(ValidationError, match="does not match any of the expected tags: 'cma_es'"):
        parse({"method": "nes"})
    with pytest.raises(ValidationError, match="epsilon"):
        parse({"method": "cem", "epsilon": 1.0})


@pytest.mark.parametrize("method", SEARCH_NAMES)
def test_every_method_asks_for_its_population_and_respects_its_bound(method):
    config = parse({"method": method, "population": 12, "sigma": 0.4, "bound": 0.5})
    one, two, other = (config.make_search(30, seed) for seed in [(0, 1), (0, 1), (0, 2)])
    points = one.ask()
    assert points.shape == (12, 30)
    assert np.abs(points).max() <= 0.5
    np.testing.assert_array_equal(points, two.ask())
    assert not np.array_equal(points, other.ask())


@pytest.mark.slow
@pytest.mark.parametrize("method", SEARCH_NAMES)
def test_every_method_makes_the_throw_hit(robot, plan, method):
    (motion,) = parse({"method": method, "episodes": 300}).run((plan,), robot, THROW)
    assert motion.success
    assert motion.miss < motion.miss_before


def test_restarts_are_an_option():
    search = parse({"restarts": "ipop", "population": 4}).make_search(2, (0,))
    for _ in range(400):
        points = search.ask()
        search.tell(points, -np.sum(points**2, axis=1))
        if len(points) > 4:
            break
    assert len(points) == 8
    assert not search.exhausted


def pool_plans(robot, make_plan):
    plans = [make_plan(duration, name=name) for name, duration in (("a", 0.54), ("b", 0.6))]
    trials = try_plans(robot, THROW, plans)
    plans = [
        replace(plan, target=trial.outcome + np.array(offset))
        for plan, trial, offset in zip(
            plans, trials, ([-0.15, 0.1, 0], [0.1, -0.1, 0]), strict=True
        )
    ]
    far = replace(make_plan(0.57, name="c"), target=plans[0].target + np.array([0.01, 0, 0]))
    return (*plans, far)


@pytest.mark.slow
def test_a_pool_shares_a_target_and_the_best_wins(robot, make_plan):
    plans = pool_plans(robot, make_plan)
    config = CmaEsConfig(episodes=150, pool=True)
    shares = []
    (won,) = config.run(plans, robot, THROW, Work(progress=shares.append))
    assert won.success
    targets = np.stack([plan.target for plan in plans])
    middle = targets[np.linalg.norm(targets[:, None] - targets, axis=2).sum(axis=1).argmin()]
    np.testing.assert_array_equal(won.plan.target, middle)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    # Each is what it would be alone; none that is alone succeeds in fewer generations.
    alone = CmaEsConfig(episodes=150).run(
        tuple(replace(plan, target=middle) for plan in plans), robot, THROW
    )
    assert len(won.returns) == min(len(motion.returns) for motion in alone if motion.success)
    same = next(motion for motion in alone if motion.plan.name == won.plan.name)
    np.testing.assert_array_equal(won.positions, same.positions)
    few = CmaEsConfig(episodes=20, pool=True)
    (one,), (threaded,) = (few.run(plans, robot, THROW, Work(jobs=jobs)) for jobs in (1, 2))
    np.testing.assert_array_equal(one.positions, threaded.positions)


def test_a_pool_without_success_gives_the_best(robot, make_plan):
    plans = pool_plans(robot, make_plan)
    far = tuple(replace(plan, target=np.array([5.0, 0, 0])) for plan in plans)
    (best,) = CmaEsConfig(episodes=9, pool=True).run(far, robot, THROW)
    assert not best.success
    alone = CmaEsConfig(episodes=9).run(far, robot, THROW)
    assert best.returns.max() == max(motion.returns.max() for motion in alone)


def test_a_pool_refuses_what_does_not_belong_to_the_task(robot, make_plan):
    plan = replace(make_plan(), target=np.full(3, np.nan))
    with pytest.raises(RefinementError, match="a: task stick_throw needs a target on the floor"):
        CmaEsConfig(pool=True).run((plan,), robot, THROW)

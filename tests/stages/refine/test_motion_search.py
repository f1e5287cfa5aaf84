"""The search for one motion over made-up episodes: what counts as best, and when to end."""

from dataclasses import replace

import numpy as np
import pytest

from besman.simulation.tasks.kinds import load_task
from besman.simulation.trial import try_plans
from besman.stages.refine import motion_search
from besman.stages.refine.motion_search import MotionSearch
from besman.stages.refine.outcomes import succeeds

THROW = load_task("stick_throw")


class Space:
    """One coordinate: how much slower than the imitation."""

    dimension = 1

    def __init__(self, plan):
        self.plan = plan

    def plan_at(self, point):
        return replace(self.plan, duration=self.plan.duration * (1 + float(point[0])))


class Asker:
    """Asks for three points a generation, and notes what it is told."""

    exhausted = False

    def __init__(self):
        self.asked, self.told = 0, []

    def ask(self):
        self.asked += 1
        return 0.1 * self.asked + np.array([[0.0], [0.01], [0.02]])

    def tell(self, points, returns):
        self.told.append((points, returns))


@pytest.fixture
def trial(robot, make_plan):
    (one,) = try_plans(robot, THROW, [make_plan()])
    return replace(one, success=False, miss=1.0, reward=-1.0)


@pytest.fixture
def search(robot, make_plan, monkeypatch):
    # A success at a quarter of the time step is what it was before, and all limits are kept.
    monkeypatch.setattr(MotionSearch, "_verify", lambda self, plan, trial: trial)
    monkeypatch.setattr(motion_search, "try_finely", lambda robot, task, plans: [])
    return MotionSearch(Space(make_plan()), Asker(), robot, THROW, 8)


def learn(search, trial, rewards):
    assert len(search.propose()) == len(rewards)
    return search.learn([replace(trial, reward=reward) for reward in rewards])


def test_first_comes_the_imitation_and_the_search_is_not_told_of_it(search, trial, make_plan):
    assert not search.done
    (plan,) = search.propose()
    assert plan.duration == make_plan().duration
    search.learn([trial])
    assert search._search.told == []
    learn(search, trial, [-3.0, -0.5, -2.0])
    points, returns = search._search.told[0]
    np.testing.assert_array_equal(returns, [-3.0, -0.5, -2.0])
    np.testing.assert_allclose(points[:, 0], [0.1, 0.11, 0.12])
    assert search.best_trial.reward == -0.5
    assert search.best_plan.duration == pytest.approx(1.11 * make_plan().duration)
    assert search.rewards.tolist() == [-1.0, -3.0, -0.5, -2.0]


def test_the_budget_cuts_the_last_generation_short(search, trial):
    learn(search, trial, [-1.0])
    learn(search, trial, [-2.0] * 3)
    learn(search, trial, [-2.0] * 3)
    assert not search.done
    learn(search, trial, [-2.0])
    assert search.done
    assert not search.won
    assert (search.n_episodes, search.n_generations) == (8, 4)
    # There is nothing to learn from the piece of a generation.
    assert len(search._search.told) == 2


def test_what_was_tried_before_is_taken_if_the_same_points_are_asked_for(search, trial, robot):
    generations = [learn(search, trial, [-1.0]), learn(search, trial, [-2.0, -0.1, -3.0])]
    again = MotionSearch(search._space, Asker(), robot, THROW, 8)
    assert again.repeat(generations)
    assert again.rewards.tolist() == search.rewards.tolist()
    other = MotionSearch(search._space, Asker(), robot, THROW, 8)
    moved = replace(generations[1], points=generations[1].points + 1.0)
    assert not other.repeat([generations[0], moved])


def test_a_success_is_better_than_any_reward_and_wins_with_room_to_spare(search, trial):
    learn(search, trial, [5.0])
    success = replace(trial, success=True, reward=-9.0, miss=0.9 * THROW.success_radius_m)
    close = replace(success, miss=0.4 * THROW.success_radius_m, reward=-8.0)
    assert succeeds(success, THROW, 1.0)
    assert not succeeds(success, THROW, 0.5)
    assert not succeeds(replace(close, success=False), THROW, 0.5)
    assert succeeds(close, THROW, 0.5)
    search._trials += [success]
    search._worlds += [()]
    search._tried += [np.array([0.5])]
    assert search.best_trial is success
    assert not search.won
    search._trials += [close]
    search._worlds += [()]
    search._tried += [np.array([0.6])]
    assert search.won
    assert search.done

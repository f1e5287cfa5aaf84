"""Throws that stall and begin again at others' ends: the same whatever the threads, resumed."""

from dataclasses import replace

import numpy as np
import pytest

from besman.search import relay
from besman.simulation.perturbed_trials import try_finely
from besman.simulation.tasks.kinds import load_task
from besman.simulation.trial import try_plans
from besman.stages.refine import search_loop
from besman.stages.refine.class_model import ClassModel
from besman.stages.refine.figures import refine_results
from besman.stages.refine.gauss_newton import GaussNewtonConfig, RobustConfig
from besman.stages.refine.second_round import End, Searched, nearest_ends
from besman.work.work import Work

THROW = load_task("stick_throw")


def config_of(**keys):
    robust = RobustConfig(models=2)
    return GaussNewtonConfig(
        method="gauss_newton",
        robustness=None,
        robust=robust,
        measure=("goal",),
        episodes=60,
        **keys,
    )


@pytest.fixture(scope="module")
def plans(robot, make_plan):
    plans = [
        make_plan(length, name=name) for length, name in ((0.54, "a"), (0.57, "b"), (0.6, "c"))
    ]
    trials = try_plans(robot, THROW, plans)
    offsets = ([-0.15, 0.1, 0], [-0.1, 0.05, 0], [-0.4, 0.3, 0])
    return tuple(
        replace(plan, target=trial.outcome + offset)
        for plan, trial, offset in zip(plans, trials, offsets, strict=True)
    )


@pytest.fixture
def impatient(monkeypatch):
    """A row of tries in the model alone is over before the farthest throw is near."""
    monkeypatch.setattr(relay, "_PATIENCE_ALONE", 2)


def assert_same(some, others):
    for one, other in zip(some, others, strict=True):
        np.testing.assert_array_equal(one.returns, other.returns)
        np.testing.assert_array_equal(one.positions, other.positions)
        np.testing.assert_array_equal(one.simulations, other.simulations)


@pytest.mark.usefixtures("impatient")
def test_a_second_round_is_the_same_for_any_threads_and_where_it_is_resumed(
    robot, plans, tmp_path, monkeypatch
):
    waited, set_up = [], GaussNewtonConfig.set_up

    def noting(self, plan, robot, task, shared=None, starts=(), waits=False):
        waited.extend([plan.name] * bool(starts))
        return set_up(self, plan, robot, task, shared, starts, waits)

    monkeypatch.setattr(GaussNewtonConfig, "set_up", noting)
    motions = config_of().run(plans, robot, THROW, Work(checkpoints=tmp_path))
    assert waited
    assert len(set(waited)) < len(plans)
    assert [motion.plan.name for motion in motions] == ["a", "b", "c"]
    again = [motion for motion in motions if motion.begins_again]
    assert {motion.plan.name for motion in again} == set(waited)
    figures = refine_results(motions, THROW)["second_round"]
    assert figures["n_motions"] == len(again)
    assert figures["n_success"] == sum(motion.success for motion in again)
    since = [sum(one.simulations.tolist()[one.begins_again :]) for one in again]
    assert figures["episodes"] == {"median": np.median(since), "max": max(since)}
    assert all(1 <= one.begins_again < len(one.returns) for one in again)
    alone = config_of(neighbours=0).run(plans, robot, THROW)
    assert not any(motion.begins_again for motion in alone)
    differ = [len(one.returns) != len(two.returns) for one, two in zip(motions, alone, strict=True)]
    assert any(differ)
    assert_same(config_of().run(plans[::-1], robot, THROW, Work(jobs=2))[::-1], motions)
    # Ended in the middle of the second round: its last generations are lost.
    longest = max(
        (one for one in tmp_path.iterdir() if one.is_dir()), key=lambda f: len([*f.iterdir()])
    )
    sorted(longest.iterdir())[-1].unlink()
    tried, advance = [], search_loop.RunningSearch.advance

    def counting(self):
        tried.append(1)
        advance(self)

    monkeypatch.setattr(search_loop.RunningSearch, "advance", counting)
    assert_same(config_of().run(plans, robot, THROW, Work(checkpoints=tmp_path)), motions)
    assert len(tried) == 1


def searched(at, name, end=None):
    shared = ClassModel(name, np.zeros(2), np.zeros((1, 2, 2)), np.ones(2), 1)
    return Searched(at, None, shared, None, end, ())


def test_a_motion_begins_at_the_ends_of_its_own_class_the_nearest_first():
    ends = [End(None, np.full((1, 2, 2), float(at))) for at in range(5)]
    names = ("x", "x", "y", "x", "x")
    others = [searched(at, name, ends[at]) for at, name in enumerate(names)]
    others[3] = replace(others[3], end=None)
    places = ([2, 0, 0], [1, 0, 0], [0, 0, 0], [0.5, 0, 0], [1, 0, 0], [0, 0, 0])
    wanted = {at: np.array(place, dtype=float) for at, place in enumerate(places)}
    found = nearest_ends(searched(5, "x"), others, wanted)
    assert [int(end.jacobian[0, 0, 0]) for end in found] == [1, 4, 0]


def test_models_of_a_plan_side_by_side_are_those_one_after_the_other(robot, plans):
    worlds = RobustConfig(models=3).draw(robot)
    some = plans[:2]
    alone, _, others = search_loop.try_in_worlds(robot, THROW, some, worlds)
    found, there, finer = search_loop.try_in_processes(robot, THROW, some, worlds, Work(jobs=2))
    expected = [*alone, *sum(others, ()), *try_finely(robot, THROW, some)]
    for one, other in zip([*found, *sum(there, ()), *finer], expected, strict=True):
        np.testing.assert_array_equal(one.outcome, other.outcome)
        assert one.reward == other.reward
    assert [len(one) for one in there] == [len(worlds)] * 2
    assert search_loop.try_in_processes(robot, THROW, some[:1], (), Work(jobs=2))[1:] == ([], [])

"""Whole tasks in three ways: what is told is what the searches have come to (synthetic)."""

import dataclasses

import numpy as np
import pytest
from whole_task import carry_box

from besman.config.resources import find_resource
from besman.evaluation.names import WHOLE_TASK_RECIPES, WHOLE_TASK_SEARCHES
from besman.evaluation.refinement import evaluate_refinement
from besman.evaluation.whole_task_problem import WholeTaskProblem, whole_task_problem
from besman.exceptions import ConfigError
from besman.pipeline.config import load_pipeline
from besman.simulation.tasks.kinds import is_whole_task, load_whole_task
from besman.simulation.tasks.rearrange.block_trials import IMPOSSIBLE

TASK = load_whole_task("rearrange")


def test_rows_are_those_of_the_three_searches(monkeypatch):
    robot, _, plan = carry_box()
    problem = whole_task_problem("rearrange", (plan,), robot, TASK, episodes=6)
    searches, search = [], WholeTaskProblem.search

    def keep(self, *arguments):
        searches.append((arguments, search(self, *arguments)))
        return searches[-1][1]

    monkeypatch.setattr(WholeTaskProblem, "search", keep)
    rows = evaluate_refinement([problem], seeds=[0])["rows"]
    assert [asked for asked, _ in searches] == [(plan, row["method"], 0) for row in rows]
    assert tuple(row["method"] for row in rows) == WHOLE_TASK_SEARCHES
    # The same seed gives the same search.
    asked, found = searches[0]
    np.testing.assert_array_equal(search(problem, *asked).rewards, found.rewards)
    for row, (_, found) in zip(rows, searches, strict=True):
        assert row["source"] == "simulation"
        assert row["success"].startswith("rearrange: within 2 cm and 10 degrees")
        assert len(found.rewards) == sum(found.episodes.values())
        # Three parts, each at worst impossible; a generation that was begun is completed.
        assert np.all(found.rewards >= 3 * IMPOSSIBLE.reward)
        assert row["final_reward"]["mean"] == found.rewards[:6].max()
        won = found.plan is not None and found.success
        if won:
            (trial,) = TASK.try_tasks([found.plan], robot, problem.frame)
            won = trial.success
            assert row["episodes"]["median"] == len(found.rewards)
        assert row["n_success"] == int(won)


def test_only_tasks_that_take_one_thing_are_compared():
    robot, _, plan = carry_box()
    still = np.zeros(robot.n)
    first = dataclasses.replace(plan.blocks[0], frame="world", thing="", goal_velocity=still)
    nothing = dataclasses.replace(plan, blocks=(first,), events_s=np.empty(0), events=())
    problem = whole_task_problem("mine", (nothing, plan), robot, TASK)
    assert problem.plans == (plan,)
    with pytest.raises(ConfigError, match="--problem mine: none of 1 tasks takes one object"):
        whole_task_problem("mine", (nothing,), robot, TASK)


def test_recipes_are_of_whole_tasks():
    for kind, recipe in WHOLE_TASK_RECIPES.items():
        config = load_pipeline(find_resource("pipelines", recipe))
        assert config.task == kind
        assert is_whole_task(config.task)
